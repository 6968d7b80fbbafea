"""The planted faults do what they say, so that the bench's verdicts on them mean something."""

import itertools
from dataclasses import replace

import numpy as np
import pytest

from scenarios.bench.metrics import SLOW
from scenarios.estimators import ours
from scenarios.estimators.estimator import Limits
from scenarios.estimators.model_numbers import answer_of, unstable
from scenarios.estimators.outcome import Answer, NoModelError
from scenarios.estimators.returned import numbers_of
from scenarios.estimators.task import Task
from scenarios.problems.registry import problem
from sysid import IOData
from tests.benchmarks import faulty_estimators as faulty

SHORT = problem("p3@400")
STRIKES = next(seed for seed in itertools.count() if np.random.default_rng([seed, 2]).random() < faulty.SHARE)


@pytest.fixture(scope="module")
def data() -> IOData:
    return SHORT.draw(1)


@pytest.fixture(scope="module", params=[None, "ss"])
def sound(request: pytest.FixtureRequest, data: IOData) -> tuple[Task, Answer]:
    task = SHORT.task(request.param)
    assert task is not None
    return task, ours.pem(data, task)


def response(answer: Answer, task: Task) -> np.ndarray:
    return answer.model.frequency_response(task.frequencies)


def test_models_are_wrong_in_one_way(data: IOData, sound: tuple[Task, Answer]) -> None:
    task, right = sound
    late = np.exp(-2j * np.pi * task.frequencies * data.dt)[:, None, None]
    np.testing.assert_allclose(response(faulty.delayed(data, task), task), late * response(right, task), rtol=1e-9)
    np.testing.assert_allclose(response(faulty.biased(data, task), task), 1.02 * response(right, task), rtol=1e-12)
    one, same, other = (faulty.inefficient(data, replace(task, seed=seed)) for seed in (4, 4, 5))
    np.testing.assert_array_equal(response(one, task), response(same, task))
    assert np.abs(response(one, task) - response(other, task)).max() > 0.0
    if right.covariance is not None:
        np.testing.assert_allclose(one.covariance, 1.5 * right.covariance)


@pytest.mark.parametrize(("name", "factor"), [("overconfident", 0.5), ("underconfident", 2.0)])
def test_claims_are_off_by_two(name: str, factor: float, data: IOData, sound: tuple[Task, Answer]) -> None:
    task, right = sound
    wrong = getattr(faulty, name)(data, task)
    np.testing.assert_array_equal(response(wrong, task), response(right, task))
    for claim in ("covariance", "response_covariance"):
        if getattr(right, claim) is not None:
            np.testing.assert_allclose(getattr(wrong, claim), factor * getattr(right, claim))
    if right.bandwidth_ci95 is not None:
        half = [np.log(answer.bandwidth_ci95[1] / answer.bandwidth_ci95[0]) for answer in (wrong, right)]
        np.testing.assert_allclose(half[0], np.sqrt(factor) * half[1], rtol=1e-6)


def test_inefficient_errs_by_half_of_the_covariance() -> None:
    """The added errors, weighed by their own covariance, have the mean square of standard normal ones."""
    task = SHORT.task(None)
    estimate, rng = ours.prediction_error(SHORT.draw(1), task), np.random.default_rng(3)
    errors = [faulty.wandering(estimate, 0.5, rng).parameters - estimate.parameters for _ in range(200)]
    squares = [e @ np.linalg.solve(0.5 * estimate.covariance, e) / len(e) for e in errors]
    assert abs(np.mean(squares) - 1.0) < 4.0 * np.sqrt(2.0 / len(errors[0]) / len(errors))


def test_rare_faults_strike_once_in_fifty_and_the_bench_names_them(data: IOData) -> None:
    task = SHORT.task(None)
    assert abs(sum(faulty._strikes(replace(task, seed=seed)) for seed in range(2000)) - 40) < 4 * np.sqrt(40)
    struck = replace(task, seed=STRIKES)
    with pytest.raises(NoModelError) as caught:
        answer_of(numbers_of(faulty.absent_minded(data, struck), data, struck), data, struck)
    assert caught.value.kind == "not_finite"
    wrong = answer_of(numbers_of(faulty.unstable(data, struck), data, struck), data, struck)
    assert "outside the unit circle" in unstable(wrong.model)


@pytest.mark.parametrize(("ruler", "ask", "fits"), [(0.0005, "fit", 9), (1.0, "fit", 100), (0.0005, "select", 1)])
def test_slow_is_slow_within_the_time_limit(
    ruler: float, ask: str, fits: int, data: IOData, monkeypatch: pytest.MonkeyPatch
) -> None:
    """With fits of a tenth of a second."""
    calls: list[Task] = []
    monkeypatch.setattr(faulty, "pem", lambda data, task: calls.append(task))
    monkeypatch.setattr(faulty.time, "process_time", lambda: 0.1 * len(calls))
    monkeypatch.setattr(faulty.Ruler, "measure", lambda of: setattr(of, "seconds", ruler))
    faulty.slow(data, SHORT.task(None, ask))
    assert len(calls) == pytest.approx(fits, abs=1)
    assert faulty.SLOWNESS > 1.4 * SLOW and Limits().seconds > 2.0 * faulty.LONGEST
