"""Steps that keep poles from leaving the unit circle."""

import numpy as np
import pytest

from sysid.subspace.predictor_fit import constrained_step


@pytest.mark.parametrize("seed", range(30))
def test_constrained_steps_are_the_best_there_are(seed):
    rng = np.random.default_rng(seed)
    q, m = 6, int(rng.integers(1, 12))
    values, g, rows = rng.uniform(0.1, 10.0, q), rng.standard_normal(q), rng.standard_normal((m, q))
    if seed % 3 == 0:
        rows = np.vstack((rows, rows[:1], np.zeros((1, q))))
    step = constrained_step(values, g, rows)
    assert (rows @ step <= 1e-9).all()
    # a cone and a parabola: the gradient left over is normal to the step, and no feasible direction is downhill
    left = g - values * step
    assert left @ step == pytest.approx(0.0, abs=1e-9)
    for direction in rng.standard_normal((200, q)):
        if (rows @ direction <= 0.0).all():
            assert left @ direction <= 1e-9


def test_a_step_that_no_constraint_bars_is_the_free_one():
    values, g = np.array([1.0, 2.0]), np.array([1.0, 1.0])
    np.testing.assert_array_equal(constrained_step(values, g, np.array([[-1.0, 0.0]])), [1.0, 0.5])
