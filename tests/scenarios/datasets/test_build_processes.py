"""A build that SIGKILL ends resumes, and the workers of a Dask scheduler build the same bytes as this process."""

import pytest

from scenarios.datasets.build import build
from scenarios.jobs.cluster import Cluster
from tests.benchmarks import dataset_kills


@pytest.mark.slow
def test_a_killed_build_ends_in_the_bytes_of_one_that_nobody_disturbed(tiny, tiny_spec, tmp_path):
    """The benchmark kills often, this test twice."""
    spec = tmp_path / "tiny.toml"
    spec.write_text(tiny_spec.to_toml())
    out = tmp_path / "out"
    out.mkdir()
    # In the midst of the second record, and, the third being there, of what comes after.
    for wait, there in ((18, "1 experiments"), (16, "3 experiments")):
        assert dataset_kills.run(spec, out, wait=wait, rows=1).killed
        assert there in dataset_kills.state(out)
        assert not (out / tiny.name).exists()
    assert dataset_kills.contents(build(tiny_spec, out).folder) == dataset_kills.contents(tiny)


@pytest.mark.slow
def test_one_thread_two_threads_and_two_workers_make_the_same_bytes(tiny, tiny_spec, tmp_path):
    distributed = pytest.importorskip("distributed")
    workers = {"n_workers": 2, "threads_per_worker": 1, "dashboard_address": None, "host": "127.0.0.1"}
    with distributed.LocalCluster(**workers) as local, Cluster(local.scheduler_address, patience=60.0) as executor:
        on_workers = build(tiny_spec, tmp_path / "workers", rows=1, executor=executor)
    two_threads = build(tiny_spec, tmp_path / "threads", workers=2)
    expected = dataset_kills.contents(tiny)
    assert dataset_kills.contents(on_workers.folder) == dataset_kills.contents(two_threads.folder) == expected
