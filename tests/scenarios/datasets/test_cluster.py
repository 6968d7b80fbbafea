"""Data sets built by the workers of a Dask scheduler: the same bytes as here."""

import os
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from scenarios.datasets.build import build
from scenarios.datasets.data_set import open_data_set
from scenarios.datasets.spec import DataSetSpec
from scenarios.files.errors import ScenarioError
from scenarios.jobs.cluster import Cluster

distributed = pytest.importorskip("distributed")
ROOT = Path(__file__).parents[3]


@contextmanager
def workers(address: str, count: int) -> Iterator[None]:
    """Worker processes without the nannies that would start them again."""
    command = [sys.executable, "-m", "distributed.cli.dask_worker", address, "--no-nanny", "--no-dashboard"]
    environment = {**os.environ, "PYTHONPATH": str(ROOT), "OPENBLAS_NUM_THREADS": "1"}
    started = [
        subprocess.Popen([*command, "--nthreads", "1"], env=environment, stderr=subprocess.DEVNULL)
        for _ in range(count)
    ]
    try:
        yield
    finally:
        for one in started:
            one.kill()
            one.wait()


@pytest.mark.slow
def test_one_thread_two_threads_and_two_workers_make_the_same_bytes(
    tiny: Path, tiny_spec: DataSetSpec, tmp_path: Path
) -> None:
    lines: list[str] = []
    with distributed.LocalCluster(n_workers=0, dashboard_address=None, host="127.0.0.1") as cluster:
        address = cluster.scheduler_address
        with pytest.raises(
            ScenarioError, match=r"has no workers; waited for 0\.5 s; .*run the command again to resume"
        ):
            build(tiny_spec, tmp_path / "workers", executor=Cluster(address, patience=0.5))
        assert (tmp_path / "workers" / "tiny-v1.unfinished" / "journal.sqlite").is_file()
        with workers(address, 2):
            executor = Cluster(address, patience=60.0, report=lines.append)
            on_workers = build(tiny_spec, tmp_path / "workers", rows=1, executor=executor)
    two_threads = build(tiny_spec, tmp_path / "threads", workers=2)
    expected = open_data_set(tiny).hash
    assert (two_threads.hash, on_workers.hash) == (expected, expected)
    for path in sorted(tiny.rglob("*.nc")):
        assert (on_workers.path / path.relative_to(tiny)).read_bytes() == path.read_bytes()
    # The workers start with the build, so that it may have to wait for them.
    assert all(" workers" in line for line in lines)


def test_a_scheduler_that_nobody_runs_is_reported_within_seconds(tiny_spec: DataSetSpec, tmp_path: Path) -> None:
    with pytest.raises(ScenarioError, match=r"no Dask scheduler answers at '.*' within 0\.5 s .*; expected an"):
        build(tiny_spec, tmp_path, executor=Cluster("tcp://127.0.0.1:1", patience=0.5))
