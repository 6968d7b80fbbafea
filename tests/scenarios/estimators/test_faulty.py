import itertools
import signal
from dataclasses import replace

import control
import numpy as np
import pytest

from scenarios.bench.metrics import SLOW
from scenarios.estimators import changed_answers, faulty, ours
from scenarios.estimators.answer import Answer
from scenarios.estimators.contestant import Limits
from scenarios.estimators.model_numbers import answer_of, unstable
from scenarios.estimators.no_model import NoModelError
from scenarios.estimators.returned import numbers_of
from scenarios.estimators.task import Task
from scenarios.problems.registry import problem
from sysid import IOData

SHORT = "p3@400"


def asked(structure: str | None = None) -> Task:
    task = problem(SHORT).task(structure)
    assert task is not None
    return task


STRIKES = next(seed for seed in itertools.count() if np.random.default_rng([seed, 2]).random() < faulty.SHARE)
SPARED = next(seed for seed in itertools.count() if np.random.default_rng([seed, 2]).random() > faulty.SHARE)


@pytest.fixture(scope="module")
def data() -> IOData:
    return problem(SHORT).draw(1)


@pytest.fixture(scope="module", params=[None, "ss"])
def sound(request: pytest.FixtureRequest, data: IOData) -> tuple[Task, Answer]:
    task = asked(request.param)
    return task, ours.pem(data, task)


def response(answer: Answer, task: Task) -> np.ndarray:
    return answer.model.frequency_response(task.frequencies)


def test_delayed_is_one_sample_late(data: IOData, sound: tuple[Task, Answer]) -> None:
    task, right = sound
    wrong = faulty.delayed(data, task)
    late = np.exp(-2j * np.pi * task.frequencies * data.dt)[:, None, None]
    np.testing.assert_allclose(response(wrong, task), late * response(right, task), rtol=1e-9)
    f = np.linspace(0.0, 25.0, 5)
    np.testing.assert_allclose(wrong.model.noise_response(f), right.model.noise_response(f), rtol=1e-9)


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


def test_biased_has_a_higher_gain(data: IOData, sound: tuple[Task, Answer]) -> None:
    task, right = sound
    np.testing.assert_allclose(response(faulty.biased(data, task), task), 1.02 * response(right, task), rtol=1e-12)


def test_inefficient_errs_by_half_of_the_covariance() -> None:
    """The errors that are added, weighed by their own covariance, have the mean square of standard normal ones."""
    of = problem(SHORT)
    estimate, rng = ours.prediction_error(of.draw(1), asked()), np.random.default_rng(3)
    errors = [changed_answers.wandering(estimate, 0.5, rng).parameters - estimate.parameters for _ in range(200)]
    squares = [e @ np.linalg.solve(0.5 * estimate.covariance, e) / len(e) for e in errors]
    assert abs(np.mean(squares) - 1.0) < 4.0 * np.sqrt(2.0 / len(errors[0]) / len(errors))


def test_inefficient_claims_what_it_has(data: IOData, sound: tuple[Task, Answer]) -> None:
    task, right = sound
    one, same, other = (faulty.inefficient(data, replace(task, seed=seed)) for seed in (4, 4, 5))
    np.testing.assert_array_equal(response(one, task), response(same, task))
    assert np.abs(response(one, task) - response(other, task)).max() > 0.0
    assert np.abs(response(one, task) - response(right, task)).max() > 0.0
    if right.covariance is not None:
        np.testing.assert_allclose(one.covariance, 1.5 * right.covariance)


def test_faults_strike_once_in_fifty() -> None:
    task = asked()
    struck = sum(faulty._strikes(replace(task, seed=seed)) for seed in range(2000))
    assert abs(struck - 40) < 4 * np.sqrt(40)


@pytest.mark.parametrize("name", ["unstable", "crashing", "hungry", "hanging", "absent_minded"])
def test_most_fits_are_sound(name: str, data: IOData, sound: tuple[Task, Answer]) -> None:
    task, right = sound
    answer = getattr(faulty, name)(data, replace(task, seed=SPARED))
    np.testing.assert_array_equal(answer.model.A, right.model.A)


def test_unstable_has_a_pole_outside(data: IOData) -> None:
    answer = faulty.unstable(data, replace(asked(), seed=STRIKES))
    assert np.abs(answer.model.input_path().poles()).max() == pytest.approx(faulty.OUTSIDE)


def test_absent_minded_forgets_numbers(data: IOData) -> None:
    model = faulty.absent_minded(data, replace(asked(), seed=STRIKES))
    assert isinstance(model, control.StateSpace)
    assert np.isnan(model.A).all()


def fits_of_slow(monkeypatch: pytest.MonkeyPatch, task: Task, ruler: float) -> int:
    """How many fits of a tenth of a second it makes."""
    fits: list[Task] = []

    def fit(data: IOData, task: Task) -> Answer:
        fits.append(task)
        return Answer(problem(SHORT).truth)

    monkeypatch.setattr(faulty, "pem", fit)
    monkeypatch.setattr(faulty.time, "process_time", lambda: 0.1 * len(fits))
    monkeypatch.setattr(faulty.Ruler, "measure", lambda of: setattr(of, "seconds", ruler))
    faulty.slow(problem(SHORT).draw(1), task)
    return len(fits)


def test_slow_is_called_slow_and_stays_below_the_limit_of_time(monkeypatch: pytest.MonkeyPatch) -> None:
    assert fits_of_slow(monkeypatch, asked(), 0.0005) == pytest.approx(10 * faulty.SLOWNESS * 0.0005, abs=1)
    assert fits_of_slow(monkeypatch, asked(), 1.0) == pytest.approx(10 * faulty.LONGEST, abs=1)
    assert faulty.SLOWNESS > 1.4 * SLOW
    assert Limits().seconds > 2.0 * faulty.LONGEST


def test_slow_chooses_orders_once(monkeypatch: pytest.MonkeyPatch) -> None:
    task = problem(SHORT).task(None, "select")
    assert task is not None
    assert fits_of_slow(monkeypatch, task, 0.0005) == 1


def test_crashing_kills_its_own_process(data: IOData, monkeypatch: pytest.MonkeyPatch) -> None:
    killed = []
    monkeypatch.setattr(faulty.os, "kill", lambda pid, what: killed.append((pid, what)))
    faulty.crashing(data, replace(asked(), seed=STRIKES))
    assert killed == [(faulty.os.getpid(), signal.SIGSEGV)]


def test_hungry_takes_eight_gigabytes(data: IOData, monkeypatch: pytest.MonkeyPatch) -> None:
    taken = []
    monkeypatch.setattr(faulty, "_bite", lambda: taken.append(faulty.BITE))
    faulty.hungry(data, replace(asked(), seed=STRIKES))
    assert sum(taken) == 8 * 2**30


def test_hanging_does_not_end(data: IOData, monkeypatch: pytest.MonkeyPatch) -> None:
    def awake(seconds: float) -> None:
        raise InterruptedError

    monkeypatch.setattr(faulty.time, "sleep", awake)
    with pytest.raises(InterruptedError):
        faulty.hanging(data, replace(asked(), seed=STRIKES))


def test_bench_names_the_fault(data: IOData) -> None:
    task = replace(asked(), seed=STRIKES)
    with pytest.raises(NoModelError) as caught:
        answer_of(numbers_of(faulty.absent_minded(data, task), data, task), data, task)
    assert caught.value.kind == "not_finite"
    told = answer_of(numbers_of(faulty.unstable(data, task), data, task), data, task)
    assert "outside the unit circle" in unstable(told.model)
