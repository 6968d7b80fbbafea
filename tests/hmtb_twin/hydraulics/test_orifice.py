from dataclasses import replace

import mujoco
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import solve_ivp

from hmtb_twin import JOINTS, STUDIED_JOINTS, Plant, linearize, load_arm, simulate
from hmtb_twin.hydraulics import callbacks
from hmtb_twin.hydraulics import valve_equations as eq
from hmtb_twin.hydraulics.callbacks import install_equations
from hmtb_twin.hydraulics.drive_actuators import (
    add_orifice_actuators,
    drive_parameters,
    valve_parameters,
)
from hmtb_twin.parameters.servo_gains import ServoGains
from hmtb_twin.parameters.servo_valve import POWER_UNIT, SERVO_VALVE
from hmtb_twin.parameters.variants import ACTUATORS, INDEXED_JOINTS, OPERATING_POSE
from tests.hmtb_twin.altered_arms import natural_poles, with_valve
from tests.hmtb_twin.balances import binary, orifice_balances
from tests.refusals import refused

ORIFICE = Plant(actuator="orifice")
GAINS = dict.fromkeys(("shaft", "other"), ServoGains(0.0, 0.0))
SMOOTH = replace(ACTUATORS["elbow_pitch"], friction=None)


@pytest.fixture(scope="module")
def valve_arm():
    return load_arm(plant=ORIFICE, friction=False)


@pytest.fixture(scope="module")
def valve_truth(valve_arm):
    return linearize(valve_arm, amplitudes=(1e-6, 1e-5, 1e-4, 1e-3, 1e-2))


def bench(actuator=SMOOTH, *, inertia=5.0, shafts=("shaft",), valve=SERVO_VALVE, power_unit=POWER_UNIT):
    """Free shafts on servo valves of one supply; their controls are commanded angle and torque of each in turn."""
    spec = mujoco.MjSpec()
    spec.option.gravity = [0.0, 0.0, 0.0]
    for name in shafts:
        body = spec.worldbody.add_body(mass=1.0, inertia=[inertia] * 3, explicitinertial=True)
        body.add_joint(name=name, axis=[0.0, 0.0, 1.0])
    add_orifice_actuators(spec, dict.fromkeys(shafts, actuator), GAINS, valve=valve, power_unit=power_unit)
    model = spec.compile()
    data = mujoco.MjData(model)
    data.act[0] = actuator.hydraulics.supply_pressure
    data.act[1:].reshape(-1, eq.STATES)[:, eq.MEAN] = 0.5 * (data.act[0] + actuator.hydraulics.return_pressure)
    return model, data


def states(data):
    return data.act[1:].reshape(-1, eq.STATES)


def run(model, data, seconds):
    mujoco.mj_step(model, data, nstep=round(seconds / model.opt.timestep))


