"""The planted faults do what they say, so that the bench's verdicts on them mean something."""

import itertools
from dataclasses import replace

import numpy as np
import pytest

from scenarios.estimators import ours
from scenarios.estimators.model_numbers import answer_of, unstable
from scenarios.estimators.outcome import NoModelError
from scenarios.estimators.returned import numbers_of
from scenarios.problems.registry import problem
from tests.benchmarks import faulty_estimators as faulty

SHORT = problem("p3@400")
STRIKES = next(seed for seed in itertools.count() if np.random.default_rng([seed, 2]).random() < faulty.SHARE)


@pytest.fixture(scope="module")
def data():
    return SHORT.draw(1)


@pytest.fixture(scope="module", params=[None, "ss"])
def sound(request, data):
    task = SHORT.task(request.param)
    return task, ours.pem(data, task)


def response(answer, task):
    return answer.model.frequency_response(task.frequencies)


def test_models_are_wrong_in_one_way(data, sound):
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
def test_claims_are_off_by_two(name, factor, data, sound):
    task, right = sound
    wrong = getattr(faulty, name)(data, task)
    np.testing.assert_array_equal(response(wrong, task), response(right, task))
    for claim in ("covariance", "response_covariance"):
        if getattr(right, claim) is not None:
            np.testing.assert_allclose(getattr(wrong, claim), factor * getattr(right, claim))
    if right.bandwidth_ci95 is not None:
        half = [np.log(answer.bandwidth_ci95[1] / answer.bandwidth_ci95[0]) for answer in (wrong, right)]
        np.testing.assert_allclose(half[0], np.sqrt(factor) * half[1], rtol=1e-6)


def test_rare_faults_strike_once_in_fifty_and_the_bench_names_them(data):
    task = SHORT.task(None)
    assert abs(sum(faulty._strikes(replace(task, seed=seed)) for seed in range(2000)) - 40) < 4 * np.sqrt(40)
    struck = replace(task, seed=STRIKES)
    with pytest.raises(NoModelError) as caught:
        answer_of(numbers_of(faulty.absent_minded(data, struck), data, struck), data, struck)
    assert caught.value.kind == "not_finite"
    wrong = answer_of(numbers_of(faulty.unstable(data, struck), data, struck), data, struck)
    assert "outside the unit circle" in unstable(wrong.model)
