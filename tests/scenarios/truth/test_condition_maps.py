"""Maps over what the arm carries and runs on."""

import numpy as np
import pytest

from hmtb_twin import PAYLOADS, Plant, Specimen, linearize, load_arm
from hmtb_twin.parameters.values import OPERATING_POSE, POSES
from scenarios.truth.condition_maps import conditions, payloads, supply_pressures

HERE = np.array(POSES[OPERATING_POSE])


def test_every_condition_is_varied_alone() -> None:
    told: list[tuple[int, int]] = []
    loads, pressures, temperatures = conditions(load_arm(), HERE, 3, lambda done, total: told.append((done, total)))
    assert set(loads.values) == set(PAYLOADS)
    assert loads.values[0] == "none"
    bare = linearize(load_arm(payload="none"), amplitudes=()).joint("elbow_pitch").bandwidth_hz
    assert loads.dynamics.of("elbow_pitch")[0] == pytest.approx(bare, rel=1e-7)
    assert pressures.values == (7.0, 21.0, 35.0)
    assert np.isnan(pressures.dynamics.bandwidth[0]).all(), "at 7 MPa the drives cannot hold the arm"
    assert np.isfinite(pressures.dynamics.bandwidth[1:]).all()
    # Thick oil drags most where drive and inertia are small.
    roll = temperatures.dynamics.of("wrist_roll")
    assert (np.diff(roll) > 0.0).all()
    assert roll[0] < 0.6 * roll[-1]
    assert told == [(1, 3), (2, 3)]


def test_servo_valves_have_the_same_gap_at_low_pressure() -> None:
    _, pressures, _ = conditions(load_arm(plant=Plant(actuator="orifice")), HERE, 3)
    assert pressures.dynamics.stable[:2].tolist() == [False, True]
    assert np.isnan(pressures.dynamics.bandwidth[0]).all()
    assert np.isfinite(pressures.dynamics.bandwidth[1]).all()


def test_a_specimen_stays_itself_under_all_of_them() -> None:
    arm = load_arm(specimen=Specimen(mass=(1.1,) * 8, payload_mass=1.3))
    bare = linearize(load_arm(payload="none", specimen=arm.specimen), amplitudes=()).joint("elbow_pitch").bandwidth_hz
    assert payloads(arm, HERE).dynamics.of("elbow_pitch")[0] == pytest.approx(bare, rel=1e-7)
    plant = Plant(supply_pressure=35.0)
    strong = linearize(load_arm(plant=plant, specimen=arm.specimen), amplitudes=()).joint("elbow_pitch").bandwidth_hz
    assert supply_pressures(arm, HERE, 2).dynamics.of("elbow_pitch")[1] == pytest.approx(strong, rel=1e-7)


def test_electric_drives_have_no_oil() -> None:
    varied = conditions(load_arm("flight"), HERE, 3)
    assert [part.name for part in varied] == ["payload"]
