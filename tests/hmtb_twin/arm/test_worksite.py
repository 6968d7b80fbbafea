from dataclasses import dataclass, replace

import mujoco
import numpy as np
import pytest

from hmtb_twin import IDEAL, JointLog, Motion, Status, View, linearize, load_arm, simulate
from hmtb_twin.arm.worksite_model import LATCH_WELD, UNIT_BODY
from hmtb_twin.control.modes import TOOL_AXES
from hmtb_twin.parameters.payloads import LATCH, SEATS, UNIT
from hmtb_twin.parameters.values import JOINTS, OPERATING_POSE, SAMPLE_TIME

WEIGHT = 9.81 * UNIT.mass


def commands(amplitude: float, ticks: int = 400) -> np.ndarray:
    bits = np.random.default_rng(3).choice([-amplitude, amplitude], (ticks // 5, len(JOINTS)))
    bits[:, 0] = 0.0
    return load_arm().pose(OPERATING_POSE) + np.repeat(bits, 5, axis=0)


def response(arm, command: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    data = arm.rest(arm.pose(OPERATING_POSE))
    angles, wrench = np.empty_like(command), np.empty((len(command), 6))
    for k, control in enumerate(arm.controls(command)):
        data.ctrl[:] = control
        mujoco.mj_step(arm.model, data, nstep=round(SAMPLE_TIME / arm.model.opt.timestep))
        angles[k], wrench[k] = data.qpos[: len(JOINTS)], data.sensordata[:6]
    return angles - arm.pose(OPERATING_POSE), wrench


@pytest.mark.parametrize(("payload", "bound"), [("rpcm", 2e-4), ("none", 1e-11)])
def test_away_from_the_seats_the_arm_is_that_of_free_space(payload, bound):
    for amplitude in (1e-4, 1e-2):
        command = commands(amplitude)
        angles, wrench = response(load_arm(payload=payload, friction=False), command)
        ours, force = response(load_arm(payload=payload, friction=False, worksite=True), command)
        error = np.linalg.norm(ours - angles, axis=0)[1:] / np.linalg.norm(angles, axis=0)[1:]
        assert error.max() < bound
        assert np.abs(force - wrench)[5:].max() < 3e-3 * np.abs(wrench).max()


def test_loaded_and_unloaded_arms_differ():
    command = commands(1e-2)
    loaded, _ = response(load_arm(payload="rpcm", worksite=True), command)
    empty, _ = response(load_arm(payload="none", worksite=True), command)
    error = np.linalg.norm(loaded - empty, axis=0)[1:] / np.linalg.norm(loaded, axis=0)[1:]
    assert error[:3].min() > 1e-2


def test_truth_is_that_of_free_space():
    truth, free = linearize(load_arm(friction=False, worksite=True)), linearize(load_arm())
    np.testing.assert_array_equal(truth.model.A, free.model.A)


def test_the_scene_holds_the_seats_and_no_other_plates():
    model = load_arm(worksite=True).model
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    for name, seat in SEATS.items():
        body = model.body(name)
        np.testing.assert_allclose(body.pos, seat.position, atol=1e-9)
        geoms = [g for g in range(model.ngeom) if model.geom_bodyid[g] == body.id]
        plates = list(seat.plates())
        assert len(geoms) == len(plates) == 8
        for geom, plate in zip(geoms, plates, strict=True):
            np.testing.assert_allclose(model.geom_pos[geom], plate.position, atol=1e-8)
            np.testing.assert_allclose(model.geom_size[geom], plate.half_size, atol=1e-8)
            half = np.array([*plate.tilt, 0.0]) / 2
            np.testing.assert_allclose(model.geom_quat[geom][1:], np.sin(half), atol=1e-8)
        position, rotation = seat.seated
        np.testing.assert_allclose(data.site(f"{name}_seat").xpos, position, atol=1e-8)
        np.testing.assert_allclose(data.site(f"{name}_seat").xmat.reshape(3, 3), rotation, atol=1e-8)


def test_only_the_unit_touches_anything():
    for payload in ("rpcm", "none"):
        assert not load_arm(payload=payload).model.geom_contype.any()
    model = load_arm(worksite=True).model
    touching = np.flatnonzero(model.geom_contype)
    assert [model.body(model.geom_bodyid[g]).name for g in touching] == [UNIT_BODY]
    touched = {model.body(model.geom_bodyid[g]).name for g in np.flatnonzero(model.geom_conaffinity)}
    assert touched == {"support_structure", "holster", "receptacle", "end_effector"}


@pytest.mark.parametrize("name", SEATS)
def test_a_seat_takes_the_unit_in_and_holds_it(name):
    arm = load_arm(payload="none", worksite=True)
    data = arm.rest(arm.pose(OPERATING_POSE))
    position, rotation = SEATS[name].seated
    # A little beside the well, above the guides' lower edges: they must lead it in.
    aside = rotation @ [0.0, 0.008, 0.006]
    data.qpos[7:10] = position + aside + [0.0, 0.0, SEATS[name].depth + 0.02]
    mujoco.mju_mat2Quat(data.qpos[10:], rotation.ravel())
    mujoco.mj_step(arm.model, data, nstep=3000)
    off = rotation.T @ (data.qpos[7:10] - position)
    assert abs(off[0]) < 1e-4
    assert np.abs(off[1:]).max() <= SEATS[name].clearance + 1e-4
    assert data.sensor("unit_touch").data[0] == pytest.approx(WEIGHT, rel=0.01)


@dataclass
class Hand:
    """Moves the tool down onto the unit in its holster, closes there, and opens again."""

    down: float
    aside: float = 0.0
    closed: tuple[float, float] = (4.0, 6.0)

    def move(self, view: View) -> Motion:
        volts = np.zeros(6)
        if view.time < 3.0:
            # 0.02 m/s per volt, over three seconds.
            volts[:2] = self.down / 0.06, self.aside / 0.06
        return Motion(volts, self.closed[0] <= view.time < self.closed[1])


@pytest.fixture
def gripping(experiment):
    way = load_arm().controller.tool_pose(load_arm().pose(OPERATING_POSE))[0] - SEATS["holster"].seated[0]

    @dataclass(frozen=True)
    class Gripping(experiment):
        short: float = 0.001
        aside: float = 0.0
        closed: tuple[float, float] = (4.0, 6.0)

        def operator(self) -> Hand:
            return Hand(float(way[2]) - self.short, self.aside, self.closed)

    return Gripping(
        axes=TOOL_AXES,
        mode="cartesian_rate",
        worksite=True,
        payload="none",
        duration=7.0,
        chain=IDEAL,
        pose=OPERATING_POSE,
    )


def test_latch_closes_about_the_unit_and_lets_go(gripping):
    log = simulate([gripping])[0]
    held = (log.status & Status.UNIT_HELD) > 0
    np.testing.assert_array_equal(log.time[np.flatnonzero(np.diff(held.astype(int))) + 1], [4.0, 6.0])
    # On its own the unit loads the holster, held it loads the wrist; the arm stands still through both.
    assert log.contact_force[190] == pytest.approx(WEIGHT, rel=1e-3)
    assert log.contact_force[290] < 0.1 * WEIGHT
    weight = np.linalg.norm(log.wrench[:, :3], axis=1)
    assert weight[290] - weight[190] == pytest.approx(WEIGHT, rel=0.1)
    assert weight[340] == pytest.approx(weight[190], rel=1e-3)
    tool, _ = load_arm().controller.tool_path(log.true_angles[195:])
    assert np.ptp(tool, axis=0).max() < 1e-3


@pytest.mark.parametrize("miss", [{"short": 2.0 * LATCH.reach}, {"aside": 1.5 * LATCH.reach}])
def test_latch_does_not_close_beside_the_unit(gripping, miss):
    log = simulate([replace(gripping, **miss)])[0]
    assert not (log.status & Status.UNIT_HELD).any()


def test_shutdown_keeps_the_unit_in_the_fingers(gripping):
    log = simulate([replace(gripping, shutdown=(4.5, 5.5))])[0]
    held = (log.status & Status.UNIT_HELD) > 0
    assert held[200:300].all()
    assert (log.status[225:275] & Status.SHUT_DOWN).all()


def test_log_keeps_unit_and_contact_and_others_have_none(gripping, experiment, tmp_path):
    log = simulate([replace(gripping, duration=1.0)])[0]
    back = JointLog.load(log.save(tmp_path / "log.nc"))
    for name in ("unit_pose", "contact_force", "status"):
        np.testing.assert_array_equal(getattr(back, name), getattr(log, name))
        with pytest.raises(ValueError, match="read-only"):
            getattr(back, name)[0] = 0
    plain = simulate([experiment(duration=1.0)])[0]
    assert plain.unit_pose is None
    assert JointLog.load(plain.save(tmp_path / "plain.nc")).contact_force is None


def test_latch_holds_stiffly():
    arm = load_arm(worksite=True)
    assert not arm.model.eq_active0[arm.model.equality(LATCH_WELD).id]
    data = arm.rest(arm.pose(OPERATING_POSE))
    mujoco.mj_step(arm.model, data, nstep=1000)
    apart = data.site("tool").xpos - data.body(UNIT_BODY).xpos
    assert np.linalg.norm(apart) < 1e-6
