from dataclasses import replace
from fractions import Fraction

import mujoco
import numpy as np
import pytest

from hmtb_twin import JOINTS, STUDIED_JOINTS, Plant, TwinError, linearize, load_arm, simulate
from hmtb_twin.parameters.drives import ACTUATORS, RATED_PRESSURE, relative_viscosity

SHOULDER = ACTUATORS["shoulder_pitch"]


def test_nominal_plant_leaves_the_actuators_as_they_are():
    assert {name: Plant().applied(actuator) for name, actuator in ACTUATORS.items()} == ACTUATORS


def test_supply_pressure_sets_torque_by_itself_and_flow_by_its_root():
    low = Plant(supply_pressure=3.4 + RATED_PRESSURE / 4.0).applied(SHOULDER)
    assert low.maximum_torque == pytest.approx(SHOULDER.maximum_torque / 4.0)
    assert low.rated_flow == pytest.approx(SHOULDER.rated_flow / 2.0)
    # Friction and leakage are stated at the rated pressure, whatever the supply is.
    assert low.coulomb_torque == pytest.approx(SHOULDER.coulomb_torque)
    assert low.leakage == pytest.approx(SHOULDER.leakage)


@pytest.mark.parametrize("temperature", [0.0, 20.0, 90.0])
def test_thick_oil_drags_more_and_leaks_less(temperature):
    there, thickness = Plant(oil_temperature=temperature).applied(SHOULDER), relative_viscosity(temperature)
    assert there.drag == pytest.approx(SHOULDER.drag * thickness)
    assert there.leakage == pytest.approx(SHOULDER.leakage / thickness)


def test_frictions_differ_in_what_they_leave():
    kinds = {
        kind: Plant(friction=kind, friction_level=2.0).applied(SHOULDER)
        for kind in ("none", "viscous", "coulomb", "lugre")
    }
    assert [kinds[kind].drag > 0.0 for kind in kinds] == [False, True, True, True]
    assert [kinds[kind].coulomb_torque for kind in kinds] == pytest.approx(
        [0.0, 0.0, 2.0 * SHOULDER.coulomb_torque, 2.0 * SHOULDER.coulomb_torque]
    )


@pytest.mark.parametrize("kind", ["coulomb", "lugre"])
def test_dry_friction_holds_below_its_level_and_yields_above(kind):
    arm = load_arm(plant=Plant(friction=kind))
    angles, joint = arm.pose("rpcm_holster_out_approach"), JOINTS.index("shoulder_yaw")
    coulomb = arm.actuators["shoulder_yaw"].coulomb_torque
    kp, _ = arm.gains["shoulder_yaw"]

    def moved(torque: float) -> float:
        data = arm.rest(angles)
        data.ctrl[2 * joint + 1] += torque
        mujoco.mj_step(arm.model, data, nstep=4000)
        return float(data.qpos[joint] - angles[joint])

    held, yielded = moved(0.7 * coulomb), moved(5.0 * coulomb)
    assert abs(held) < 0.7 * 0.7 * coulomb / kp
    # Sliding, the servo's spring carries what friction does not.
    assert yielded == pytest.approx((5.0 - 1.0) * coulomb / kp, rel=0.15)


def test_coulomb_friction_hardly_creeps():
    arm = load_arm(plant=Plant(friction="coulomb"))
    angles = arm.pose("home")
    data = arm.rest(angles)
    data.ctrl[1::2] += [0.5 * arm.actuators[name].coulomb_torque for name in JOINTS]
    mujoco.mj_step(arm.model, data, nstep=4000)
    before = data.qpos.copy()
    mujoco.mj_step(arm.model, data, nstep=10_000)
    # Over 5 s: a thirtieth of a count of the resolver, and half a count on the wrist roll, whose inertia is tiny.
    assert np.abs(data.qpos - before)[:-1].max() < 3e-6
    assert abs(data.qpos[-1] - before[-1]) < 5e-5


