"""The bounded step against the conditions that characterise it."""

import numpy as np

from hmtb_twin.control.bounded_step import bounded_step


def problem(rng):
    root = rng.normal(size=(3, 3))
    lower, upper = -rng.uniform(0.0, 0.5, 7), rng.uniform(0.0, 0.5, 7)
    lower[rng.random(7) < 0.1], upper[rng.random(7) < 0.1] = 0.0, 0.0
    lower[6] = -np.inf
    gradient = rng.choice([0.05, 0.5, 3.0]) * rng.normal(size=3)
    return root @ root.T + 0.1 * np.eye(3), gradient, rng.normal(size=(7, 3)), lower, upper


def test_random_steps_are_feasible_and_pushed_only_outward():
    rng = np.random.default_rng(0)
    counts = set()
    for _ in range(200):
        hessian, gradient, rows, lower, upper = problem(rng)
        step, active = bounded_step(hessian, gradient, rows, lower, upper)
        values = rows @ step
        assert (values <= upper + 1e-9).all()
        assert (values >= lower - 1e-9).all()
        # What would still pull the step on is a push against active bounds, each from within.
        held = rows[active]
        pull = gradient - hessian @ step
        push = np.linalg.lstsq(held.T, pull, rcond=None)[0] if active else np.zeros(0)
        assert np.abs(pull - push @ held).max() < 1e-8 * (1.0 + np.abs(pull).max())
        for row, multiplier in zip(active, push, strict=True):
            bound = upper[row] if multiplier > 0.0 else lower[row]
            assert abs(values[row] - bound) < 1e-9 or abs(multiplier) < 1e-8
        counts.add(len(active))
    assert counts >= {0, 1, 2, 3}


def test_without_bounds_it_is_the_free_minimum():
    hessian, gradient = np.diag([1.0, 2.0, 4.0]), np.array([1.0, 1.0, 1.0])
    step, active = bounded_step(hessian, gradient, np.eye(3), np.full(3, -np.inf), np.full(3, np.inf))
    assert np.allclose(step, [1.0, 0.5, 0.25], rtol=1e-14)
    assert active == []


def test_rows_that_say_the_same_do_not_cycle():
    rows = np.array([[1.0, 0.0, 0.0], [2.0, 0.0, 0.0], [-1.0, 0.0, 0.0]])
    upper = np.array([0.5, 0.8, np.inf])
    step, active = bounded_step(np.eye(3), np.array([1.0, 1.0, 1.0]), rows, np.full(3, -np.inf), upper)
    assert np.allclose(step, [0.4, 1.0, 1.0])
    assert active == [1]
