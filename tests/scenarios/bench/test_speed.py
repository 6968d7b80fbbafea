"""Times in rulers."""

from dataclasses import replace

import numpy as np
import pytest

from scenarios.bench.measurement import Measurement
from scenarios.bench.metrics import SLOW, Speed
from scenarios.estimators.estimator import Estimator
from scenarios.problems.trial import Trial

ANYONE = Estimator("anyone", "bench:perfect")


def measured(multiple: float, ruler: float = 0.002) -> list[Measurement]:
    spread = np.random.default_rng(1).lognormal(0.0, 0.3, 50)
    spread /= np.median(spread)
    return [
        Measurement(
            Trial("p3" if n < 25 else "p4", n % 25),
            "model",
            seconds=multiple * ruler * one,
            ruler_seconds=ruler,
            peak_bytes=2**20 * n,
        )
        for n, one in enumerate(spread)
    ]


def test_times_are_multiples_of_the_ruler() -> None:
    found = [Speed().evaluate(measured(20.0, ruler), ANYONE, 0.0, ()) for ruler in (0.0005, 0.01)]
    assert found[0].value == pytest.approx(20.0)
    assert found[0].value == pytest.approx(found[1].value)
    assert found[0].passed
    assert found[0].interval[0] < 20.0 < found[0].interval[1]
    assert found[0].curves["percentile_95"] == pytest.approx(20.0 * np.exp(0.3 * 1.645), rel=0.15)
    assert found[0].curves["peak_bytes"] == 49 * 2**20
    assert [part.label for part in found[0].parts] == ["p3", "p4"]


def test_slow_is_slow() -> None:
    assert Speed().evaluate(measured(1.01 * SLOW), ANYONE, 0.0, ()).passed is False
    assert Speed().evaluate(measured(0.99 * SLOW), ANYONE, 0.0, ()).passed is True


def test_failures_are_not_timed() -> None:
    own = measured(20.0)
    failing = [replace(m, kind="hang", seconds=1e6) if n % 3 == 0 else m for n, m in enumerate(own)]
    assert Speed().evaluate(failing, ANYONE, 0.0, ()).passed
    for other in ([replace(m, kind="crash") for m in own], []):
        assert Speed().evaluate(other, ANYONE, 0.0, ()).passed is None


def test_times_that_are_not_known_leave_no_verdict() -> None:
    own = measured(20.0)
    unknown = [replace(m, seconds=float("nan")) for m in own]
    found = Speed().evaluate(unknown, ANYONE, 0.0, ())
    assert found.passed is None
    assert np.isnan(found.value)
    assert "0 of 50" in found.why
    assert Speed().evaluate([*own, *unknown[:20]], ANYONE, 0.0, ()).passed