@pytest.mark.parametrize("kind", [int, float, np.float64, np.float32, np.int64, Fraction])
def test_numbers_of_every_kind_are_stored_as_floats(kind):
    plant = Plant(actuator=np.str_("linear"), friction_level=kind(2), supply_pressure=kind(20), process_noise=kind(0))
    assert plant == Plant(friction_level=2.0, supply_pressure=20.0)
    assert repr(plant) == repr(Plant(friction_level=2.0, supply_pressure=20.0))
    assert hash(plant) == hash(Plant(friction_level=2.0, supply_pressure=20.0))


def test_truth_keeps_the_drag_and_drops_dry_friction():
    smooth = {kind: linearize(load_arm(plant=Plant(friction=kind))) for kind in ("none", "viscous", "coulomb", "lugre")}
    for joint in STUDIED_JOINTS:
        hz = {kind: truth.joint(joint).bandwidth_hz for kind, truth in smooth.items()}
        assert hz["viscous"] == hz["coulomb"] == hz["lugre"]
        # Drag adds to kd: the bandwidth kp / kd falls by its share.
        _, kd = load_arm().gains[joint]
        assert hz["viscous"] / hz["none"] == pytest.approx(1.0 - ACTUATORS[joint].drag / kd, abs=1e-3)


def test_cold_oil_slows_the_joints():
    cold, warm = (linearize(load_arm(plant=Plant(oil_temperature=t))) for t in (0.0, 40.0))
    for joint in STUDIED_JOINTS:
        assert cold.joint(joint).bandwidth_hz < 0.995 * warm.joint(joint).bandwidth_hz


def test_process_noise_moves_the_arm_from_its_own_seed(experiment):
    still = experiment(amplitude=0.0)
    noisy = replace(still, plant=Plant(friction="viscous", process_noise=0.005))
    quiet, one, same, other = simulate([still, noisy, noisy, replace(noisy, seed=2)])
    np.testing.assert_array_equal(one.true_angles, same.true_angles)
    assert np.abs(one.true_angles - other.true_angles).max() > 1e-4
    moved, still = (log.true_angles[:, 1] - log.true_angles[0, 1] for log in (one, quiet))
    assert moved.std() > 100.0 * still.std()
    assert one.provenance["plant_process_noise"] == "0.005"


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ({"actuator": "pneumatic"}, "actuator 'pneumatic'.*linear, orifice"),
        ({"friction": "sticky"}, "friction 'sticky'.*lugre"),
        ({"supply_pressure": 2.0}, "supply_pressure = 2.0 given, expected 5.1 MPa"),
        ({"oil_temperature": float("nan")}, "oil_temperature = nan given"),
        ({"oil_temperature": 150.0}, "expected 0 to 100 degrees"),
        ({"friction_level": -1.0}, "friction_level = -1.0 given"),
        ({"process_noise": 2.0}, "process_noise = 2.0 given"),
        ({"process_noise": "much"}, "process_noise = much given"),
        ({"friction_level": True}, "friction_level = True given, expected 0 to 100"),
        ({"process_noise": np.True_}, "process_noise = True given"),
        ({"friction_level": None}, "friction_level = None given"),
        ({"friction_level": 1.0 + 0.0j}, "friction_level = .* given"),
        ({"supply_pressure": np.array(20.7)}, "supply_pressure = 20.7 given"),
        ({"supply_pressure": 10**400}, "supply_pressure = 1.* given"),
        ({"actuator": np.array("linear")}, "unknown actuator array"),
        ({"friction": ["none"]}, "unknown friction .*'none'"),
        ({"friction": None}, "unknown friction None"),
    ],
)
def test_what_cannot_be_is_refused_with_what_can(arguments, words):
    with pytest.raises(TwinError, match=words):
        Plant(**arguments)


@pytest.mark.parametrize("given", ["orifice", None, {"actuator": "orifice"}])
def test_a_plant_is_a_plant(given):
    with pytest.raises(TwinError, match=r'plant = .* given, expected a Plant, such as Plant\(actuator="orifice"\)'):
        load_arm(plant=given)
