"""Box-Jenkins: exact recovery, efficiency, coverage, stability."""

from typing import Any

import numpy as np
import pytest
from scipy.signal import lfilter

from sysid import IOData, bj, oe
from tests.sysid.refusals import refused

GRID = np.linspace(0.1, 24.0, 40)


def test_without_disturbance_model_is_output_error(p2: Any) -> None:
    data = p2.draw(0)
    same, plain = bj(data, 2, 0, 0, 2), oe(data, 2, 2)
    # both stop where no hundredth of a standard deviation is left to be had
    assert np.all(np.abs(same.parameters - plain.parameters) < 0.01 * np.sqrt(np.diag(plain.covariance)))


def test_two_inputs_two_experiments() -> None:
    rng = np.random.default_rng(0)
    u = rng.standard_normal((3000, 2))
    y = lfilter([0, 1.0], [1, -0.9], u[:, 0]) + lfilter([0, 0, 0.5, 0.2], [1, -0.5, 0.3], u[:, 1])
    y += lfilter([1, 0.5], [1, -0.8], 0.3 * rng.standard_normal(3000))
    data = IOData(u, y, 0.1)
    estimate = bj([data[100:1500], data[1500:]], [1, 2], 1, 1, [1, 2], [1, 2])
    truth = np.array([1.0, 0.5, 0.2, 0.5, -0.8, -0.9, -0.5, 0.3])
    assert estimate.parameter_names == ("b1[1]", "b1[2]", "b2[2]", "c1", "d1", "f1[1]", "f1[2]", "f2[2]")
    assert np.all(np.abs(estimate.parameters - truth) < 4 * np.sqrt(np.diag(estimate.covariance)))
    assert estimate.noise_variance[0, 0] == pytest.approx(0.09, rel=0.12)


@pytest.mark.filterwarnings("ignore:bj did not converge", "ignore:D has a root")
def test_a_drifting_disturbance_leaves_the_model_stable() -> None:
    rng = np.random.default_rng(3)
    u, e = rng.standard_normal((2, 800))
    estimate = bj(IOData(u, lfilter([0, 1.0], [1, -0.7], u) + np.cumsum(e), 0.1), 1, 1, 1, 1)
    assert estimate.model.is_stable()
    np.testing.assert_allclose(estimate.polynomials.D, [1, -1], atol=0.02)


def test_too_many_orders(p4: Any) -> None:
    refused("too many orders for the data", lambda: bj(p4.draw(0)[:20], 4, 4, 4, 4))
