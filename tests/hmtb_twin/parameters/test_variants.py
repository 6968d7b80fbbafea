from dataclasses import replace

import mujoco
import numpy as np
import pytest
import xarray as xr
from scipy.linalg import expm

from hmtb_twin import IDEAL, JOINTS, POSES, STUDIED_JOINTS, Plant, TwinError, linearize, load_arm, simulate
from hmtb_twin.arm.rigid_bodies import BODIES
from hmtb_twin.control.modes import axis_names
from hmtb_twin.hydraulics.drive_actuators import add_linear_drives
from hmtb_twin.parameters.provenance import markdown, provenance_table
from hmtb_twin.parameters.quantity import TAGS, quantity
from hmtb_twin.parameters.resources import model_file, models_directory
from hmtb_twin.parameters.servo_gains import ServoGains
from hmtb_twin.parameters.values import HAND_CONTROLLER, PIN
from hmtb_twin.parameters.variants import LINKS, NUMBERS, SERVOS, VARIANTS
from hmtb_twin.truth.linearization import linear
from tests.refusals import refused


@pytest.fixture(scope="module")
def flight():
    return load_arm("flight")


def test_links_are_the_ground_arms_but_lighter_in_plant_and_controller(flight, arm):
    np.testing.assert_array_equal(flight.model.body_pos, arm.model.body_pos)
    np.testing.assert_array_equal(flight.model.site_pos, arm.model.site_pos)
    assert flight.model.body_mass.sum() < 0.6 * arm.model.body_mass.sum()
    for name, link in VARIANTS["flight"].links.items():
        body = flight.model.body(BODIES[name])
        assert link.length == LINKS[name].length
        assert body.mass[0] == link.mass
        assert sorted(body.inertia) == pytest.approx(sorted((link.axial_inertia, *(2 * [link.transverse_inertia]))))
    # The controller's inertia matrix is the plant's, rotors included.
    data, plants = flight.rest(flight.pose("home")), np.empty((7, 7))
    mujoco.mj_fullM(flight.model, data, plants)
    plants[0, 0] -= PIN.inertia
    np.testing.assert_allclose(flight.controller.inertia_matrix(flight.pose("home")), plants, atol=1e-9)


def test_nothing_weighs_anything(flight):
    for name in POSES:
        assert not flight.controller.gravity_torque(flight.pose(name)[None]).any()
        data = flight.rest(flight.pose(name))
        assert not data.act[flight.pressure_states].any()
        mujoco.mj_step(flight.model, data, nstep=2000)
        np.testing.assert_array_equal(data.qpos, flight.pose(name))


@pytest.mark.slow
def test_arm_is_twice_as_fast_as_the_ground_arm(flight, truth):
    for pose in POSES:
        orbit = linearize(flight, pose, amplitudes=(1e-3, 1e-2))
        for name in JOINTS[1:]:
            joint = orbit.joint(name)
            assert 1.8 < joint.bandwidth_hz < 2.2
            assert joint.dc_gain == pytest.approx(1.0, abs=1e-8)
        for name in STUDIED_JOINTS:
            assert orbit.joint(name).bandwidth_hz > 1.7 * truth.joint(name).bandwidth_hz
            assert orbit.joint(name).delay_samples == truth.joint(name).delay_samples
            slow = orbit.joint(name).dominant_poles
            assert np.abs(slow[slow.real > -60.0].imag).max() < 1e-6
        assert orbit.small_signal_error[1e-3] < 1e-4
        assert orbit.small_signal_error[1e-2] < 1e-2


