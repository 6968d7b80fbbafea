"""Adapters of other packages, those that are installed: what they return is what their packages found."""

import numpy as np
import pytest

from scenarios.estimators.estimator import Estimator, Limits
from scenarios.estimators.known_estimators import KNOWN, OCTAVE, available, estimator
from scenarios.estimators.outcome import MODEL, REFUSED, Answer, EstimatorOutcome
from scenarios.estimators.python_child import load
from scenarios.estimators.runner import EstimatorProcess
from scenarios.estimators.task import Task
from scenarios.problems.registry import problem

QUIET, NOISY = "quiet-2-2@800", "p3@800"
INSTALLED = [known.estimator for known in KNOWN.values() if (known.module or known.octave) and known.available()[0]]
PYTHON = [one for one in INSTALLED if not one.program]

DIGITS = {"pysib-armax": 3, "pysib-oe": 3, "pysib-bj": 3, "sippy-armax": 6, "sippy-oe": 6, "sippy-bj": 6} | {
    "jax-sysid-oe": 5
}
"""Of a record without noise; searches stop when they have come near. The others are exact."""

WRONG = {"slicot-moesp", "slicot-n4sid"}
"""Without noise they find something else; see their docstrings."""

FACTOR = 12.0
"""Error of a consistent method in an open loop, on a short record, at most, as a multiple of the bound."""

BIASED = {"least_squares"}


def response_error(answer: Answer, name: str) -> np.ndarray:
    of = problem(name)
    return np.asarray(answer.model.frequency_response(of.frequencies) - of.truth.frequency_response(of.frequencies))


def asked(one: Estimator, name: str, ask: str = "fit") -> Task:
    task = problem(name).task(one.structure, ask)
    assert task is not None
    return task


def called(one: Estimator, name: str, ask: str = "fit") -> Answer:
    answer = load(one.target, OCTAVE)(problem(name).draw(1), asked(one, name, ask))
    assert isinstance(answer, Answer)
    return answer


@pytest.mark.parametrize("one", PYTHON, ids=lambda one: one.name)
def test_quiet_record_is_recovered(one: Estimator) -> None:
    truth = problem(QUIET).truth.frequency_response(problem(QUIET).frequencies)
    error = np.linalg.norm(response_error(called(one, QUIET), QUIET)) / np.linalg.norm(truth)
    assert (error < 10.0 ** -DIGITS.get(one.name, 10)) == (one.name not in WRONG)


@pytest.mark.parametrize("one", PYTHON, ids=lambda one: one.name)
def test_noisy_record_is_near_the_bound(one: Estimator) -> None:
    bound = problem(NOISY).bound(None)
    assert bound is not None
    scale = (bound.response_directions**2).sum(axis=(0, -1))
    ratio = np.mean(np.abs(response_error(called(one, NOISY), NOISY)) ** 2 / scale)
    assert (ratio < FACTOR) == (one.method not in BIASED and one.name != "slicot-moesp")


@pytest.mark.parametrize("one", PYTHON, ids=lambda one: one.name)
def test_other_structures_are_refused(one: Estimator) -> None:
    other = "ss" if one.structure != "ss" else "arx"
    task = problem(NOISY).task(other)
    with pytest.raises(NotImplementedError, match=f"structure '{other}' asked for"):
        load(one.target, OCTAVE)(problem(NOISY).draw(1), task)


@pytest.mark.parametrize("name", ["slicot-moen4", "sippy-n4sid"])
def test_orders_are_found(name: str) -> None:
    if not available(name)[0]:
        pytest.skip(available(name)[1])
    assert called(estimator(name), "p3", "select").model.order == 2


@pytest.fixture(scope="module", params=["octave-arx", "octave-moen4"])
def octave(request: pytest.FixtureRequest) -> list[EstimatorOutcome]:
    """What a program that stays answers: a record without noise, one with, one whose structure it has not."""
    can_run, why = available(request.param)
    if not can_run:
        pytest.skip(why)
    one = estimator(request.param)
    with EstimatorProcess(one, Limits()) as process:
        outcomes = [process.ask(problem(name).draw(1), asked(one, name)) for name in (QUIET, NOISY)]
        other = problem(NOISY).task("ss" if one.structure != "ss" else "arx")
        assert other is not None
        return [*outcomes, process.ask(problem(NOISY).draw(1), other)]


def test_octave_answers(octave: list[EstimatorOutcome]) -> None:
    quiet, noisy, refused = octave
    assert [one.kind for one in octave] == [MODEL, MODEL, REFUSED], [one.why for one in octave]
    assert quiet.answer is not None
    assert np.abs(response_error(quiet.answer, QUIET)).max() < 1e-9
    assert noisy.answer is not None
    assert noisy.answer.model.gain.any()
    assert refused.why.startswith("structure")
