"""A data set small enough to build once for all tests of data sets."""

from pathlib import Path

import pytest

from scenarios.datasets.build import build
from scenarios.datasets.spec import DataSetSpec

TINY = """
name = "tiny"
version = 1
title = "Three short records"
description = "For tests."
seed = 7
window = 20
date = "2026-01-31"

[baselines]
models = ["hold", "arx:2/2", "truth"]

[[records]]
name = "binary"
part = "train"
axes = ["shoulder_yaw", "elbow_pitch"]
each_axis = true
duration = 4.0
draw_waveforms = true
excitation = { kind = "prbs", amplitude = 1.0, clock = 2, register = 7 }

[[records]]
name = "noise"
part = "test"
axes = ["elbow_pitch"]
duration = 4.0
draw_waveforms = true
excitation = { kind = "white_noise", amplitude = 0.5 }
"""


@pytest.fixture(scope="session")
def tiny_spec() -> DataSetSpec:
    return DataSetSpec.from_toml(TINY)


@pytest.fixture(scope="session")
def tiny(tiny_spec: DataSetSpec, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Folder of the built data set; tests that change it take a copy."""
    return build(tiny_spec, tmp_path_factory.mktemp("data-sets"), workers=1).path
