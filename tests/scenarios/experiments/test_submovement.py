import numpy as np
import pytest

from scenarios.experiments.operator import PEAK, Submovement


def test_it_covers_its_distance_smoothly_and_only_then() -> None:
    movement = Submovement(np.array([0.3, -0.1]), start=1.0, duration=2.0)
    time = np.arange(0.0, 4.0, 1e-3)
    velocity = np.array([movement.velocity(t) for t in time])
    np.testing.assert_allclose(velocity.sum(axis=0) * 1e-3, movement.distance, rtol=1e-6)
    assert not velocity[(time <= 1.0) | (time >= movement.end)].any()
    assert velocity[:, 0].max() == pytest.approx(PEAK * 0.3 / 2.0, rel=1e-6)
    # It starts and stops without a step in acceleration: its jerk is nowhere beyond 60 d / T^3.
    assert np.abs(np.diff(velocity, 2, axis=0)).max() < 1.001 * 60.0 * 0.3 / 2.0**3 * 1e-6


def test_no_smooth_movement_has_less_jerk() -> None:
    """Any other polynomial with the same ends and duration: the minimum-jerk one bounds them [FlashHogan1985]."""
    s = np.linspace(0.0, 1.0, 2001)
    velocity = np.array([Submovement(np.ones(1), 0.0, 1.0).velocity(t)[0] for t in s])

    def cost(v: np.ndarray) -> float:
        return float((np.diff(v, 2) ** 2).sum())

    for bump in (s**2 * (1 - s) ** 2 * (s - 0.5), s**2 * (1 - s) ** 2 * ((s - 0.5) ** 2 - 1.0 / 28.0)):
        assert abs(bump.sum()) < 1e-3 * np.abs(bump).sum()
        for share in (0.3, -0.3):
            assert cost(velocity + share * bump / np.abs(bump).max()) > cost(velocity)
