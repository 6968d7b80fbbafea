"""How the operator's station keeps time: pictures a second at the server, and delay behind real time.

    python tests/benchmarks/station.py [--seconds 30] [--browser]

One experiment runs live in real time, with the whole arm, its ghost and the force. `--browser` lets headless Chromium
watch, which draws in software where there is no graphics card and takes most of the processors itself.
"""

import argparse
import shutil
import tempfile
import threading
from contextlib import ExitStack
from dataclasses import replace
from pathlib import Path
from time import perf_counter, process_time

from scenarios.experiments.registry import load
from scenarios.station.station import Station


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seconds", type=float, default=30.0)
    parser.add_argument("--browser", action="store_true")
    options = parser.parse_args()
    with ExitStack() as stack:
        station = Station(Path(stack.enter_context(tempfile.TemporaryDirectory())))
        stack.callback(station.close)
        if options.browser:
            from playwright.sync_api import sync_playwright

            playwright = stack.enter_context(sync_playwright())
            chromium = playwright.chromium.launch(
                executable_path=shutil.which("chromium"),
                args=["--no-sandbox", "--use-angle=swiftshader", "--enable-unsafe-swiftshader"],
            )
            stack.callback(chromium.close)
            page = chromium.new_page(viewport={"width": 1280, "height": 800})
            page.goto(station.address)
            page.get_by_role("tab", name="Experiment").wait_for()
        ended, watched = threading.Event(), [0.0]
        began, processor = perf_counter(), process_time()
        station.motion.run(
            replace(load("siso-5-elbow_pitch"), duration=options.seconds),
            watch=lambda frames: watched.__setitem__(0, frames[-1].time),
            done=lambda log, why: ended.set(),
        )
        ended.wait()
        wall, processor = perf_counter() - began, process_time() - processor
        motion = station.motion
        print(f"{watched[0]:.2f} s of experiment in {motion.elapsed:.2f} s ({wall:.2f} s with loading the arm)")
        print(f"{motion.pictures / motion.elapsed:.1f} pictures a second, largest delay {1e3 * motion.lag:.1f} ms")
        print(f"{processor / wall:.0%} of one processor")


if __name__ == "__main__":
    main()
