"""Output-error models with more poles."""

import numpy as np
import pytest
from scipy.signal import lfilter

from scenarios.thesis.more_poles import ORDERS, MorePoles, more_poles
from sysid import IOData


@pytest.mark.slow
def test_a_record_that_two_poles_explain_leaves_them_stable():
    rng = np.random.default_rng(3)
    u = np.repeat(rng.choice([-1.0, 1.0], 1000), 2)
    y = lfilter([0.0, 0.0, 0.1, 0.05], [1.0, -1.5, 0.62], u) + 0.01 * rng.standard_normal(2000)
    models = more_poles(IOData(u, y, 0.02), 2)
    assert [entry.orders for entry in models] == [(nb, nf, 2) for nb, nf in ORDERS]
    own = models[0]
    assert not own.unstable
    assert own.settled
    assert abs(own.radius - np.sqrt(0.62)) < 0.02
    assert abs(own.free_radius - np.sqrt(0.62)) < 0.02


@pytest.mark.slow
def test_least_squares_may_leave_the_unit_circle():
    """The output runs away beside the input: the one pole that explains it lies outside."""
    rng = np.random.default_rng(4)
    u = rng.standard_normal(400)
    y = lfilter([0.0, 0.0, 1.0], [1.0, -1.01], u)
    models = more_poles(IOData(u, y, 0.02), 2)
    assert all(entry.free_radius > 1.0 for entry in models)
    assert all(entry.unstable for entry in models)
    assert all(entry.radius < 1.0 for entry in models), "the estimator keeps every model stable"


def test_the_edge_counts_as_unstable():
    assert MorePoles((2, 3, 2), 0.99995, 0.99, 4, True).unstable
    assert MorePoles((2, 3, 2), 0.99, 1.0001, 2, False).unstable
    assert not MorePoles((2, 3, 2), 0.99, 0.999, 4, True).unstable
