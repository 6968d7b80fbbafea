"""Make the pictures of docs/station.md and the film of the README from a walk through the station, in Chromium.

    python docs/images/station.py

Needs the extra `dev` and Debian's package chromium.
"""

import io
import re
import signal
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path

import numpy as np
from PIL import Image
from playwright.sync_api import sync_playwright

ROOT = Path(__file__).parents[2]
sys.path.insert(0, str(ROOT))

from scenarios.experiments.film import write_film  # noqa: E402
from tests.scenarios.station.walk import CHROMIUM, FLAGS, open_page, walk  # noqa: E402

FOLDER = Path(__file__).parent / "station"

LEFT_OUT = {"fit"}
"""Places of the walk that docs/station.md does not show."""

MOVING = {"run": 10, "drive": 10, "study": 10}
"""Frames of the film at places where the arm moves."""

STILL, RATE, FILM = 5, 4.0, (800, 500)
"""Frames at other places, frames a second, and their size."""


def frames(shots: list[Image.Image]) -> Iterator[np.ndarray]:
    """Yield the frames of the film."""
    for shot in shots:
        yield np.asarray(shot.resize(FILM, Image.Resampling.LANCZOS))


def main() -> None:
    """Write `station/*.png` and `station.gif` beside this file."""
    FOLDER.mkdir(exist_ok=True)
    film: list[Image.Image] = []
    with tempfile.TemporaryDirectory() as folder, sync_playwright() as run:
        command = [sys.executable, "-m", "scenarios", "station", "--no-browser", "--out", folder]
        with subprocess.Popen(command, cwd=ROOT, stdout=subprocess.PIPE, text=True) as station:
            (address,) = re.findall(r"http://\S+:\d+", station.stdout.readline() if station.stdout else "")
            browser = run.chromium.launch(executable_path=CHROMIUM, args=FLAGS)
            page = open_page(browser, address)
            notice = page.locator(".mantine-Notification-closeButton")
            notice.wait_for()
            notice.click()

            def shot() -> Image.Image:
                return Image.open(io.BytesIO(page.screenshot())).convert("RGB")

            def picture(name: str) -> None:
                first = shot()
                if name not in LEFT_OUT:
                    first.quantize(255, dither=Image.Dither.NONE).save(FOLDER / f"{name}.png", optimize=True)
                film.extend([first, *(shot() for _ in range(MOVING[name]))] if name in MOVING else [first] * STILL)

            walk(page, picture, ("OE: output error", "choose for me"))
            browser.close()
            station.send_signal(signal.SIGINT)
    write_film(frames(film), FOLDER.parent / "station.gif", rate=RATE)


if __name__ == "__main__":
    main()
