"""Long ARX models by filters are those of the estimator in state space."""

import warnings

import numpy as np
import pytest

from scenarios.truth.attainable_models import long_response
from sysid import IOData, SysidWarning, arx, predict


@pytest.mark.parametrize("inputs", [1, 2])
def test_it_is_the_estimator_and_the_simulation_in_state_space(inputs: int) -> None:
    rng = np.random.default_rng(0)
    u = rng.standard_normal((500, inputs))
    y = np.zeros(500)
    for t in range(2, 500):
        y[t] = 1.5 * y[t - 1] - 0.7 * y[t - 2] + u[t - 1] @ [1.0, -0.5][:inputs]
    # The record begins in motion, with noise that an order of 20 takes up.
    data = IOData(u[100:], y[100:] + rng.standard_normal(400), 0.02)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", SysidWarning)
        expected = predict(arx(data, 20, 20), data, steps=None)[:, 0]
    found = long_response(data.u, data.y[:, 0], 20)
    assert found is not None
    np.testing.assert_allclose(found, expected, rtol=0.0, atol=1e-10)


def test_what_grows_beyond_all_numbers_is_none() -> None:
    y = 2.0 ** np.arange(600.0)
    assert long_response(np.random.default_rng(0).standard_normal((600, 1)), y, 2) is None
