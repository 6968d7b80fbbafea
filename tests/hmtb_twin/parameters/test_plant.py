from dataclasses import replace
from fractions import Fraction

import mujoco
import numpy as np
import pytest

from hmtb_twin import JOINTS, STUDIED_JOINTS, Plant, linearize, load_arm, simulate
from hmtb_twin.parameters.drives import COLDEST, HOTTEST, RATED_PRESSURE, kinematic_viscosity, relative_viscosity
from hmtb_twin.parameters.variants import ACTUATORS
from hmtb_twin.truth.analytic_hydraulics import linear_hydraulics
from tests.hmtb_twin.altered_arms import at_step
from tests.refusals import refused

SHOULDER = ACTUATORS["shoulder_pitch"]


def test_viscosity_is_that_of_the_grade_and_a_straight_line_in_walthers_plot():
    assert [kinematic_viscosity(t) for t in (40.0, 100.0)] == pytest.approx([32.0, 5.4], rel=1e-12)
    assert relative_viscosity(40.0) == pytest.approx(1.0, rel=1e-12)
    temperatures = np.linspace(COLDEST, HOTTEST, 21)
    x = np.log10(temperatures + 273.15)
    y = np.log10(np.log10([kinematic_viscosity(t) + 0.7 for t in temperatures]))
    np.testing.assert_allclose(y, np.polyval(np.polyfit(x, y, 1), x), atol=1e-12)
    assert (np.diff(y) < 0.0).all()


def test_supply_pressure_and_oil_temperature_act_on_their_numbers_of_the_actuator():
    assert {name: Plant().applied(actuator) for name, actuator in ACTUATORS.items()} == ACTUATORS
    low = Plant(supply_pressure=0.5 + RATED_PRESSURE / 4.0).applied(SHOULDER)
    assert low.maximum_torque == pytest.approx(SHOULDER.maximum_torque / 4.0)
    assert low.rated_flow == pytest.approx(SHOULDER.rated_flow / 2.0)
    # Friction and leakage are stated at the rated pressure, whatever the supply is.
    assert low.coulomb_torque == pytest.approx(SHOULDER.coulomb_torque)
    assert low.leakage == pytest.approx(SHOULDER.leakage)
    for temperature in (0.0, 20.0, 90.0):
        there, thickness = Plant(oil_temperature=temperature).applied(SHOULDER), relative_viscosity(temperature)
        assert there.drag == pytest.approx(SHOULDER.drag * thickness)
        assert there.leakage == pytest.approx(SHOULDER.leakage / thickness)


def test_the_slope_acts_on_what_the_valve_loses_and_not_on_leakage():
    flat = Plant(load_flow_slope=0.25).applied(SHOULDER)
    assert flat.leakage == SHOULDER.leakage
    assert flat.flow_pressure_gain - flat.leakage == pytest.approx(0.25 * SHOULDER.rated_flow / RATED_PRESSURE)


def test_plants_are_named_as_before_unless_their_slope_differs():
    # Stored truths of problems have their keys from this text.
    assert "load_flow_slope" not in repr(Plant(friction_level=2.0))
    assert repr(Plant(load_flow_slope=0.5)).endswith("process_noise=0.0, load_flow_slope=0.5)")
    assert eval(repr(Plant(load_flow_slope=0.5))) == Plant(load_flow_slope=0.5)


def test_frictions_differ_in_what_they_leave():
    kinds = ("none", "viscous", "coulomb", "lugre")
    drives = [Plant(friction=kind, friction_level=2.0).applied(SHOULDER) for kind in kinds]
    assert [drive.drag > 0.0 for drive in drives] == [False, True, True, True]
    dry = 2.0 * SHOULDER.coulomb_torque
    assert [drive.coulomb_torque for drive in drives] == pytest.approx([0.0, 0.0, dry, dry])


@pytest.mark.slow
@pytest.mark.parametrize("plant", [Plant(friction="coulomb"), Plant(), Plant(servo="torque", friction_level=3.0)])
def test_stuck_joints_do_not_creep(plant):
    arm = load_arm(plant=plant)
    data = arm.rest(arm.pose("home"))
    data.ctrl[1::2] += [0.5 * arm.actuators[name].coulomb_torque for name in JOINTS]
    tick = round(0.02 / arm.model.opt.timestep)
    mujoco.mj_step(arm.model, data, nstep=50 * 10 * tick)
    before = data.qpos.copy()
    mujoco.mj_step(arm.model, data, nstep=50 * 120 * tick)
    # A hundredth of a count of the resolver in two minutes would be 1e-6 rad.
    assert np.abs(data.qpos - before).max() < 1e-9


@pytest.mark.parametrize("kind", [int, float, np.float64, np.float32, np.int64, Fraction])
def test_numbers_of_every_kind_are_stored_as_floats(kind):
    plant = Plant(actuator=np.str_("linear"), friction_level=kind(2), supply_pressure=kind(20), process_noise=kind(0))
    plain = Plant(friction_level=2.0, supply_pressure=20.0)
    assert (plant, repr(plant), hash(plant)) == (plain, repr(plain), hash(plain))


