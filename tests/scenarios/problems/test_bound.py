"""The bound against estimates that reach it, against another way to compute it, and in closed loop."""

import numpy as np
import pytest

import sysid
from scenarios.problems.bound import perfect_errors, response_covariance
from scenarios.problems.registry import problem
from scenarios.problems.state_space_bound import coordinates, state_space_bound

DRAWS = 60


def test_output_error_reaches_it() -> None:
    """Sixty estimates: e' J e / p is 1 on average, with a standard deviation of sqrt(2 / (60 p)) = 0.09."""
    found = problem("p2@2000")
    bound = found.bound(None)
    assert bound is not None
    estimates = [sysid.oe(found.draw(seed), 2, 2, 1) for seed in range(DRAWS)]
    errors = np.array([estimate.parameters - bound.parameters for estimate in estimates])
    information = np.linalg.inv(bound.covariance)
    assert np.mean(np.einsum("np,pq,nq->n", errors, information, errors)) / 4 == pytest.approx(1.0, abs=0.28)
    claimed = np.mean([np.sqrt(np.diag(estimate.covariance)) for estimate in estimates], axis=0)
    assert claimed == pytest.approx(np.sqrt(np.diag(bound.covariance)), rel=0.02)
    found_hz = [estimate.bandwidth() for estimate in estimates[:4]]
    half = [np.log(one.ci95[1] / one.hz)[0, 0] for one in found_hz]
    assert np.mean(half) / 1.96 == pytest.approx(bound.bandwidth_deviation[0, 0], rel=0.1)


@pytest.mark.parametrize(("name", "fit"), [("p3", "armax"), ("p4", "bj"), ("p5", "arx"), ("feedback", "armax")])
def test_what_estimates_claim(name: str, fit: str) -> None:
    """Their covariance of the response is the bound's, in closed loop too; a single record's varies by some percent."""
    found = problem(name)
    bound, task = found.bound(None), found.task(None)
    assert bound is not None and task is not None and task.structure == fit
    estimates = [getattr(sysid, fit)(found.draw(seed), **task.orders) for seed in range(4)]
    claimed = np.mean([e.frequency_response(found.frequencies).covariance for e in estimates], axis=0)
    trace = np.trace(response_covariance(bound), axis1=-2, axis2=-1)
    assert np.trace(claimed, axis1=-2, axis2=-1) == pytest.approx(trace, rel=0.2)


@pytest.mark.parametrize("name", ["p2@2000", "p3", "p5"])
def test_state_space_in_local_coordinates(name: str) -> None:
    """The bound of a state space is that of ARMAX of its order, whatever the coordinates."""
    found = problem(name)
    expected = found.bound("ss")
    assert expected is not None
    model = sysid.models.innovations_form(expected.polynomials, found.dt, found.variance)
    other = state_space_bound(coordinates(model, found.draw(0)), found.draw, found.frequencies)
    assert other.response_directions.shape == expected.response_directions.shape
    assert response_covariance(other) == pytest.approx(
        response_covariance(expected), rel=0.05, abs=0.02 * response_covariance(expected).max()
    )
    assert other.bandwidth_deviation == pytest.approx(expected.bandwidth_deviation, rel=0.03)


def test_white_noise_tells_nothing_of_the_dynamics() -> None:
    """A model of noise that is white costs no accuracy of the response: C - A is independent of A and B then."""
    bounds = [problem("p2").bound(structure) for structure in ("oe", "armax", "bj", "ss")]
    covariances = [response_covariance(bound) for bound in bounds if bound is not None]
    assert len(covariances) == 4
    for covariance in covariances[1:]:
        assert covariance == pytest.approx(covariances[0], rel=1e-6, abs=1e-12 * covariances[0].max())


def test_perfect_errors() -> None:
    """They have the bound's covariance."""
    bound = problem("p3").bound(None)
    assert bound is not None
    errors = perfect_errors(bound, 20_000, np.random.default_rng(1))
    assert errors.shape == (20_000, *bound.response.shape)
    parts = np.stack((errors.real, errors.imag), axis=-1)
    covariance = np.einsum("n...i,n...j->...ij", parts, parts) / len(parts)
    assert covariance == pytest.approx(
        response_covariance(bound), rel=0.05, abs=0.05 * response_covariance(bound).max()
    )


def test_multivariable() -> None:
    """Relative error of the pulse response at the bound, the figure that other programs are compared with: 0.57 %."""
    found = problem("mimo@4000")
    bound = found.bound(None)
    assert bound is not None and bound.polynomials is None and len(bound.parameters) == 90
    rng = np.random.default_rng(0)
    directions = np.linalg.cholesky(bound.covariance)
    pulse = found.truth.markov(200)
    errors = [
        np.linalg.norm(
            found.realise("ss", bound.parameters + directions @ rng.standard_normal(90))[0].markov(200) - pulse
        )
        for _ in range(10)
    ]
    # of 4000 samples instead of 12000
    assert np.mean(errors) / np.linalg.norm(pulse) / np.sqrt(3.0) == pytest.approx(0.0057, rel=0.1)
