"""Data sets on a Dask cluster whose parts are killed: the same bits as of an undisturbed build?

A scheduler and two workers run as processes of their own on this machine. Each row is a build with `hmtb dataset build
--cluster`, disturbed while it runs; its hash of all arrays is held against that of a build in one process.
"""

import json
import socket
import subprocess
import sys
import tempfile
from contextlib import closing
from pathlib import Path
from time import monotonic, sleep

from tests.benchmarks.tables import environment, heading, row

SPEC = """
name = "disturbed"
version = 1
title = "Short records on twelve arms"
seed = 11
window = 50

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
excitation = { kind = "prbs", amplitude = 1.0, clock = 2, register = 7 }

[[records]]
name = "noise"
part = "test"
axes = ["elbow_pitch"]
duration = 8.0
excitation = { kind = "white_noise", amplitude = 2.0 }
"""


class Cluster:
    """A scheduler and two workers, each a process, started and killed by name."""

    def __init__(self, folder):
        with socket.socket() as free:
            free.bind(("127.0.0.1", 0))
            self._port = free.getsockname()[1]
        self.address, self._folder, self._processes = f"tcp://127.0.0.1:{self._port}", folder, {}
        self.start("scheduler", "a", "b")

    def start(self, *names, deaths=3):
        """Start workers, or the scheduler, which gives a chunk up after so many deaths of workers."""
        for name in names:
            command = [sys.executable, "-m", "distributed.cli.dask_worker", self.address, "--nthreads", "1"]
            command += ["--no-nanny", "--death-timeout", "60"]
            if name == "scheduler":
                command = [sys.executable, "-m", "distributed.cli.dask_scheduler", "--host", "127.0.0.1"]
                command += ["--port", str(self._port)]
            settings = {**environment(), "DASK_DISTRIBUTED__SCHEDULER__ALLOWED_FAILURES": str(deaths)}
            with (self._folder / f"{name}.log").open("ab") as log:
                command.append("--no-dashboard")
                self._processes[name] = subprocess.Popen(command, stdout=log, stderr=log, env=settings)

    def kill(self, *names):
        for name in names:
            self._processes[name].kill()
            self._processes.pop(name).wait()

    def close(self):
        self.kill(*self._processes)


class Build:
    """A build as a process of its own, on a cluster or in one process."""

    def __init__(self, spec, out, cluster=None, patience=60):
        words = ["-m", "scenarios", "dataset", "build", str(spec), "--out", str(out), "--rows", "2", "--json"]
        words += ["--cluster", cluster.address, "--patience", str(patience)] if cluster else []
        pipes = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "text": True}
        self._unfinished = out / "disturbed-v1.unfinished"
        self.process = subprocess.Popen([sys.executable, *words], env=environment(), **pipes)

    def end(self, code=0):
        """Hash and messages of a build that ends with an exit code."""
        out, messages = self.process.communicate(timeout=600)
        if self.process.returncode != code:
            raise RuntimeError(f"exit {self.process.returncode}, expected {code}: {messages.strip()}")
        return "" if code else json.loads(out)["hash"], messages

    def records(self):
        return len(list(self._unfinished.glob("data/*/*.nc")))

    def wait(self):
        """Wait until another record is there."""
        since, count = monotonic(), self.records()
        while self.records() <= count:
            if self.process.poll() is not None or monotonic() - since > 300:
                raise RuntimeError(f"the build was to be disturbed, but had ended: {self.process.communicate()[1]}")
            sleep(0.05)
        return self


def undisturbed(cluster, spec, out):
    return Build(spec, out, cluster)


def workers_killed(cluster, spec, out):
    build = Build(spec, out, cluster).wait()
    cluster.kill("a")
    cluster.start("c")
    build.wait()
    cluster.kill("b", "c")
    sleep(3.0)
    cluster.start("d")
    return build


def chunk_given_up(cluster, spec, out):
    cluster.close()
    cluster.start("scheduler", "c", deaths=0)
    build = Build(spec, out, cluster).wait()
    # The only worker is at work.
    cluster.kill("c")
    cluster.start("d")
    return build


def scheduler_restarted(cluster, spec, out):
    build = Build(spec, out, cluster).wait()
    cluster.kill("scheduler")
    sleep(3.0)
    # A worker leaves with its scheduler, as Dask has it.
    cluster.start("scheduler", "e", "f")
    return build


def scheduler_gone(cluster, spec, out):
    build = Build(spec, out, cluster, patience=2).wait()
    cluster.kill("scheduler")
    _, messages = build.end(code=2)
    if RESUME not in messages:
        raise RuntimeError(f"expected {RESUME!r}: {messages}")
    cluster.start("scheduler", "g", "h")
    return Build(spec, out, cluster)


def builder_killed(cluster, spec, out):
    build = Build(spec, out, cluster).wait()
    build.process.kill()
    build.process.wait()
    return Build(spec, out)


RESUME, PARTED = "run the command again", "one by one"
DISTURBANCES = {
    "none; two workers": undisturbed,
    "a worker killed, then both, a new one started": workers_killed,
    "a worker killed, its chunk given up by the scheduler: run one by one": chunk_given_up,
    "scheduler killed, started again at its address": scheduler_restarted,
    "scheduler killed for good, build ended with exit 2, resumed on a new one": scheduler_gone,
    "builder killed, resumed in one process": builder_killed,
}


def main():
    """Print the table; True where a hash differs, or where a chunk should have been run one by one and was not."""
    wrong = False
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        spec = folder / "disturbed.toml"
        spec.write_text(SPEC)
        expected, _ = Build(spec, folder / "here").end()
        heading("Disturbance of a build on a cluster", "Hash of all arrays")
        for label, disturbance in DISTURBANCES.items():
            with closing(Cluster(folder)) as cluster:
                outcome, messages = disturbance(cluster, spec, folder / disturbance.__name__).end()
            same = outcome == expected and (disturbance is not chunk_given_up or PARTED in messages)
            wrong |= not same
            row(label, "as of one process" if same else "DIFFERENT")
    return wrong


if __name__ == "__main__":
    sys.exit(main())