@pytest.mark.parametrize("name", ["shoulder_yaw", "elbow_pitch", "wrist_roll"])
def test_bench_follows_the_equations_written_down_again(name):
    actuator, valve, unit = replace(ACTUATORS[name], friction=None), SERVO_VALVE, POWER_UNIT
    inertia = 25.0 if name == "shoulder_yaw" else 5.0
    model, data = bench(actuator, inertia=inertia)
    oil, D, C, rated = actuator.hydraulics, actuator.displacement, actuator.leakage, actuator.rated_flow
    chamber = actuator.trapped_volume / (2.0 * oil.bulk_modulus)
    omega, ps0, pr = 2 * np.pi * valve.frequency, oil.supply_pressure, oil.return_pressure
    assert valve.static_gain(actuator, 0.0) == valve.loop_gain
    assert rated == pytest.approx(D * actuator.no_load_speed)

    def law(drop):
        return drop / (drop**2 + valve.transition_pressure**2) ** 0.25

    def land(x, drop):
        return rated / law((ps0 - pr) / 2) * (x + np.sqrt(x**2 + valve.clearance**2)) / 2 * law(drop)

    def equations(_, state, torque):
        w, ps, x, v, slow, pa, pb = state
        load = pa - pb
        ask = valve.loop_gain * chamber / 2 * (torque / D - load) + C * torque / D + valve.compensated * D * w
        to_a, from_a = land(x, ps - pa), land(-x, pa - pr)
        to_b, from_b = land(-x, ps - pb), land(x, pb - pr)
        pump = np.clip(unit.droop * (ps0 - ps), 0, unit.largest_flow)
        return [
            D * load / inertia,
            (pump - to_a - to_b) / unit.capacity,
            omega * v,
            omega * (np.clip(ask / rated, -1, 1) - x) - 2 * valve.damping * omega * v,
            (load - slow) / valve.washout_time,
            (to_a - from_a - D * w - C * load) / chamber,
            (to_b - from_b + D * w + C * load) / chamber,
        ]

    # Within the strokes and the pressures of the check valves: those are tested below.
    state = np.array([0.0, ps0, 0, 0, 0, (ps0 + pr) / 2, (ps0 + pr) / 2])
    for torque in np.array([0.1, -0.08, 0.03]) * actuator.maximum_torque:
        data.ctrl[1] = torque
        run(model, data, 0.1)
        state = solve_ivp(equations, (0, 0.1), state, args=(torque,), rtol=1e-10, atol=1e-12, method="LSODA").y[:, -1]
        spool, speed, _, slow, mean, load = states(data)[0]
        simulated = [data.qvel[0], data.act[0], spool, speed / omega, slow, mean + load / 2, mean - load / 2]
        np.testing.assert_allclose(simulated, state, rtol=1e-5, atol=2e-6)


def test_python_and_mujoco_compute_the_same_rates():
    arm = load_arm(plant=ORIFICE)
    data = arm.rest(arm.pose("home"))
    rng = np.random.default_rng(4)
    for _ in range(20):
        data.qpos[:] += 0.1 * rng.standard_normal(7)
        data.qvel[:] = rng.standard_normal(7)
        data.act[:] *= 1.0 + 0.1 * rng.standard_normal(arm.model.na)
        data.act[1:].reshape(7, -1)[:, eq.SPOOL] += 0.3 * rng.standard_normal(7)
        data.ctrl[0::2] += 0.1 * rng.standard_normal(7)
        mujoco.mj_forward(arm.model, data)
        rates = eq.arm_rates(drive_parameters(arm.model), data.act, data.ctrl, data.qpos, data.qvel)
        np.testing.assert_allclose(data.act_dot, rates, rtol=1e-12, atol=1e-12)
        force = data.actuator_force[0::2]
        for j, name in enumerate(JOINTS):
            p, own, slopes = drive_parameters(arm.model)[j], data.act[1:].reshape(7, -1)[j], rates[1:].reshape(7, -1)[j]
            oil = arm.actuators[name].displacement * own[eq.LOAD]
            rubbing = eq.friction_torque(p, own[eq.BRISTLES], slopes[eq.BRISTLES])
            assert force[j] == pytest.approx(oil - rubbing, rel=1e-12)


@given(st.floats(-1.0, 1.0), st.floats(0.0, 25.0), st.floats(0.0, 25.0), st.floats(3.0, 25.0), st.floats(-0.1, 0.1))
def test_no_valve_gives_energy(spool, a, b, supply, underlap):
    p = valve_parameters(SMOOTH, ServoGains(0.0, 0.0), replace(SERVO_VALVE, underlap=underlap))
    back = p[eq.RETURN]
    flows = eq.land_flows(p, spool, supply, a, b)
    for flow, drop in zip(flows, (supply - a, a - back, supply - b, b - back), strict=True):
        assert flow * drop >= 0.0
    assert eq.check_flow(p, a) * (back - a) >= 0.0


