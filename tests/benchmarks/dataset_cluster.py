"""Data sets on a Dask cluster whose parts are killed: the same bits as of an undisturbed build?

    python tests/benchmarks/dataset_cluster.py

A scheduler and two workers run as processes of their own on this machine. Each row is a build with `hmtb dataset build
--cluster`, disturbed while it runs; its hash of all arrays is held against that of a build in one process.
"""

import json
import os
import signal
import socket
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from time import monotonic, sleep

ROOT = Path(__file__).parents[2]
SPEC = """
name = "disturbed"
version = 1
title = "Short records on twelve arms"
seed = 11
window = 50
channels = "studied"

[baselines]
models = []

[truth]
floors = 0

[twins]
count = 12
mass = { kind = "lognormal", spread = 0.1 }

[[records]]
name = "prbs"
part = "train"
axes = ["elbow_pitch"]
duration = 8.0
draw_waveforms = true
excitation = { kind = "prbs", amplitude = 1.0, clock = 2, register = 7 }

[[records]]
name = "noise"
part = "test"
axes = ["elbow_pitch"]
duration = 8.0
draw_waveforms = true
excitation = { kind = "white_noise", amplitude = 2.0 }
"""
ROWS = 2
LABEL = "disturbed-v1"
PATIENCE = 60.0


