"""A build that SIGKILL ends resumes, and the workers of a Dask scheduler build the same bytes as this process."""

import signal
import subprocess
import sys

import pytest

from scenarios.datasets.build import build
from scenarios.jobs.cluster import Cluster
from scenarios.jobs.journal import Journal, read_fingerprint
from tests.scenarios.datasets.test_build import files

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
sys.exit(main(sys.argv[1:]))
"""
"""The command line, which kills itself at a numbered wait for the disk."""


@pytest.mark.reliability
def test_a_killed_build_ends_in_the_bytes_of_one_that_nobody_disturbed(tiny, tiny_spec, tmp_path):
    spec, out = tmp_path / "tiny.toml", tmp_path / "out"
    spec.write_text(tiny_spec.to_toml())
    words = ["dataset", "build", str(spec), "--out", str(out), "--rows", "1", "--progress", "none"]
    # Before the first record, in the midst of the second, and, the third being there, of what comes after.
    for wait, there in ((5, 0), (18, 1), (16, 3)):
        killed = subprocess.run([sys.executable, "-c", CHILD, str(wait), *words], capture_output=True, check=False)
        assert killed.returncode == -signal.SIGKILL, killed.stderr
        path = out / f"{tiny.name}.unfinished" / "journal.sqlite"
        with Journal(path, read_fingerprint(path)) as journal:
            assert len(journal.keys("experiment")) == there
        assert not (out / tiny.name).exists()
    assert files(build(tiny_spec, out).folder) == files(tiny)


@pytest.mark.reliability
def test_one_thread_two_threads_and_two_workers_make_the_same_bytes(tiny, tiny_spec, tmp_path):
    distributed = pytest.importorskip("distributed")
    workers = {"n_workers": 2, "threads_per_worker": 1, "dashboard_address": None, "host": "127.0.0.1"}
    with distributed.LocalCluster(**workers) as local, Cluster(local.scheduler_address, patience=60.0) as executor:
        on_workers = build(tiny_spec, tmp_path / "workers", rows=1, executor=executor)
    two_threads = build(tiny_spec, tmp_path / "threads", workers=2)
    assert files(on_workers.folder) == files(two_threads.folder) == files(tiny)
