"""Where linear ends."""

from dataclasses import replace

import pytest

from hmtb_twin import NOMINAL_PLANT, STUDIED_JOINTS, linearize, load_arm
from hmtb_twin.parameters.values import OPERATING_POSE
from scenarios.truth.amplitude_maps import MEASUREMENT, large_signals

SHORT = replace(MEASUREMENT, realisations=2, period=5.12, f_min=0.15)


def test_without_dry_friction_the_arm_is_linear_up_to_its_velocity_limit() -> None:
    arm = load_arm(plant=replace(NOMINAL_PLANT, friction="viscous"))
    told: list[tuple[int, int]] = []
    found = large_signals(
        arm,
        OPERATING_POSE,
        amplitudes=(2e-3, 0.1),
        measurement=SHORT,
        progress=lambda done, total: told.append((done, total)),
    )
    assert found.over_level == ()
    assert [point.joint for point in found.over_amplitude] == [name for name in STUDIED_JOINTS for _ in range(2)]
    truth = linearize(arm, amplitudes=())
    for small, large in zip(found.over_amplitude[::2], found.over_amplitude[1::2], strict=True):
        true = truth.joint(small.joint).bandwidth_hz
        assert small.hz == pytest.approx(true, rel=2e-3)
        assert small.gain == pytest.approx(1.0, abs=2e-3)
        assert small.distortion_percent < 0.1
        assert small.slewing == 0.0
        # The limit comes before what the record holds: the servo stays linear, the way from the stick does not.
        assert large.hz == pytest.approx(true, rel=0.02)
        assert large.asked_hz < 0.8 * true
        assert large.slewing > 0.5
    assert told[-1] == (6, 6)


def test_friction_ends_linearity_at_small_amplitudes_and_high_levels() -> None:
    found = large_signals(load_arm(), OPERATING_POSE, amplitudes=(1e-3, 3e-2), levels=(0.0, 4.0), measurement=SHORT)
    truth = linearize(load_arm(), amplitudes=())
    for joint in STUDIED_JOINTS:
        true = truth.joint(joint).bandwidth_hz
        stuck, free = (point for point in found.over_amplitude if point.joint == joint)
        assert stuck.gain < 0.9 < free.gain
        assert free.hz == pytest.approx(true, rel=0.15)
        none, much = (point for point in found.over_level if point.joint == joint)
        assert (none.level, much.level) == (0.0, 4.0)
        assert none.hz == pytest.approx(true, rel=2e-3)
        assert much.distortion_percent > 5.0
        assert none.distortion_percent < 0.1
