"""Builds of a data set that are killed again and again: is anything lost?

A build is killed by SIGKILL, at random moments or at a random wait for the disk, and resumed by the same command. When
it ends before it is killed, the next build begins. At the end every file of every data set is compared with those of an
undisturbed build.
"""

import os
import signal
import sqlite3
import subprocess
import sys
import tempfile
import time
from contextlib import closing, suppress
from dataclasses import dataclass
from hashlib import sha256
from pathlib import Path

import numpy as np

from tests.benchmarks.tables import heading, options, row

SPEC = """
name = "killed"
version = 1
title = "Thirty records of 20 s"
seed = 25

[[records]]
name = "binary"
part = "train"
axes = ["shoulder_yaw", "shoulder_pitch", "elbow_pitch"]
each_axis = true
repeats = 8
duration = 20.0
draw_waveforms = true
excitation = { kind = "prbs", amplitude = 1.0, clock = 2, register = 20 }

[[records]]
name = "noise"
part = "test"
axes = ["shoulder_yaw", "shoulder_pitch", "elbow_pitch"]
each_axis = true
repeats = 2
duration = 20.0
draw_waveforms = true
excitation = { kind = "white_noise", amplitude = 0.5 }
"""

CHILD = """
import os, signal, sys
at, calls, fsync = int(sys.argv.pop(1)), 0, os.fsync
def counted(descriptor):
    global calls
    calls += 1
    if calls == at:
        os.kill(os.getpid(), signal.SIGKILL)
    fsync(descriptor)
os.fsync = counted
from scenarios.commands.cli import main
code = main(sys.argv[1:])
print(calls, file=sys.stderr)
sys.exit(code)
"""
"""The command line, which kills itself at a given wait for the disk; without one it says how many there were."""


@dataclass(frozen=True)
class Ended:
    """How a build ended; how often it waited for the disk is known of one that was not killed."""

    killed: bool
    seconds: float
    waits: int


def run(spec, out, *, after=None, wait=0, rows=4):
    """Build in a process of its own, and kill it after a time, s, or when it waits for the disk that often.

    Few experiments run side by side, so that there are many moments between chunks.
    """
    words = ["dataset", "build", str(spec), "--out", str(out), "--rows", str(rows), "--progress", "none"]
    begun = time.monotonic()
    command = [sys.executable, "-c", CHILD, str(wait), *words]
    with subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True) as child:
        try:
            _, messages = child.communicate(timeout=after)
        except subprocess.TimeoutExpired:
            child.kill()
            _, messages = child.communicate()
    seconds = time.monotonic() - begun
    if child.returncode == -signal.SIGKILL:
        return Ended(True, seconds, 0)
    if child.returncode:
        raise RuntimeError(f"exit code {child.returncode}: {messages}")
    return Ended(False, seconds, int(messages.split()[-1]))


def contents(folder):
    paths = (path for path in folder.rglob("*") if path.is_file())
    return {path.relative_to(folder).as_posix(): sha256(path.read_bytes()).hexdigest() for path in paths}


def state(out):
    """What a killed build has left."""
    folders = list(out.iterdir())
    if not folders:
        return "nothing"
    (folder,) = folders
    journal = folder / "journal.sqlite"
    keys = []
    if journal.exists():
        with closing(sqlite3.connect(journal)) as database, suppress(sqlite3.Error):
            keys = [key for (key,) in database.execute("SELECT key FROM entries")]
    experiments = sum(key.startswith("experiment") for key in keys)
    half = sum(path.name.endswith(".partial") for path in folder.rglob("*"))
    end = "done but for its journal" if journal.exists() else "done"
    if folder.name.endswith(".unfinished"):
        end = "checksums" if (folder / "SHA256SUMS").exists() else ""
    parts = [f"{experiments} experiments", f"{len(keys) - experiments} pieces", f"{half} half files", end]
    return ", ".join(part for part in parts if part and not part.startswith("0 "))


def kills(spec, folder, number, seed):
    """Kill builds and resume them, and print how each ended and what was there then.

    Raises:
        RuntimeError: A file of a data set differs from that of a build that nobody disturbed.
    """
    rng = np.random.default_rng(seed)
    whole = run(spec, folder / "undisturbed")
    (reference,) = (folder / "undisturbed").iterdir()
    expected = contents(reference)
    row(f"undisturbed, {whole.waits} waits for the disk", f"{len(expected)} files")
    killed = builds = 0
    while True:
        out = folder / f"build-{builds}"
        out.mkdir(exist_ok=True)
        if killed == number:
            ended, how = run(spec, out), "not killed"
        elif killed % 2:
            wait = int(rng.integers(1, whole.waits // 2))
            ended, how = run(spec, out, wait=wait), f"at wait {wait}"
        else:
            after = float(rng.uniform(0.0, 0.7 * whole.seconds))
            ended, how = run(spec, out, after=after), f"after {after:.1f} s"
        killed += ended.killed
        row(f"kill {killed}, {how}" if ended.killed else f"came to its end, {how}", state(out))
        if not ended.killed:
            if contents(out / reference.name) != expected or os.listdir(out) != [reference.name]:
                raise RuntimeError(f"{out} differs from an undisturbed build: {os.listdir(out)}")
            builds += 1
            if killed == number:
                row(f"{builds} data sets after {killed} kills", "every file equal")
                return


def main():
    parser = options(__doc__)
    parser.add_argument("--kills", type=int, default=25)
    parser.add_argument("--seed", type=int, default=1)
    arguments = parser.parse_args()
    heading("build", "what was there then")
    with tempfile.TemporaryDirectory() as name:
        spec = Path(name) / "killed.toml"
        spec.write_text(SPEC)
        kills(spec, Path(name), arguments.kills, arguments.seed)


if __name__ == "__main__":
    main()