@pytest.mark.parametrize("load", [-0.5, 0.0, 0.5])
def test_speed_under_load_is_that_of_the_orifice_law(load):
    # An accumulator that holds the pressure: the law is stated at a known supply.
    model, data = bench(power_unit=replace(POWER_UNIT, capacity=1e9))
    data.qfrc_applied[0] = load * SMOOTH.maximum_torque
    data.ctrl[1] = 1e5
    run(model, data, 3.0)
    assert states(data)[0, eq.SPOOL] == pytest.approx(1.0, abs=2e-3)
    pressure = SMOOTH.hydraulics.pressure
    assert states(data)[0, eq.LOAD] == pytest.approx(-load * pressure, rel=1e-4, abs=1e-4)
    # An aiding load widens the drop over both lands, an opposing one narrows it; leakage takes its part.
    share = eq.root((1 + load) * pressure / 2, SERVO_VALVE.transition_pressure)
    share /= eq.root(pressure / 2, SERVO_VALVE.transition_pressure)
    leakage = SMOOTH.leakage * -load * pressure / SMOOTH.displacement
    assert data.qvel[0] == pytest.approx(SMOOTH.no_load_speed * share - leakage, rel=1e-3)
    plain = SMOOTH.no_load_speed * np.sqrt(1 + load) - leakage
    # The transition to laminar flow takes 1 % at half the nominal drop.
    assert data.qvel[0] == pytest.approx(plain, rel=1.2e-2)


def test_overlap_is_a_dead_band_and_underlap_leaks():
    pressures = {}
    for underlap in (-0.05, 0.0):
        model, data = bench(inertia=1e9, valve=replace(SERVO_VALVE, underlap=underlap, clearance=1e-4))
        gain = valve_parameters(SMOOTH, ServoGains(0.0, 0.0))[eq.PRESSURE_GAIN]
        # Asks for 4 % of the stroke: within the overlap nothing reaches the load.
        data.ctrl[1] = 0.04 * SMOOTH.rated_flow / (gain + SMOOTH.leakage) * SMOOTH.displacement
        run(model, data, 0.3)
        pressures[underlap] = states(data)[0, eq.LOAD] / (data.ctrl[1] / SMOOTH.displacement)
    assert pressures[0.0] == pytest.approx(1.0, abs=0.01)
    assert abs(pressures[-0.05]) < 0.02
    valves = [
        valve_parameters(SMOOTH, ServoGains(0.0, 0.0), replace(SERVO_VALVE, underlap=u)) for u in (-0.05, 0.0, 0.05)
    ]
    half = 0.5 * (20.7 + SMOOTH.hydraulics.return_pressure)
    null = [sum(eq.land_flows(p, 0.0, 20.7, half, half)) for p in valves]
    assert null[0] < 0.1 * null[1] < 0.02 * null[2]
    # Null leakage at zero lap: half the clearance open at each of four lands.
    assert null[1] == pytest.approx(4 * SERVO_VALVE.clearance / 2 * SMOOTH.rated_flow, rel=1e-6)


def test_spool_stops_at_full_stroke_and_pressures_stay_within_the_check_valves():
    model, data = bench(ACTUATORS["shoulder_yaw"], inertia=25.0)
    p, rows = drive_parameters(model)[0], np.empty((2000, eq.STATES))
    for k, row in enumerate(rows):
        data.ctrl[1] = 1e5 if k // 200 % 2 else -1e5
        mujoco.mj_step(model, data)
        row[:] = states(data)[0]
    half = np.abs(rows[:, eq.LOAD]) / 2
    assert 1.0 <= np.abs(rows[:, eq.SPOOL]).max() < 1.05
    assert 0.0 < (rows[:, eq.MEAN] - half).min() < p[eq.RETURN]
    assert p[eq.RELIEF] < (rows[:, eq.MEAN] + half).max() < p[eq.RELIEF] + 3.0


def test_joints_share_a_supply_that_sags():
    small = replace(POWER_UNIT, largest_flow=1.2 * SMOOTH.rated_flow)
    speeds, pressures = [], []
    for torque in (0.0, 1e5):
        model, data = bench(shafts=("shaft", "other"), power_unit=small)
        data.ctrl[1], data.ctrl[3] = 1e5, torque
        run(model, data, 30.0)
        speeds.append(data.qvel[0])
        pressures.append(data.act[0])
    # Alone the pump feeds the joint; the two together take what it gives, and the pressure falls until they do.
    assert pressures[0] > 20.0
    null = 1.2 * SERVO_VALVE.clearance * SMOOTH.rated_flow
    assert 2 * speeds[1] * SMOOTH.displacement == pytest.approx(small.largest_flow, abs=null)
    assert speeds[1] == pytest.approx(0.6 * SMOOTH.no_load_speed, rel=0.02)
    assert speeds[0] > 0.97 * SMOOTH.no_load_speed
    assert pressures[1] < 12.0


