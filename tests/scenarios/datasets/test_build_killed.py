"""A build that SIGKILL ends, in a process of its own, resumes: the benchmark does it often, this twice."""

import importlib.util
import sys
from pathlib import Path

import pytest

from scenarios.datasets.build import build

BENCH = Path(__file__).parents[2] / "benchmarks" / "dataset_kills.py"


@pytest.fixture(scope="module")
def bench():
    spec = importlib.util.spec_from_file_location("dataset_kills", BENCH)
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module
    spec.loader.exec_module(module)
    return module


@pytest.mark.slow
def test_a_killed_build_ends_in_the_bytes_of_one_that_nobody_disturbed(bench, tiny, tiny_spec, tmp_path):
    spec = tmp_path / "tiny.toml"
    spec.write_text(tiny_spec.to_toml())
    out = tmp_path / "out"
    out.mkdir()
    # In the midst of the second record, and, the third being there, of what comes after.
    for wait, there in ((18, "1 experiments"), (16, "3 experiments")):
        assert bench.run(spec, out, wait=wait, rows=1).killed
        assert there in bench.state(out)
        assert not (out / tiny.name).exists()
    assert bench.contents(build(tiny_spec, out).folder) == bench.contents(tiny)
