"""Problems on which some methods must be biased: they are, and by what theory says."""

import warnings

import numpy as np
import pytest

import sysid
from scenarios.estimators.ours import prediction_error
from scenarios.problems.common_waveform import SharedAlone
from scenarios.problems.registry import problem

RECORDS = 10


def bias(name: str, structure: str) -> tuple[float, float]:
    """Greatest mean error of the response, over its standard error and over the response."""
    found = problem(name)
    task = found.task(structure)
    assert task is not None
    truth = found.truth.input_path().frequency_response(found.frequencies)
    models = [prediction_error(found.draw(seed), task).model for seed in range(RECORDS)]
    errors = np.array([model.frequency_response(found.frequencies) for model in models]) - truth
    mean = np.abs(errors.mean(axis=0))
    return float(np.max(mean / (errors.std(axis=0, ddof=1) / np.sqrt(RECORDS)))), float(np.max(mean / np.abs(truth)))


def test_feedback() -> None:
    """Output error is off by more than five standard errors of 40 records, already of ten; ARMAX is not."""
    assert bias("feedback", "oe")[0] > 10.0
    assert bias("feedback", "armax")[0] < 4.0
    assert bias("feedback-arx", "arx")[0] < 4.0
    assert bias("feedback-arx", "oe")[0] > 10.0


def test_feedback_is_a_loop() -> None:
    """The input is the reference less the controller times the output."""
    found = problem("feedback")
    record = found.draw(2)
    reference = found.reference[-len(record) :, 0]
    assert record.u[:, 0] == pytest.approx(reference - 0.4 * record.y[:, 0], abs=1e-12)
    model = found.truth
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", sysid.SysidWarning)
        left = sysid.residuals(model, record)
    assert np.var(left) == pytest.approx(found.variance, rel=0.15)


def test_shared_waveform() -> None:
    """One input alone takes in the other path, as much as without noise; both together show each."""
    alone = problem("shared-alone")
    assert isinstance(alone, SharedAlone)
    task = alone.task("oe")
    assert task is not None and alone.bound("oe") is None
    truth = alone.truth.frequency_response(alone.frequencies)
    response = prediction_error(alone.draw(0), task).model.frequency_response(alone.frequencies)
    expected = alone.expected_bias()
    assert np.max(np.abs(expected)) > 0.5 * np.abs(truth[0, 0, 0])
    assert np.linalg.norm(response - truth - expected) < 0.01 * np.linalg.norm(expected)
    assert bias("shared", "oe")[0] < 4.5