class Parts:
    """A scheduler and workers, each a process, started and killed by name."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        with socket.socket() as free:
            free.bind(("127.0.0.1", 0))
            self._port = free.getsockname()[1]
        self.address = f"tcp://127.0.0.1:{self._port}"
        self._processes: dict[str, subprocess.Popen[bytes]] = {}

    def start(self, name: str, *, deaths: int = 3) -> None:
        """Start the scheduler, which gives a chunk up after so many deaths of workers, or a worker."""
        command = [sys.executable, "-m", "distributed.cli.dask_scheduler", "--host", "127.0.0.1", "--no-dashboard"]
        command += ["--port", str(self._port)]
        if name != "scheduler":
            command = [sys.executable, "-m", "distributed.cli.dask_worker", self.address, "--nthreads", "1"]
            command += ["--no-nanny", "--no-dashboard", "--death-timeout", "60"]
        environment = {**_environment(), "DASK_DISTRIBUTED__SCHEDULER__ALLOWED_FAILURES": str(deaths)}
        with (self._folder / f"{name}.log").open("ab") as log:
            self._processes[name] = subprocess.Popen(command, stdout=log, stderr=log, env=environment)

    def kill(self, name: str) -> None:
        """Kill one without a warning."""
        self._processes[name].kill()
        self._processes.pop(name).wait()

    def close(self) -> None:
        """Kill all that are there."""
        for name in list(self._processes):
            self.kill(name)


def _environment() -> dict[str, str]:
    path = os.pathsep.join(filter(None, (str(ROOT), os.environ.get("PYTHONPATH"))))
    return {**os.environ, "PYTHONPATH": path, "OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1"}


@contextmanager
def cluster(folder: Path) -> Iterator[Parts]:
    """A scheduler with two workers."""
    parts = Parts(folder)
    try:
        for name in ("scheduler", "a", "b"):
            parts.start(name)
        yield parts
    finally:
        parts.close()


def started(spec: Path, out: Path, *options: str) -> subprocess.Popen[str]:
    """Start a build."""
    words = [sys.executable, "-m", "scenarios", "dataset", "build", str(spec), "--out", str(out), "--rows", str(ROWS)]
    return subprocess.Popen(
        [*words, "--json", *options], env=_environment(), text=True, stdout=subprocess.PIPE, stderr=subprocess.PIPE
    )


def ended(build: "subprocess.Popen[str]") -> tuple[int, str, str]:
    """Exit code, hash and what was said of a build."""
    out, said = build.communicate(timeout=600)
    return build.returncode, json.loads(out)["hash"] if build.returncode == 0 else "", said.strip()


def noted(out: Path) -> int:
    """Number of records in the folder of an unfinished build."""
    return len(list((out / f"{LABEL}.unfinished").glob("data/*/*.nc")))


def when(out: Path, build: "subprocess.Popen[str]", count: int) -> None:
    """Wait until some experiments are noted.

    Raises:
        RuntimeError: The build has ended before.
    """
    since = monotonic()
    while noted(out) < count:
        if build.poll() is not None or monotonic() - since > 300:
            raise RuntimeError(f"the build was to be disturbed, but had ended: {build.communicate()[1]}")
        sleep(0.05)


def undisturbed(parts: Parts, spec: Path, out: Path) -> str:
    """Two workers."""
    return _hash(started(spec, out, "--cluster", parts.address))


def workers_killed(parts: Parts, spec: Path, out: Path) -> str:
    """A worker killed at work, another started; then the second killed, too, until there is none."""
    build = started(spec, out, "--cluster", parts.address, "--patience", str(PATIENCE))
    when(out, build, 1)
    parts.kill("a")
    parts.start("c")
    when(out, build, noted(out) + 1)
    parts.kill("b")
    parts.kill("c")
    sleep(3.0)
    parts.start("d")
    return _hash(build)


def chunk_given_up(parts: Parts, spec: Path, out: Path) -> str:
    """A worker killed whose chunk the scheduler then gives up: its experiments run one by one."""
    parts.close()
    parts.start("scheduler", deaths=0)
    parts.start("c")
    build = started(spec, out, "--cluster", parts.address, "--patience", str(PATIENCE))
    when(out, build, 1)
    # The only worker is at work.
    parts.kill("c")
    parts.start("d")
    code, found, said = ended(build)
    if "one by one" not in said:
        raise RuntimeError(f"exit {code}, expected a chunk that was parted: {said}")
    return found


def scheduler_restarted(parts: Parts, spec: Path, out: Path) -> str:
    """The scheduler killed at work and started again at its address, while the build waits."""
    build = started(spec, out, "--cluster", parts.address, "--patience", str(PATIENCE))
    when(out, build, 1)
    parts.kill("scheduler")
    sleep(3.0)
    parts.start("scheduler")
    # A worker leaves with its scheduler, as Dask has it.
    for name in ("e", "f"):
        parts.start(name)
    return _hash(build)


def scheduler_gone(parts: Parts, spec: Path, out: Path) -> str:
    """The scheduler killed and not started again; the same command later, with another one."""
    build = started(spec, out, "--cluster", parts.address, "--patience", "2")
    when(out, build, 1)
    parts.kill("scheduler")
    code, _, said = ended(build)
    if code != 2 or "the same command goes on from there" not in said:
        raise RuntimeError(f"exit {code}, expected 2: {said}")
    for name in ("scheduler", "g", "h"):
        parts.start(name)
    return _hash(started(spec, out, "--cluster", parts.address))


def builder_killed(parts: Parts, spec: Path, out: Path) -> str:
    """The builder killed; the same command on threads, and without the cluster."""
    build = started(spec, out, "--cluster", parts.address)
    when(out, build, 1)
    build.send_signal(signal.SIGKILL)
    build.wait()
    return _hash(started(spec, out))


def _hash(build: "subprocess.Popen[str]") -> str:
    code, found, said = ended(build)
    if code:
        raise RuntimeError(f"exit {code}: {said.splitlines()[-1]}")
    return found


ROWS_OF_TABLE: tuple[tuple[str, Callable[[Parts, Path, Path], str]], ...] = (
    ("none; two workers", undisturbed),
    ("a worker killed, then both, a new one started", workers_killed),
    ("a worker killed, its chunk given up by the scheduler: run one by one", chunk_given_up),
    ("scheduler killed, started again at its address", scheduler_restarted),
    ("scheduler killed for good, build ended with exit 2, resumed on a new one", scheduler_gone),
    ("builder killed, resumed in one process", builder_killed),
)


def main() -> int:
    """Print the table; 1 where a hash is another one."""
    fine = True
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        spec = folder / "disturbed.toml"
        spec.write_text(SPEC, encoding="utf-8")
        expected = _hash(started(spec, folder / "here"))
        print("| Disturbance of a build on a cluster | Hash of all arrays |")
        print("|---|---|")
        for number, (what, disturbed) in enumerate(ROWS_OF_TABLE):
            with cluster(folder) as parts:
                found = disturbed(parts, spec, folder / str(number))
            same = found == expected
            fine &= same
            print(f"| {what} | {'as of one process' if same else 'DIFFERENT'} |", flush=True)
    return 0 if fine else 1


if __name__ == "__main__":
    sys.exit(main())
