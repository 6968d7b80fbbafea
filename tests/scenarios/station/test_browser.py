"""The station in headless Chromium, from the waveform to the bandwidth beside the truth."""

import os
import re
import shutil
import signal
import subprocess
import sys
from pathlib import Path

import pytest

playwright = pytest.importorskip("playwright.sync_api")

CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser")
PICTURES = Path(__file__).parents[3] / "build" / "station"
PATIENCE = 120_000
"""Longest wait for something to appear, ms: only a hanging page takes as long."""

pytestmark = [pytest.mark.slow, pytest.mark.skipif(CHROMIUM is None, reason="no Chromium here")]


@pytest.fixture(scope="module")
def address(tmp_path_factory):
    """The address that `hmtb station` prints; Ctrl-C ends it cleanly."""
    folder = tmp_path_factory.mktemp("station")
    command = [sys.executable, "-m", "scenarios", "station", "--no-browser", "--out", str(folder)]
    environment = {**os.environ, "PYTHONPATH": str(Path(__file__).parents[3])}
    with subprocess.Popen(
        command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, env=environment
    ) as process:
        try:
            (found,) = re.findall(r"http://127\.0\.0\.1:\d+", process.stdout.readline())
            yield found
        finally:
            process.send_signal(signal.SIGINT)
            out, err = process.communicate(timeout=60)
    assert process.returncode == 0
    assert out == "station: ended\n"
    assert err == ""


@pytest.fixture(scope="module")
def chromium():
    with playwright.sync_playwright() as run:
        browser = run.chromium.launch(
            executable_path=CHROMIUM, args=["--no-sandbox", "--use-angle=swiftshader", "--enable-unsafe-swiftshader"]
        )
        yield browser
        browser.close()


@pytest.fixture
def page(chromium, address):
    requested = []
    one = chromium.new_page(viewport={"width": 1280, "height": 800})
    one.set_default_timeout(PATIENCE)
    one.on("request", lambda request: requested.append(request.url))
    one.goto(address)
    one.get_by_role("tab", name="Experiment").wait_for()
    yield one
    one.close()
    foreign = [url for url in requested if not url.startswith((address, "data:", "blob:"))]
    assert not foreign, "the page is complete without a network"


def button(page, name):
    return page.get_by_role("button", name=name, exact=True)


def tab(page, name):
    page.get_by_role("tab", name=name).click()


def picture(page, name):
    PICTURES.mkdir(parents=True, exist_ok=True)
    page.screenshot(path=PICTURES / f"{name}.png")


def field(page, label):
    """The input that stands beside a label, of the tab that is shown."""
    words = page.locator(f'xpath=//label[normalize-space(.)="{label}"]').locator("visible=true").first
    return words.locator("xpath=following::input[1]")


def test_an_experiment_is_run_and_stopped(page):
    tab(page, "Experiment")
    field(page, "amplitude / V").fill("two")
    page.get_by_text("expected a number, given 'two'").wait_for()
    field(page, "amplitude / V").fill("1")
    button(page, "Run").click()
    button(page, "EMERGENCY SHUTDOWN").click()
    page.get_by_text("SHUT DOWN", exact=False).first.wait_for()
    button(page, "Power on again").click()
    picture(page, "experiment")
    button(page, "Stop and keep the record").click()
    page.get_by_text("s recorded").wait_for()


def test_the_arm_is_driven_by_keys_and_buttons(page):
    tab(page, "Drive")
    button(page, "Drive").click()
    page.keyboard.down("i")
    page.keyboard.down("h")
    page.get_by_text("+2.0 V").nth(1).wait_for()  # both keys, although browsers repeat the last alone
    picture(page, "drive")
    page.keyboard.up("i")
    page.keyboard.up("h")
    page.get_by_text("+2.0 V").first.wait_for(state="hidden")
    button(page, "\N{MINUS SIGN} K").hover()
    page.mouse.down()
    page.get_by_text("-2.0 V").wait_for()
    page.mouse.up()
    page.get_by_text("-2.0 V").wait_for(state="hidden")
    button(page, "End").click()
    page.get_by_text("exchange: not inserted, the unit was not released").wait_for()


def test_a_second_browser_watches_and_takes_over(page, chromium, address):
    other = chromium.new_page(viewport={"width": 640, "height": 480})
    other.set_default_timeout(PATIENCE)
    other.goto(address)
    other.get_by_text("You watch.").wait_for()
    assert other.get_by_role("tab").count() == 0
    page.goto("about:blank")
    other.get_by_role("tab", name="Experiment").wait_for()
    other.close()
