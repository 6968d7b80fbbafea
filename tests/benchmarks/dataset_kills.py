"""Builds of a data set that are killed again and again: is anything lost?

A build is killed by SIGKILL, at random moments or at a random wait for the disk, and resumed by the same command. When
it ends before it is killed, the next build begins. At the end every file of every data set is compared with those of an
undisturbed build.

    python tests/benchmarks/dataset_kills.py --kills 25 --seed 1
"""

import argparse
import os
import signal
import sqlite3
import subprocess
import sys
import tempfile
import time
from collections.abc import Mapping, Sequence
from contextlib import closing, suppress
from dataclasses import dataclass
from hashlib import sha256
from pathlib import Path

import numpy as np

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

ROWS = 4
"""Experiments side by side: few, so that there are many moments between chunks."""

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
    """How a build ended.

    Attributes:
        killed: Whether it was killed before its end.
        seconds: How long it ran.
        waits: How often it waited for the disk, if it came to its end.
    """

    killed: bool
    seconds: float
    waits: int


def run(spec: Path, out: Path, *, after: float | None = None, wait: int = 0, rows: int = ROWS) -> Ended:
    """Build in a process of its own, and kill it.

    Args:
        spec: The spec.
        out: Where the folder of the data set is made.
        after: Killed after that time, s, where given.
        wait: Killed when it waits for the disk that often; 0: not.
        rows: Experiments side by side.

    Raises:
        RuntimeError: It ended by itself in another way than done.
    """
    words = ["dataset", "build", str(spec), "--out", str(out), "--rows", str(rows), "--progress", "none"]
    begun = time.monotonic()
    command = [sys.executable, "-c", CHILD, str(wait), *words]
    with subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True) as child:
        try:
            _, said = child.communicate(timeout=after)
        except subprocess.TimeoutExpired:
            child.kill()
            _, said = child.communicate()
    seconds = time.monotonic() - begun
    if child.returncode == -signal.SIGKILL:
        return Ended(True, seconds, 0)
    if child.returncode:
        raise RuntimeError(f"exit code {child.returncode}: {said}")
    return Ended(False, seconds, int(said.split()[-1]))


def contents(folder: Path) -> Mapping[str, str]:
    """Hash of every file in a folder."""
    paths = (path for path in folder.rglob("*") if path.is_file())
    return {path.relative_to(folder).as_posix(): sha256(path.read_bytes()).hexdigest() for path in paths}


def state(out: Path) -> str:
    """What a killed build has left."""
    done = [path for path in out.iterdir() if not path.name.endswith(".unfinished")]
    folders = [*done, *out.glob("*.unfinished")]
    if not folders:
        return "nothing"
    (folder,) = folders
    journal = folder / "journal.sqlite"
    keys: list[str] = []
    if journal.exists():
        with closing(sqlite3.connect(journal)) as database, suppress(sqlite3.Error):
            keys = [key for (key,) in database.execute("SELECT key FROM entries")]
    experiments = sum(key.startswith("experiment") for key in keys)
    half = sum(path.name.endswith(".partial") for path in folder.rglob("*"))
    end = "done but for its journal" if journal.exists() else "done"
    named = end if done else "checksums" if (folder / "SHA256SUMS").exists() else ""
    parts = [f"{experiments} experiments", f"{len(keys) - experiments} pieces", f"{half} half files", named]
    return ", ".join(part for part in parts if part and not part.startswith("0 "))


def kills(spec: Path, folder: Path, number: int, seed: int) -> Sequence[tuple[str, str]]:
    """Kill builds and go on with them.

    Args:
        spec: The spec.
        folder: An empty one.
        number: How many kills.
        seed: Of their moments.

    Returns:
        How each build ended, and what was there then.

    Raises:
        RuntimeError: A file of a data set differs from that of a build that nobody disturbed.
    """
    rng = np.random.default_rng(seed)
    undisturbed = folder / "undisturbed"
    whole = run(spec, undisturbed)
    (reference,) = undisturbed.iterdir()
    expected = contents(reference)
    rows = [(f"undisturbed, {whole.waits} waits for the disk", f"{len(expected)} files")]
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
        rows.append((f"kill {killed}, {how}" if ended.killed else f"came to its end, {how}", state(out)))
        if not ended.killed:
            found = contents(out / reference.name)
            different = sorted(name for name in {*found, *expected} if found.get(name) != expected.get(name))
            if different or os.listdir(out) != [reference.name]:
                raise RuntimeError(f"{out}: {', '.join(different) or os.listdir(out)} differ")
            builds += 1
            if killed == number:
                rows.append((f"{builds} data sets after {killed} kills", "every file equal"))
                return rows


def main() -> int:
    """Run and print."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--kills", type=int, default=25)
    parser.add_argument("--seed", type=int, default=1)
    given = parser.parse_args()
    with tempfile.TemporaryDirectory() as name:
        spec = Path(name) / "killed.toml"
        spec.write_text(SPEC)
        rows = kills(spec, Path(name), given.kills, given.seed)
    print("| build | what was there then |\n|---|---|")
    for row in rows:
        print(f"| {' | '.join(row)} |")
    return 0


if __name__ == "__main__":
    sys.exit(main())
