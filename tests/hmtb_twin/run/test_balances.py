"""Oil and energy of real runs of the whole arm: nothing is lost, nothing comes from nowhere."""

from dataclasses import fields, replace

import numpy as np
import pytest

from hmtb_twin import JOINTS, Plant, load_arm
from hmtb_twin.parameters.variants import OPERATING_POSE
from tests.hmtb_twin.balances import binary, linear_balances

OIL, ENERGY = 1e-7, 1e-6


@pytest.mark.slow
@pytest.mark.parametrize("friction", ["none", "viscous", "coulomb", "lugre"])
def test_books_of_a_binary_test_balance(friction):
    arm = load_arm(plant=Plant(friction=friction))
    oil, energy = linear_balances(arm, binary(arm, ("elbow_pitch",)))
    assert oil.throughput[JOINTS.index("elbow_pitch")] > 10.0
    assert oil.closure < OIL
    assert energy.closure < ENERGY
    assert min(energy.throttled, energy.leaked) > 0.0
    assert energy.dragged > 0.0 or friction == "none"
    assert energy.rubbed > 0.0 if friction in ("coulomb", "lugre") else energy.rubbed == 0.0
    # The pin's spring gives back what it takes.
    assert abs(energy.constrained) < ENERGY * energy.supplied


def test_books_balance_with_all_joints_moving_and_in_the_middle_of_a_motion():
    arm = load_arm(plant=Plant(supply_pressure=15.0, oil_temperature=25.0))
    oil, energy = linear_balances(arm, binary(arm, JOINTS[1:], 0.1, rest=0.0))
    # The oil of the wrist roll, at 71 Hz, is what the step resolves least.
    assert oil.closure < 1e-5
    assert energy.kinetic > 1.0
    assert energy.closure < 1e-5


@pytest.mark.slow
@pytest.mark.parametrize("friction", ["viscous", "lugre"])
def test_both_close_with_the_fourth_power_of_the_step(friction):
    arm = load_arm(plant=Plant(friction=friction))
    command = binary(arm, ("shoulder_pitch", "elbow_pitch"), 0.02)[:120]
    command[40:] = command[0]
    # Simpson's rule is for an even number of steps; the default of 15 leaves one over.
    coarse, fine = (linear_balances(arm, command, refined=n) for n in (2, 4))
    for one, other in zip(coarse, fine, strict=True):
        assert one.closure / other.closure == pytest.approx(16.0, rel=0.1)


def test_what_does_not_balance_shows():
    arm = load_arm()
    oil, energy = linear_balances(arm, binary(arm, ("elbow_pitch",), rest=0.0)[:50])
    assert replace(oil, leaked=0.99 * oil.leaked).closure > 10.0 * OIL
    large = [item.name for item in fields(energy) if abs(getattr(energy, item.name)) > 1e-4 * energy.supplied]
    assert len(large) >= 7
    for name in large:
        assert replace(energy, **{name: 1.1 * getattr(energy, name)}).closure > 5.0 * ENERGY


def test_lowered_arm_gives_its_height_to_the_oil():
    arm = load_arm(friction=False)
    command = np.tile(arm.pose(OPERATING_POSE), (200, 1))
    command[:, 2] -= np.linspace(0.0, 0.4, 200)
    oil, energy = linear_balances(arm, command)
    assert energy.potential < -50.0
    assert energy.closure < ENERGY
    # An independent figure of the height: the torque that holds the arm, over the angle.
    lifted = np.trapezoid(arm.controller.gravity_torque(command)[:, 2], command[:, 2])
    assert energy.potential == pytest.approx(lifted, rel=0.05)
    assert oil.swept[2] == pytest.approx(-0.4 * arm.actuators["shoulder_pitch"].displacement, rel=0.1)


def test_torque_limit_is_in_the_books():
    # Lowered fast at a third of the pressure, the arm overruns its drives.
    arm = load_arm(plant=Plant(supply_pressure=7.0), friction=False)
    command = np.tile(arm.pose(OPERATING_POSE), (75, 1))
    command[1:25, 2:4] -= 0.5
    energy = linear_balances(arm, command)[1]
    assert energy.limited < -0.05 * energy.supplied
    assert energy.closure < 5.0 * ENERGY
