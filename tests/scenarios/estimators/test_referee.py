"""The second implementation finds what the toolbox finds."""

import numpy as np
import pytest

import sysid
from scenarios.estimators.ours import pem
from scenarios.estimators.referee import errors, referee
from scenarios.estimators.task import Task
from scenarios.problems.registry import problem
from sysid.polynomial.orders import make_orders

FREQUENCIES = np.array([0.5, 5.0])


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "structure"), [("p2@2000", "oe"), ("p3", "armax"), ("p3", "ss"), ("p4@2000", "bj"), ("p5", "arx")]
)
def test_it_agrees_with_the_toolbox(name, structure):
    """To a tenth of a deviation, and of the parameters' covariance to 5 %."""
    here = problem(name)
    record, task, bound = here.draw(1), here.task(structure), here.bound(structure)
    theirs, ours = referee(record, task), pem(record, task)
    difference = theirs.model.frequency_response(here.frequencies) - ours.model.frequency_response(here.frequencies)
    variance = np.sum(bound.response_directions**2, axis=(0, 4))
    assert np.mean(np.abs(difference) ** 2 / variance) < 0.01
    if ours.covariance is not None:
        assert np.diag(theirs.covariance) == pytest.approx(np.diag(ours.covariance), rel=0.1)


def test_the_true_model_has_the_true_errors():
    """Of a Box-Jenkins system from rest: what was before the record is projected out."""
    rng = np.random.default_rng(4)
    e, u = 0.1 * rng.standard_normal(600), rng.standard_normal(600)
    truth = sysid.Polynomials(B=[0, 1.0, 0.5], C=[1, -0.6], D=[1, -0.5, 0.2], F=[1, -1.2, 0.5])
    model = sysid.models.innovations_form(truth, 0.1)
    y = sysid.simulate(model, u, x0=np.zeros(model.order))[:, 0]
    v = np.zeros(600)
    for t in range(600):
        past = [(v[t - k] if t >= k else 0.0) for k in (1, 2)]
        v[t] = e[t] - 0.6 * (e[t - 1] if t else 0.0) + 0.5 * past[0] - 0.2 * past[1]
    degrees = make_orders(1, nb=2, nc=1, nd=2, nf=2, nk=1)
    theta = np.array([1.0, 0.5, -0.6, -0.5, 0.2, -1.2, 0.5])
    estimate = errors(u[50:], (y + v)[50:], degrees, theta)
    true = e[-len(estimate) :]
    # three transients are projected out of the noise as well
    assert np.sqrt(np.mean((estimate[40:] - true[40:]) ** 2)) < 0.02 * 0.1
    assert np.sum(estimate**2) == pytest.approx(np.sum(true**2), rel=0.03)
    assert np.isinf(errors(u, y, degrees, np.array([1.0, 0.5, -1.6, 0.0, 0.0, 0.0, 0.0]))).all()


def test_without_noise_it_finds_the_system():
    """To ten digits."""
    u = np.random.default_rng(1).standard_normal(400)
    truth = sysid.Polynomials(B=[0, 1.0, 0.5], F=[1, -1.2, 0.5])
    model = sysid.models.innovations_form(truth, 0.1)
    record = sysid.IOData(u, sysid.simulate(model, u), 0.1)[50:]
    estimate = referee(record, Task("oe", {"nb": 2, "nf": 2, "nk": 1}, 2, FREQUENCIES))
    expected = model.frequency_response(FREQUENCIES)
    assert estimate.model.frequency_response(FREQUENCIES) == pytest.approx(expected, rel=1e-10)


def test_what_it_does_not_do_it_says():
    """Several inputs, and choosing."""
    for name, ask, message in (("shared", "fit", "2 inputs"), ("p5", "select", "does not choose")):
        with pytest.raises(NotImplementedError, match=message):
            referee(problem(name).draw(1), problem(name).task(None, ask))
