"""The bound against estimates that reach it, against another way to compute it, and in closed loop."""

import numpy as np
import pytest

import sysid
from scenarios.problems.registry import problem
from sysid.subspace.cramer_rao_ss import LocalCoordinates, cramer_rao_bound_ss


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "fit"), [("p2@2000", "oe"), ("p3", "armax"), ("p4", "bj"), ("p5", "arx"), ("feedback", "armax")]
)
def test_what_estimates_claim(name, fit):
    """Their covariances are the bound's, in closed loop too; a single record's varies by some percent."""
    system = problem(name)
    bound, task = system.bound(None), system.task(None)
    assert task.structure == fit
    estimates = [getattr(sysid, fit)(system.draw(seed), **task.orders) for seed in range(4)]
    claimed = np.mean([e.frequency_response(system.frequencies).covariance for e in estimates], axis=0)
    trace = np.trace(bound.response_covariance, axis1=-2, axis2=-1)
    assert np.trace(claimed, axis1=-2, axis2=-1) == pytest.approx(trace, rel=0.2)
    if fit == "oe":
        deviations = np.mean([np.sqrt(np.diag(e.covariance)) for e in estimates], axis=0)
        assert deviations == pytest.approx(np.sqrt(np.diag(bound.covariance)), rel=0.02)
        half = [np.log(band.ci95[1] / band.hz)[0, 0] for band in (e.bandwidth() for e in estimates)]
        assert np.mean(half) / 1.96 == pytest.approx(bound.bandwidth_deviation[0, 0], rel=0.1)


@pytest.mark.parametrize("name", ["p2@2000", "p3", "p5"])
def test_state_space_in_local_coordinates(name):
    """The bound of a state space is that of ARMAX of its order, whatever the coordinates."""
    system = problem(name)
    expected = system.bound("ss")
    model = sysid.models.innovations_form(expected.polynomials, system.dt, system.variance)
    other = cramer_rao_bound_ss(LocalCoordinates.at(model, system.draw(0)), system.draw, system.frequencies)
    assert other.response_directions.shape == expected.response_directions.shape
    assert other.response_covariance == pytest.approx(
        expected.response_covariance, rel=0.05, abs=0.02 * expected.response_covariance.max()
    )
    assert other.bandwidth_deviation == pytest.approx(expected.bandwidth_deviation, rel=0.03)


def test_white_noise_tells_nothing_of_the_dynamics():
    """A model of noise that is white costs no accuracy of the response: C - A is independent of A and B then."""
    bounds = [problem("p2").bound(structure) for structure in ("oe", "armax", "bj", "ss")]
    covariances = [bound.response_covariance for bound in bounds]
    for covariance in covariances[1:]:
        assert covariance == pytest.approx(covariances[0], rel=1e-6, abs=1e-12 * covariances[0].max())


def test_perfect_errors():
    """They have the bound's covariance."""
    bound = problem("p3").bound(None)
    errors = bound.response_errors(20_000, np.random.default_rng(1))
    assert errors.shape == (20_000, *bound.response.shape)
    parts = np.stack((errors.real, errors.imag), axis=-1)
    covariance = np.einsum("n...i,n...j->...ij", parts, parts) / len(parts)
    assert covariance == pytest.approx(bound.response_covariance, rel=0.05, abs=0.05 * bound.response_covariance.max())


def test_multivariable():
    """Relative error of the pulse response at the bound, the figure that other programs are compared with: 0.57 %."""
    system = problem("mimo@4000")
    bound = system.bound(None)
    assert bound.polynomials is None and len(bound.parameters) == 90
    rng = np.random.default_rng(0)
    directions = np.linalg.cholesky(bound.covariance)
    pulse = system.truth.markov(200)
    drawn = bound.parameters + rng.standard_normal((10, 90)) @ directions.T
    errors = [np.linalg.norm(system.realise("ss", parameters)[0].markov(200) - pulse) for parameters in drawn]
    # of 4000 samples instead of 12000
    assert np.mean(errors) / np.linalg.norm(pulse) / np.sqrt(3.0) == pytest.approx(0.0057, rel=0.1)
