"""A build that SIGKILL ends, in a process of its own, is gone on with: the bench does it often, this a few times."""

import importlib.util
import sys
from pathlib import Path
from types import ModuleType

import pytest

from scenarios.datasets.build import build
from scenarios.datasets.spec import DataSetSpec

BENCH = Path(__file__).parents[2] / "benchmarks" / "dataset_kills.py"


@pytest.fixture(scope="module")
def bench() -> ModuleType:
    spec = importlib.util.spec_from_file_location("dataset_kills", BENCH)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module
    spec.loader.exec_module(module)
    return module


@pytest.mark.slow
def test_a_killed_build_ends_in_the_bytes_of_one_that_nobody_disturbed(
    bench: ModuleType, tiny: Path, tiny_spec: DataSetSpec, tmp_path: Path
) -> None:
    spec = tmp_path / "tiny.toml"
    spec.write_text(tiny_spec.to_toml())
    out = tmp_path / "out"
    out.mkdir()
    # In the midst of the second record, and, the third being there, of what comes after.
    for wait, there in ((18, "1 experiments"), (16, "3 experiments")):
        assert bench.run(spec, out, wait=wait, rows=1).killed
        assert there in bench.state(out)
        assert not (out / tiny.name).exists()
    assert bench.contents(build(tiny_spec, out).path) == bench.contents(tiny)