def test_pressure_loop_has_margin_and_leakage_takes_the_place_of_the_amplifiers_slope():
    arm = load_arm(plant=replace(ORIFICE, servo="torque"))
    for name in JOINTS:
        static = SERVO_VALVE.static_gain(arm.actuators[name], arm.gains[name].kd)
        gain, phase = SERVO_VALVE.margins(static)
        assert gain > 4.0
        assert np.degrees(phase) > 60.0
    # At the phase crossover of a plain loop, the spool's natural frequency, in closed form.
    plain, _ = SERVO_VALVE.margins(SERVO_VALVE.loop_gain)
    closed = 2 * SERVO_VALVE.damping * SERVO_VALVE.angular_frequency / SERVO_VALVE.loop_gain
    assert plain == pytest.approx(closed, rel=1e-3)
    actuator, kd = arm.actuators["elbow_pitch"], arm.gains["elbow_pitch"].kd
    oils = [replace(actuator.hydraulics, oil_temperature=temperature) for temperature in (20.0, 40.0, 60.0, 100.0)]
    *warm, hot = (replace(actuator, hydraulics=oil) for oil in oils)
    slopes = [SERVO_VALVE.static_gain(one, kd) * one.compliance + one.leakage for one in warm]
    np.testing.assert_allclose(slopes, actuator.displacement**2 / kd + actuator.leakage)
    assert SERVO_VALVE.static_gain(hot, 4.0 * kd) == 0.0


@pytest.mark.slow
def test_bandwidths_stay_near_one_hertz_and_the_arm_is_well_damped(valve_truth, valve_arm):
    for pose in (OPERATING_POSE, "home"):
        truth = valve_truth if pose == OPERATING_POSE else linearize(valve_arm, pose, amplitudes=())
        for name in STUDIED_JOINTS:
            assert 0.9 < truth.joint(name).bandwidth_hz < 1.2
            assert truth.joint(name).dc_gain == pytest.approx(1.0, abs=5e-3)
        poles = np.concatenate([truth.joint(name).dominant_poles for name in STUDIED_JOINTS])
        assert (-poles.real / np.abs(poles)).min() > 0.35
        # The mean pressures of the chambers settle slowest, through null leakage: no joint feels them.
        assert np.abs(truth.model.poles()).max() < 0.998


def test_load_flow_is_compensated_short_of_instability():
    arm = load_arm(plant=replace(ORIFICE, friction="viscous", servo="torque"))
    for more, stable in ((1.06, True), (1.1, False)):
        valve = replace(SERVO_VALVE, compensated=more * SERVO_VALVE.compensated)
        assert bool(natural_poles(with_valve(arm, valve=valve), OPERATING_POSE).real.max() < 0.0) is stable


def test_tangent_holds_in_proportion_to_amplitude(valve_truth):
    errors = valve_truth.small_signal_error
    assert errors[1e-6] < 1e-4
    assert errors[1e-5] < 2e-4
    for amplitude in (1e-5, 1e-4):
        assert errors[10 * amplitude] / errors[amplitude] == pytest.approx(10.0, rel=0.1)
    # Spools leave the rounded null, beyond which their gain is constant.
    assert 0.03 < errors[1e-2] < 0.1
    assert "50 Hz map" in valve_truth.provenance["method"]


@pytest.mark.parametrize("pose", [OPERATING_POSE, "home"])
def test_rest_is_an_equilibrium(pose, valve_arm):
    data = valve_arm.rest(valve_arm.pose(pose))
    angles, act = data.qpos.copy(), data.act.copy()
    free = [name not in INDEXED_JOINTS for name in JOINTS]
    offsets = np.abs(angles - valve_arm.pose(pose))[free]
    # Null leakage costs a loaded valve some opening, and the servo some millirad.
    assert 1e-5 < offsets.max() < 5e-3
    run(valve_arm.model, data, 2.0)
    assert np.abs(data.qpos - angles).max() < 1e-8
    assert np.abs(data.act - act).max() < 1e-5


