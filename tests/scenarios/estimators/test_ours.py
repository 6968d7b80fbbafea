from dataclasses import replace

import numpy as np
import pytest

from scenarios.estimators import ours
from scenarios.problems.registry import problem


def asked(name, structure, ask="fit"):
    return problem(name).task(structure, ask)


@pytest.fixture(scope="module")
def data():
    return problem("p3@400").draw(1)


def test_several_outputs_are_refused_by_polynomials_and_taken_by_state_space():
    data = problem("mimo").draw(1)[:1500]
    with pytest.raises(NotImplementedError, match="3 outputs given"):
        ours.oe(data, asked("p2", "oe"))
    answer = ours.n4sid(data, asked("mimo", "ss"))
    assert answer.model.D.shape == (3, 3)
    assert not answer.model.D.any()


def test_what_is_claimed():
    data = problem("p3@1000").draw(1)
    assert ours.armax(data, asked("p3@1000", "armax")).covariance.shape == (6, 6)
    task = asked("p3@1000", "ss")
    state_space = ours.pem_ss(data, task)
    assert state_space.bandwidth_ci95 is not None
    assert state_space.response_covariance.shape == (len(task.frequencies), 1, 1, 2, 2)
    subspace = ours.n4sid(data, task)
    assert subspace.covariance is subspace.response_covariance is None
    instrumental = ours.iv4(data, asked("p3@1000", "arx"))
    assert instrumental.model.innovation_covariance is None
    assert not instrumental.model.gain.any()


@pytest.mark.parametrize("structure", ["arx", "armax", "oe", "ss"])
def test_pem_takes_each_structure(data, structure):
    task = asked("p3@400", structure)
    expected = (ours.pem_ss if structure == "ss" else getattr(ours, structure))(data, task).model
    np.testing.assert_array_equal(ours.pem(data, task).model.A, expected.A)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "method", "structure"),
    [
        ("p3", "armax", "armax"),
        ("p2@3000", "oe", "oe"),
        ("p5", "arx", "arx"),
        ("p3", "iv4", "arx"),
        ("p3", "n4sid", "ss"),
    ],
)
def test_orders_are_chosen(name, method, structure):
    """Schwarz's criterion on records that leave no doubt."""
    task = replace(asked(name, structure, "select"), most_order=3)
    assert task.chooses
    answer = getattr(ours, method)(problem(name).draw(2), task)
    assert answer.model.input_path().minimal().order == problem(name).truth.input_path().minimal().order


def test_era_has_no_criterion(data):
    with pytest.raises(NotImplementedError, match="no choice of orders"):
        ours.era(data, asked("p3@400", "ss", "select"))


def test_observer_parameters_fit_the_record(data):
    assert ours.observer_parameters(data, 2) == 24
    assert ours.observer_parameters(data[:100], 2) == 10
    assert ours.observer_parameters(data[:20], 4) == 4
