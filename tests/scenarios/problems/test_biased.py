"""Problems on which some methods must be biased: they are, and by what theory says."""

import numpy as np
import pytest

import sysid
from scenarios.estimators.ours import prediction_error
from scenarios.problems.registry import problem

RECORDS = 10


def bias(name, structure):
    """Greatest mean error of the response over its standard error."""
    one = problem(name)
    task = one.task(structure)
    truth = one.truth.input_path().frequency_response(one.frequencies)
    models = [prediction_error(one.draw(seed), task).model for seed in range(RECORDS)]
    errors = np.array([model.frequency_response(one.frequencies) for model in models]) - truth
    mean = np.abs(errors.mean(axis=0))
    return np.max(mean / (errors.std(axis=0, ddof=1) / np.sqrt(RECORDS)))


@pytest.mark.slow
def test_feedback():
    """Output error is off by more than five standard errors of 40 records, already of ten; ARMAX is not."""
    assert bias("feedback", "oe") > 10.0
    assert bias("feedback", "armax") < 4.0
    assert bias("feedback-arx", "arx") < 4.0
    assert bias("feedback-arx", "oe") > 10.0


@pytest.mark.filterwarnings("ignore::sysid.SysidWarning")
def test_feedback_is_a_loop():
    """The input is the reference less the controller times the output."""
    one = problem("feedback")
    record = one.draw(2)
    reference = one.reference[-len(record) :, 0]
    assert record.u[:, 0] == pytest.approx(reference - 0.4 * record.y[:, 0], abs=1e-12)
    assert np.var(sysid.residuals(one.truth, record)) == pytest.approx(one.variance, rel=0.15)


def test_shared_waveform():
    """One input alone takes in the other path, as much as without noise; both together show each."""
    alone = problem("shared-alone")
    task = alone.task("oe")
    assert alone.bound("oe") is None
    truth = alone.truth.frequency_response(alone.frequencies)
    response = prediction_error(alone.draw(0), task).model.frequency_response(alone.frequencies)
    expected = alone.expected_bias()
    assert np.max(np.abs(expected)) > 0.5 * np.abs(truth[0, 0, 0])
    assert np.linalg.norm(response - truth - expected) < 0.01 * np.linalg.norm(expected)
    assert bias("shared", "oe") < 4.5