def test_drive_obeys_the_equations_of_a_geared_motor():
    """A joint against its equations in closed form: L di/dt = v - R i - K w, J dw/dt = K i."""
    drive = replace(VARIANTS["flight"].actuators["elbow_pitch"], friction=None)
    motor, inertia, voltage = drive.motor, 4.0, 3.0
    spec = mujoco.MjSpec()
    spec.option.gravity, spec.option.timestep = [0.0, 0.0, 0.0], 0.0005
    body = spec.worldbody.add_body(mass=1.0, inertia=[inertia] * 3, explicitinertial=True)
    body.add_joint(name="shaft", axis=[0.0, 0.0, 1.0], armature=motor.armature)
    add_linear_drives(spec, {"shaft": drive}, {"shaft": ServoGains(0.0, 0.0, compensated=0.0)})
    model = spec.compile()
    data, speed = mujoco.MjData(model), []
    data.ctrl[1] = voltage * motor.constant / motor.resistance
    for _ in range(30):
        mujoco.mj_step(model, data, nstep=20)
        speed.append(data.qvel[0])
    rotor = [0.0, motor.constant / (inertia + motor.armature)]
    winding = [-motor.constant / motor.inductance, -motor.resistance / motor.inductance]
    steady = np.array([voltage / motor.constant, 0.0])
    exact = [(steady - expm(0.01 * k * np.array([rotor, winding])) @ steady)[0] for k in range(1, 31)]
    np.testing.assert_allclose(speed, exact, atol=1e-5 * max(exact))
    assert drive.no_load_speed == pytest.approx(drive.bus_voltage / motor.constant)
    assert motor.lag == pytest.approx(drive.electrical_lag)


def test_drives_have_their_limits_friction_and_noise_and_the_record_holds_currents(flight, experiment, tmp_path):
    worn = load_arm("flight", plant=Plant(friction_level=3.0, process_noise=0.01))
    for name, fastest in zip(JOINTS, flight.velocity_limits, strict=True):
        drive = VARIANTS["flight"].actuators[name]
        # The bus is good for the largest current at the fastest command.
        assert drive.bus_voltage > drive.motor.constant * fastest + drive.resistance * drive.largest_current
        assert worn.drives[name].coulomb_torque == pytest.approx(3.0 * flight.drives[name].coulomb_torque)
        assert worn.drives[name].drag == flight.drives[name].drag
    np.testing.assert_allclose(
        worn.process_noise, [0.01 * VARIANTS["flight"].actuators[name].rated_torque for name in JOINTS]
    )
    truth = linearize(worn, amplitudes=())
    assert np.abs(np.linalg.eigvals(truth.model.A - truth.model.K @ truth.model.C)).max() < 1.0
    smooth = load_arm("flight", friction=False)
    data = smooth.rest(flight.pose("home"))
    data.ctrl[2] += 1.0
    mujoco.mj_step(smooth.model, data, nstep=round(0.01 / smooth.model.opt.timestep))
    assert data.actuator_force[2] == pytest.approx(
        VARIANTS["flight"].actuators["shoulder_yaw"].maximum_torque, rel=1e-3
    )
    log = simulate([experiment(variant="flight", duration=1.0, plant=Plant(friction="none"))])[0]
    assert log.provenance["drives"] == "electric"
    with xr.open_dataset(log.save(tmp_path / "flight.nc")) as stored:
        assert stored["load_pressure"].attrs["units"] == "A"
    # At the first ticks the joint takes off: the current is what the torque command asks for.
    assert 0.1 < np.abs(log.load_pressure[:, 3]).max() < VARIANTS["flight"].actuators["elbow_pitch"].largest_current


def test_tests_of_the_thesis_leave_the_arm_nearly_linear(experiment):
    """Full sticks on slow commands: the reference of a model reference control is a linear model."""
    truth = linearize(load_arm("flight"), amplitudes=())
    log = simulate([experiment(variant="flight", axes=STUDIED_JOINTS, duration=6.0, chain=IDEAL, hold=25)])[0]
    columns = [JOINTS.index(name) for name in STUDIED_JOINTS]
    predicted = linear(truth.model, log.commanded - truth.angles)[:, columns]
    error = (log.measured - truth.angles)[:, columns] - predicted
    assert (np.linalg.norm(error, axis=0) < 0.15 * np.linalg.norm(predicted, axis=0)).all()


@pytest.mark.parametrize("friction", ["lugre", "coulomb", "none"])
def test_brakes_hold_without_power(experiment, friction):
    kind = {"variant": "flight", "axes": ("shoulder_pitch",), "plant": Plant(friction=friction)}
    angles = simulate([experiment(duration=3.0, shutdown=(1.04, 2.0), **kind)])[0].true_angles
    speed = np.abs(np.diff(angles, axis=0)).max(axis=1) * 50.0
    assert speed[51] > 0.05
    # Three ticks on, and until the power is back, nothing moves.
    assert speed[55:100].max() < 1e-4
    assert speed[101:].max() > 0.02


