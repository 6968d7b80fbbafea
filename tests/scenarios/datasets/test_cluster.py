"""Data sets built by the workers of a Dask scheduler: the same bytes as here."""

import pytest

from scenarios.datasets.build import build
from scenarios.datasets.data_set import open_data_set
from scenarios.jobs.cluster import Cluster

distributed = pytest.importorskip("distributed")


@pytest.mark.slow
def test_one_thread_two_threads_and_two_workers_make_the_same_bytes(tiny, tiny_spec, tmp_path):
    with (
        distributed.LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=None, host="127.0.0.1") as local,
        Cluster(local.scheduler_address, patience=60.0) as executor,
    ):
        on_workers = build(tiny_spec, tmp_path / "workers", rows=1, executor=executor)
    two_threads = build(tiny_spec, tmp_path / "threads", workers=2)
    expected = open_data_set(tiny).hash
    assert (two_threads.hash, on_workers.hash) == (expected, expected)
    for path in sorted(tiny.rglob("*.nc")):
        assert (on_workers.folder / path.relative_to(tiny)).read_bytes() == path.read_bytes()