@pytest.mark.slow
@pytest.mark.parametrize("law", ["flow", "torque"])
def test_truth_keeps_the_drag_drops_dry_friction_and_slows_in_cold_oil(law):
    plants = {kind: Plant(friction=kind, servo=law) for kind in ("none", "viscous", "coulomb", "lugre")}
    plants["cold"] = Plant(oil_temperature=0.0, servo=law)
    truths = {kind: linearize(load_arm(plant=plant), amplitudes=()) for kind, plant in plants.items()}
    for joint in STUDIED_JOINTS:
        hz = {kind: truth.joint(joint).bandwidth_hz for kind, truth in truths.items()}
        assert hz["viscous"] == hz["coulomb"] == hz["lugre"]
        # Drag takes B K_ce / D^2 of the flow, one percent, more or less as the neighbours move.
        share = linear_hydraulics(ACTUATORS[joint], 1.0).leak_ratio
        assert hz["viscous"] / hz["none"] == pytest.approx(1.0 - share, abs=0.8 * share)
        assert hz["cold"] < 0.995 * hz["lugre"]


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
        ({"supply_pressure": 0.7}, "supply_pressure = 0.7 given, expected 0.75 MPa"),
        ({"servo": "velocity"}, "servo 'velocity'.*variant, flow, torque"),
        ({"oil_temperature": 150.0}, "expected 0 to 100 degrees"),
        ({"friction_level": -1.0}, "friction_level = -1.0 given"),
        ({"friction_level": True}, "friction_level = True given, expected 0 to 100"),
        ({"friction_level": 1.0 + 0.0j}, "friction_level = .* given"),
        ({"supply_pressure": np.array(20.7)}, "supply_pressure = array.20.7. given"),
        ({"supply_pressure": 10**400}, r"supply_pressure = 10{56}\.\.\. given"),
        ({"presliding": 9e-5}, "presliding = 9e-05 given, expected 0.0001 to 0.1 rad: the physics step does not"),
        ({"presliding": 4e-4, "friction_level": 100.0}, "0.0004 at friction_level = 100 given, expected 0.0005 to"),
        ({"actuator": np.array("linear")}, "unknown actuator array"),
        ({"friction": ["none"]}, "unknown friction .*'none'"),
        ({"load_flow_slope": 0.0}, "load_flow_slope = 0.0 given, expected 0.02 to 1, a part of the straight line's"),
    ],
)
def test_what_cannot_be_is_refused_with_what_can(arguments, words):
    refused(words, Plant, **arguments)
    for plant in ("orifice", None, {"actuator": "orifice"}):
        message = r'plant = .* given, expected a Plant, such as Plant\(actuator="orifice"\)'
        refused(message, load_arm, plant=plant)


STIFFEST = [{"friction_level": 2e5 * least, "presliding": least} for least in (1e-4, 5e-4)]


@pytest.mark.parametrize(
    ("plant", "payload", "step"),
    [(Plant("orifice", friction=kind, friction_level=8.0), "rpcm", 0.05) for kind in ("coulomb", "lugre")]
    + [(Plant(**seals), "rpcm", 0.004) for seals in STIFFEST]
    + [(Plant(friction="coulomb", **seals), "none", 0.004) for seals in STIFFEST],
)
def test_worn_seals_are_resolved_by_the_step(plant, payload, step):
    arm, angles = load_arm(payload=payload, plant=plant), []
    for refined in (1, 4):
        # The arm points up, so that its yaw has little inertia.
        data = arm.rest(np.array([0.0, 0.0, 1.54, 0.02, 0.0, 0.0, 0.0]))
        data.ctrl[2::2] += step
        fine = at_step(arm, arm.model.opt.timestep / refined).model
        mujoco.mj_step(fine, data, nstep=round(0.5 / fine.opt.timestep))
        angles.append(data.qpos.copy())
    np.testing.assert_allclose(*angles, atol=1e-5)


def test_oil_torque_never_exceeds_supply_pressure_times_displacement():
    arm = load_arm(friction=False)
    data = arm.rest(arm.pose("home"))
    limit = np.array([ACTUATORS[name].maximum_torque for name in JOINTS])
    data.ctrl[0::2] += 3.0
    data.ctrl[1::2] += 1e5
    reached = np.zeros(7)
    for _ in range(300):
        mujoco.mj_step(arm.model, data)
        reached = np.maximum(reached, np.abs(data.actuator_force[0::2]))
    assert (reached <= limit * (1 + 1e-12)).all()
    assert (reached > 0.9 * limit).any()


@pytest.mark.parametrize("plant", [Plant(), Plant(friction="coulomb"), Plant("orifice")])
def test_dry_friction_is_a_spring_until_breakaway_and_then_yields(plant):
    arm = load_arm(plant=plant)
    # No weight pulls on the yaw as it turns.
    actuator, kp = arm.actuators["shoulder_yaw"], arm.gains["shoulder_yaw"].kp
    coulomb = actuator.coulomb_torque
    for torque, sticks in ((0.5 * coulomb, True), (5.0 * coulomb, False)):
        data = arm.rest(arm.pose("rpcm_holster_out_approach"))
        start = data.qpos[1]
        data.ctrl[3] += torque
        mujoco.mj_step(arm.model, data, nstep=round(6.0 / arm.model.opt.timestep))
        # As long as they stick the bristles carry the torque beside the servo; sliding, they carry Coulomb torque.
        angle = torque / (kp + coulomb / actuator.friction.presliding) if sticks else (torque - coulomb) / kp
        assert data.qpos[1] - start == pytest.approx(angle, rel=0.1 if sticks else 0.15)