def test_what_oil_or_the_ground_needs_is_refused():
    refused("'flight' at the worksite given, expected an arm on the ground", load_arm, "flight", worksite=True)
    for name, value in (("actuator", "orifice"), ("supply_pressure", 15.0), ("oil_temperature", 20.0)):
        plant = Plant(**{name: value})
        refused(f"{name} = {value!r} given, but the drives of this arm are electric", load_arm, "flight", plant=plant)
    with pytest.raises(TwinError, match="electric"):
        _ = load_arm("flight").actuators


@pytest.fixture(scope="module")
def slow():
    return linearize(load_arm("published"), amplitudes=())


def test_bandwidths_gain_at_rest_and_delays(slow, truth):
    assert [slow.joint(name).bandwidth_hz for name in STUDIED_JOINTS] == pytest.approx([0.159, 0.984, 1.045], abs=0.005)
    for name in STUDIED_JOINTS:
        assert slow.joint(name).dc_gain == pytest.approx(1.0, abs=2e-6)
        assert slow.joint(name).delay_samples == truth.joint(name).delay_samples


def test_numbers_that_differ_are_derived():
    servos = VARIANTS["published"].servos
    assert {name for name in JOINTS if servos[name] != SERVOS[name]} == {*STUDIED_JOINTS, "wrist_pitch"}
    tags = {(line.owner, line.parameter): line.tag for line in NUMBERS["published"]}
    for name in STUDIED_JOINTS:
        assert tags[name, "slow pole"] == tags[name, "fast pole"] == "derived"
    assert tags["shoulder_yaw", "coulomb part"] == "derived"
    # Seals let every joint through the smallest test.
    for arm in map(load_arm, ("published", "nominal")):
        zones = {name: arm.drives[name].breakaway_torque / arm.gains[name].kp for name in JOINTS[1:]}
        assert max(zones.values()) < HAND_CONTROLLER.gain, zones


README = (models_directory() / "hmtb" / "README.md").read_text(encoding="utf-8").splitlines()


def test_readme_holds_every_number_with_unit_tag_and_source_and_no_other():
    assert all(line.tag in TAGS and line.unit and line.source for line in provenance_table())
    with pytest.raises(ValueError, match=r"'guessed'.*assumed"):
        quantity(1.0, "m", "guessed", "nowhere")
    refused(r"'hmtb/other\.xml'.*available: .*hmtb/hmtb\.xml", model_file, "hmtb/other.xml")
    rows = [line for line in README if line.startswith("| ") and line.count("|") == 7]
    assert rows[1:] == [markdown(line) for line in provenance_table()]


def test_readme_holds_the_gains():
    rows = {line.split(" | ")[0]: line for line in README if line.count("|") == 6}
    flow, torque = (load_arm(plant=Plant(servo=law)).gains for law in ("flow", "torque"))
    for name in JOINTS:
        expected = flow[name].kp, flow[name].dynamic, torque[name].kp, torque[name].kd
        assert rows[f"| {name.replace('_', ' ')}"].endswith("".join(f" | {gain:.5g}" for gain in expected) + " |")


def test_released_arm_is_the_nominal_one_whose_shoulder_roll_moves(arm, truth):
    released = load_arm("released")
    assert (released.indexed, arm.indexed) == ((), ("shoulder_roll",))
    assert axis_names("single_joint", "released") == JOINTS
    assert (released.gains, released.drives) == (arm.gains, arm.drives)
    np.testing.assert_array_equal(released.model.dof_armature[1:], arm.model.dof_armature[1:])
    own = linearize(released, amplitudes=(1e-3,))
    assert own.small_signal_error[1e-3] < 1e-4
    assert own.joint("shoulder_roll").dc_gain == pytest.approx(1.0, abs=1e-8)
    # Free, it turns under the yaw's torque: its inertia is what the yaw pushes against.
    assert own.joint("shoulder_yaw").bandwidth_hz != pytest.approx(truth.joint("shoulder_yaw").bandwidth_hz, rel=1e-3)
