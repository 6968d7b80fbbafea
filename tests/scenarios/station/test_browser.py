"""The station in headless Chromium, from the waveform to the bandwidth beside the truth."""

import os
import re
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from hmtb_twin import linearize, load_arm
from tests.scenarios.station.walk import CHROMIUM, FLAGS, PATIENCE, button, field, open_page, tab, walk
from tests.signals import default_signals, end

playwright = pytest.importorskip("playwright.sync_api")

PICTURES = Path(__file__).parents[3] / "build" / "station"
# Chromium draws in software: how much processor time that takes depends on how busy the machine is.
pytestmark = [pytest.mark.thorough, pytest.mark.skipif(CHROMIUM is None, reason="no Chromium here")]


@pytest.fixture(scope="module")
def address(tmp_path_factory):
    """The address that `hmtb station` prints; Ctrl-C ends it cleanly."""
    folder = tmp_path_factory.mktemp("station")
    command = [sys.executable, "-m", "scenarios", "station", "--no-browser", "--out", str(folder)]
    environment = {**os.environ, "PYTHONPATH": str(Path(__file__).parents[3])}
    pipes = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "text": True}
    with subprocess.Popen(command, env=environment, preexec_fn=default_signals, **pipes) as process:
        try:
            (found,) = re.findall(r"http://127\.0\.0\.1:\d+", process.stdout.readline())
            yield found
        finally:
            out, err = end(process, signal.SIGINT)
    assert process.returncode == 0
    assert out == "station: ended\n"
    assert err == ""


@pytest.fixture(scope="module")
def chromium():
    with playwright.sync_playwright() as run:
        browser = run.chromium.launch(executable_path=CHROMIUM, args=FLAGS)
        yield browser
        browser.close()


@pytest.fixture
def page(chromium, address):
    one = open_page(chromium, address, scale=0.5)
    yield one
    one.close()
    foreign = [url for url in one.requested if not url.startswith((address, "data:", "blob:"))]
    assert not foreign, "the page is complete without a network"


def picture(page, name):
    PICTURES.mkdir(parents=True, exist_ok=True)
    page.screenshot(path=PICTURES / f"{name}.png")


def test_from_the_waveform_to_the_bandwidth_beside_the_truth(page):
    rows = [row.split("\t") for row in walk(page, lambda name: picture(page, name)).splitlines()]
    table = {row[0].strip(): row[1:] for row in rows}
    assert table["truth"][1] == f"{linearize(load_arm()).joint('shoulder_pitch').bandwidth_hz:.3f}"
    chosen = next(table[name] for name in table if name.startswith("1: OE 2/2/1"))
    low, high = map(float, chosen[2].split(" to "))
    assert low < float(chosen[1]) < high
    assert chosen[3] == ("yes" if low <= float(table["truth"][1]) <= high else "no")


def test_a_wrong_field_and_a_shutdown(page):
    tab(page, "Experiment")
    field(page, "amplitude / V").fill("two")
    page.get_by_text("expected a number, given 'two'").wait_for()
    picture(page, "wrong")
    field(page, "amplitude / V").fill("1")
    button(page, "Run").click()
    button(page, "EMERGENCY SHUTDOWN").click()
    page.get_by_text("SHUT DOWN", exact=False).first.wait_for()
    button(page, "Power on again").click()
    button(page, "Stop and keep the record").click()
    page.get_by_text("s recorded").wait_for()


def test_the_arm_is_driven_by_keys_and_buttons(page):
    tab(page, "Drive")
    button(page, "Drive").click()
    page.keyboard.down("i")
    page.keyboard.down("h")
    page.get_by_text("+2.0 V").nth(1).wait_for()  # both keys, although browsers repeat the last alone
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
    page.set_viewport_size({"width": 500, "height": 100})
    other = chromium.new_page(viewport={"width": 500, "height": 100}, device_scale_factor=0.5)
    other.set_default_timeout(PATIENCE)
    other.goto(address)
    other.get_by_text("You watch.").wait_for()
    assert other.get_by_role("tab").count() == 0
    page.goto("about:blank")
    other.get_by_role("tab", name="Experiment").wait_for()
    other.close()
