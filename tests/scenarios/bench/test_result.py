"""Result files: what is written is read again, NumPy's numbers and numbers that are none included."""

from pathlib import Path
from typing import Any

import numpy as np

from scenarios.bench.metric import Metric, Part
from scenarios.bench.result import Result
from scenarios.estimators.estimator import Estimator, Limits


def test_what_is_written_is_read_again(tmp_path: Path):
    failed: Any = np.bool_(False)
    number: Any = np.float64(1.5)
    part = Part("p1", number, float("nan"), (0.0, 1.0), (-np.inf, number), failed, draws=int(np.int64(3)))
    curves = {"count": np.int64(4), "grid": np.arange(2.0), "flag": np.bool_(True), "none": np.array([np.nan])}
    figure = Metric("few", "Few", "", number, 1.0, (1.0, 2.0), failed, 1e-4, "why", (part,), curves)
    result = Result(
        Estimator("mine", "a:b"), Limits(), "quick", 0, "", "", {}, "", {"model": 1}, {}, 0.5, {"few": figure}
    )
    assert figure.passed is False and part.surprises and not result.passed
    path = tmp_path / "mine.json"
    path.write_text(result.to_json())
    read = Result.read(path)
    assert read.figures["few"].curves == {"count": 4, "grid": [0.0, 1.0], "flag": True, "none": [None]}
    (again,) = read.figures["few"].parts
    assert (again.limits, again.passed, again.draws) == ((-np.inf, 1.5), False, 3)
    assert np.isnan(again.expected) and not read.passed