def test_shutdown_and_worksite_run_on_servo_valves(experiment):
    stopped = experiment(plant=ORIFICE, duration=3.0, shutdown=(1.0, 2.0))
    site = experiment(plant=ORIFICE, duration=1.0, worksite=True)
    logs = simulate([stopped, site, replace(stopped, name="linear", plant=Plant())])
    assert not logs.failed
    log = logs[0]
    assert np.abs(log.spool[:50, 3]).max() > 10 * np.abs(log.spool[:50, 1]).max()
    assert 20.0 < log.supply_pressure[:50].min() < log.supply_pressure[:50].max() < 20.7
    assert np.abs(log.spool[60:100]).max() < 1e-6
    # The arm sinks by leakage alone, as it does with linear actuators.
    sunk, linear = (np.ptp(log.true_angles[60:100], axis=0)[2:5] for log in (log, logs[2]))
    np.testing.assert_allclose(sunk, linear, rtol=0.1)
    assert sunk.max() < 0.02
    assert np.abs(log.spool[105:]).max() > 1e-3
    assert logs[1].unit_pose is not None


@pytest.mark.slow
@pytest.mark.parametrize(("friction", "joints"), [("viscous", ("elbow_pitch",)), ("lugre", JOINTS[1:])])
def test_books_of_oil_and_energy_balance(friction, joints):
    arm = load_arm(plant=replace(ORIFICE, friction=friction))
    oil, energy = orifice_balances(arm, binary(arm, joints, 0.05)[:60])
    assert oil.throughput[2 * JOINTS.index("elbow_pitch")] > 1.0
    assert oil.closure < 1e-6
    # Every chamber of its own, but for rounding where nothing flows.
    assert (np.abs(oil.residual) < 1e-6 * oil.throughput + 1e-6).all()
    assert energy.closure < 1e-4
    assert min(energy.throttled, energy.leaked, energy.dragged) > 0.0
    assert (energy.rubbed > 0.0) is (friction == "lugre")


def test_without_a_folder_for_machine_code_the_equations_are_compiled_anew(monkeypatch):
    machine_code, asked = install_equations(), []

    def compiled(offsets, *, cached=True):
        asked.append(cached)
        if cached:
            raise RuntimeError("no locator available")
        return machine_code

    monkeypatch.setattr(eq, "compiled_callbacks", compiled)
    assert callbacks._compiled.__wrapped__() == machine_code
    assert asked == [True, False]


@pytest.mark.slow
@pytest.mark.parametrize("name", ["act_dyn", "act_bias"])
def test_removed_equations_are_put_back_wherever_an_arm_moves_and_foreign_ones_refused(name, experiment):
    plant = replace(ORIFICE, friction="viscous")
    kind, arm = experiment(duration=0.5, plant=plant), load_arm(plant=plant)
    getter, setter = (getattr(mujoco, f"{verb}_mjcb_{name}") for verb in ("get", "set"))
    uses = (
        lambda: load_arm(plant=plant),
        lambda: simulate([kind])[0].true_angles,
        lambda: linearize(load_arm(plant=plant), amplitudes=()).model.A,
        lambda: np.array(arm.rest(arm.pose("home")).act_dot),
    )
    for use in uses:
        before, ours = use(), getter()
        setter(None)
        np.testing.assert_array_equal(use(), before)
        assert getter() is ours
    # On somebody else's equations nothing moves, and they stay where they are.
    setter(lambda model, data, actuator: 0.0)
    theirs = getter()
    try:
        for use in (*uses, install_equations):
            refused(f"mjcb_{name}; the arm's drives need it", use)
            assert getter() is theirs
    finally:
        setter(ours)


def test_other_peoples_user_actuators_are_left_alone():
    install_equations()
    model = mujoco.MjModel.from_xml_string(
        """<mujoco><worldbody><body><joint name="j"/><geom size="0.1"/></body></worldbody>
        <actuator><general joint="j" dyntype="user" actdim="2" biastype="user"/></actuator></mujoco>"""
    )
    data = mujoco.MjData(model)
    data.act[:], data.ctrl[0] = 1.0, 5.0
    mujoco.mj_forward(model, data)
    assert (data.act_dot == 0.0).all()
    assert data.actuator_force[0] == 1.0
