"""A walk through the station in a browser, from the waveform to the bandwidth beside the truth and to a replay."""

import re
import shutil

CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser")
FLAGS = ["--no-sandbox", "--use-angle=swiftshader", "--enable-unsafe-swiftshader"]
PATIENCE = 120_000
"""Longest wait for something to appear, ms: only a hanging page takes as long."""


def open_page(chromium, address, *, width=1280, height=800, scale=1.0):
    """Return a page on which the station stands; what it requests is in `requested`.

    A page of half the scale takes a quarter of the time where Chromium draws the arm in software.
    """
    page = chromium.new_page(viewport={"width": width, "height": height}, device_scale_factor=scale)
    page.set_default_timeout(PATIENCE)
    page.requested = []
    page.on("request", lambda request: page.requested.append(request.url))
    page.goto(address)
    page.get_by_role("tab", name="Experiment").wait_for()
    return page


def button(page, name):
    return page.get_by_role("button", name=name, exact=True).locator("visible=true").first


def tab(page, name):
    page.get_by_role("tab", name=name, exact=True).click()


def field(page, label):
    """The input that stands beside a label, of the tab that is shown."""
    words = page.locator(f'xpath=//label[normalize-space(.)="{label}"]').locator("visible=true").first
    return words.locator("xpath=following::input[1]")


def choose(page, label, option):
    field(page, label).click()
    page.get_by_role("option", name=option, exact=True).click()


def scroll(page, distance):
    """Scroll the tab that is shown by a distance in pixels."""
    page.mouse.move(1040, 600)
    page.mouse.wheel(0, distance)
    page.wait_for_timeout(1000)


def walk(page, picture, estimators=("OE: output error",)):
    """Go from tab to tab.

    Args:
        page: The page.
        picture: Called with a name wherever there is something to see.
        estimators: What the menu of estimators offers, for one model each.

    Returns:
        Text of the table of models.
    """
    tab(page, "Waveform")
    field(page, "amplitude / V").fill("2")
    page.get_by_text("does not play this yet").wait_for()
    picture("waveform")
    button(page, "Use in the experiment").click()
    page.get_by_text("plays this").wait_for()
    tab(page, "Experiment")
    field(page, "duration / s").fill("60")
    page.get_by_text("command rate-limited:").wait_for()
    scroll(page, 2000)
    picture("preview")
    button(page, "Run").click()
    page.get_by_text(re.compile(r"^([4-9]|1\d)\.\d of 60 s")).wait_for()
    picture("run")
    button(page, "EMERGENCY SHUTDOWN").click()
    page.get_by_text(re.compile(r" of 60 s.*SHUT DOWN")).wait_for()
    page.wait_for_timeout(3000)
    picture("shutdown")
    button(page, "Stop and keep the record").click()
    page.get_by_text("s recorded").wait_for()
    choose(page, "start from", "siso-5-shoulder_pitch")
    choose(page, "speed", "as fast as it goes")
    button(page, "Run").click()
    page.get_by_text("240 s recorded").wait_for()
    tab(page, "Identify")
    for estimator in estimators:
        choose(page, "estimator", estimator)
        button(page, "Identify").click()
        page.get_by_role("button", name="Stop", exact=True).locator("visible=true").first.wait_for(state="visible")
        button(page, "Identify").wait_for()
    models = page.locator("table").filter(has_text="truth").first
    models.wait_for()
    text = models.inner_text()
    for name in ("Numbers", "Bode", "Poles and zeros", "Residuals", "Fit"):
        tab(page, name)
        scroll(page, 300 if name == "Numbers" else 2000)
        picture(name.split()[0].lower())
    tab(page, "Drive")
    button(page, "Drive").click()
    page.keyboard.down("i")
    page.get_by_text("+2.0 V").first.wait_for()
    page.wait_for_timeout(3000)
    picture("drive")
    page.keyboard.up("i")
    button(page, "End").click()
    page.get_by_text("exchange: not inserted").wait_for()
    tab(page, "Study")
    field(page, "open").fill("rpcm")
    button(page, "Open").click()
    button(page, "Play").click()
    page.wait_for_timeout(3000)
    picture("study")
    button(page, "Pause").click()
    return text
