from dataclasses import replace

import numpy as np
import pytest

from scenarios.estimators import ours
from scenarios.estimators.outcome import Answer
from scenarios.estimators.task import Task
from scenarios.problems.registry import problem

METHODS = {
    "arx": "arx",
    "armax": "armax",
    "oe": "oe",
    "bj": "bj",
    "iv4": "arx",
    "okid": "ss",
    "era": "ss",
    "n4sid": "ss",
    "pem_ss": "ss",
}


def relative_error(answer: Answer, name: str) -> float:
    of = problem(name)
    truth = of.truth.frequency_response(of.frequencies)
    return float(np.linalg.norm(answer.model.frequency_response(of.frequencies) - truth) / np.linalg.norm(truth))


def asked(name: str, structure: str | None, ask: str = "fit") -> Task:
    task = problem(name).task(structure, ask)
    assert task is not None
    return task


@pytest.mark.filterwarnings("ignore::sysid.SysidWarning")
@pytest.mark.parametrize("method", METHODS)
def test_quiet_record_is_recovered(method: str) -> None:
    data = problem("quiet-2-2@1000").draw(1)
    answer = getattr(ours, method)(data, asked("quiet-2-2@1000", METHODS[method]))
    assert relative_error(answer, "quiet-2-2@1000") < 1e-8


@pytest.mark.parametrize("method", METHODS)
def test_other_structures_are_refused(method: str) -> None:
    data = problem("p3@400").draw(1)
    other = "ss" if METHODS[method] != "ss" else "arx"
    with pytest.raises(NotImplementedError, match=f"structure '{other}' asked for"):
        getattr(ours, method)(data, asked("p3@400", other))


def test_several_outputs_are_refused_by_polynomials_and_taken_by_state_space() -> None:
    data = problem("mimo").draw(1)[:1500]
    with pytest.raises(NotImplementedError, match="3 outputs given"):
        ours.oe(data, asked("p2", "oe"))
    answer = ours.n4sid(data, asked("mimo", "ss"))
    assert answer.model.D.shape == (3, 3)
    assert not answer.model.D.any()


def test_what_is_claimed() -> None:
    data = problem("p3@1000").draw(1)
    polynomial = ours.armax(data, asked("p3@1000", "armax"))
    assert polynomial.covariance is not None
    assert polynomial.covariance.shape == (6, 6)
    task = asked("p3@1000", "ss")
    state_space = ours.pem_ss(data, task)
    assert state_space.response_covariance is not None
    assert state_space.response_covariance.shape == (len(task.frequencies), 1, 1, 2, 2)
    assert state_space.bandwidth_ci95 is not None
    subspace = ours.n4sid(data, task)
    assert subspace.covariance is None
    assert subspace.response_covariance is None
    instrumental = ours.iv4(data, asked("p3@1000", "arx"))
    assert instrumental.model.innovation_covariance is None
    assert not instrumental.model.gain.any()


def test_pem_takes_each_structure() -> None:
    data = problem("p3@400").draw(1)
    for structure in ("arx", "armax", "oe", "ss"):
        task = asked("p3@400", structure)
        found = ours.pem(data, task).model
        expected = (ours.pem_ss if structure == "ss" else getattr(ours, structure))(data, task).model
        np.testing.assert_array_equal(found.A, expected.A)


@pytest.mark.parametrize(
    ("name", "method"), [("p3", "armax"), ("p2@3000", "oe"), ("p5", "arx"), ("p3", "iv4"), ("p3", "n4sid")]
)
def test_orders_are_found(name: str, method: str) -> None:
    """Schwarz's criterion on records that leave no doubt."""
    task = replace(asked(name, METHODS[method], "select"), most_order=3)
    assert task.chooses
    answer = getattr(ours, method)(problem(name).draw(2), task)
    truth = problem(name).truth
    assert answer.model.input_path().minimal().order == truth.input_path().minimal().order


def test_era_has_no_criterion() -> None:
    with pytest.raises(NotImplementedError, match="no choice of orders"):
        ours.era(problem("p3@400").draw(1), asked("p3@400", "ss", "select"))


def test_observer_parameters_fit_the_record() -> None:
    data = problem("p3@400").draw(1)
    assert ours.observer_parameters(data, 2) == 24
    assert ours.observer_parameters(data[:100], 2) == 10
    assert ours.observer_parameters(data[:20], 4) == 4
