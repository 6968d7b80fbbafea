from dataclasses import dataclass, replace

import mujoco
import numpy as np
import pytest

from hmtb_twin import IDEAL, Motion, Status, linearize, load_arm, simulate
from hmtb_twin.arm.worksite_model import LATCH_WELD, UNIT_BODY
from hmtb_twin.control.modes import TOOL_AXES
from hmtb_twin.parameters.values import SAMPLE_TIME
from hmtb_twin.parameters.variants import JOINTS, OPERATING_POSE
from hmtb_twin.parameters.worksite import LATCH, SEATS, UNIT
from tests.hmtb_twin.altered_arms import at_step

WEIGHT = 9.81 * UNIT.mass


def response(arm, command):
    data = arm.rest(arm.pose(OPERATING_POSE))
    angles, wrench = np.empty_like(command), np.empty((len(command), 6))
    for k, control in enumerate(arm.controls(command)):
        data.ctrl[:] = control
        mujoco.mj_step(arm.model, data, nstep=round(SAMPLE_TIME / arm.model.opt.timestep))
        angles[k], wrench[k] = data.qpos[: len(JOINTS)], data.sensordata[:6]
    return angles - arm.pose(OPERATING_POSE), wrench


@pytest.mark.slow
@pytest.mark.parametrize(("payload", "bound"), [("rpcm", 1e-6), ("none", 1e-11)])
def test_away_from_the_seats_the_arm_is_that_of_free_space(payload, bound):
    for amplitude in (1e-4, 1e-2):
        bits = np.random.default_rng(3).choice([-amplitude, amplitude], (80, len(JOINTS)))
        bits[:, 0] = 0.0
        command = load_arm().pose(OPERATING_POSE) + np.repeat(bits, 5, axis=0)
        site, free = (load_arm(payload=payload, friction=False, worksite=worksite) for worksite in (True, False))
        angles, wrench = response(at_step(free, site.model.opt.timestep), command)
        ours, force = response(site, command)
        error = np.linalg.norm(ours - angles, axis=0)[1:] / np.linalg.norm(angles, axis=0)[1:]
        assert error.max() < bound
        assert np.abs(force - wrench)[5:].max() < 1e-5 * np.abs(wrench).max()


def test_truth_is_that_of_free_space_and_the_latch_holds_stiffly():
    site = load_arm(friction=False, worksite=True)
    truth, free = linearize(site, amplitudes=()), linearize(load_arm(), amplitudes=())
    np.testing.assert_array_equal(truth.model.A, free.model.A)
    assert not site.model.eq_active0[site.model.equality(LATCH_WELD).id]
    data = site.rest(site.pose(OPERATING_POSE))
    mujoco.mj_step(site.model, data, nstep=1000)
    assert np.linalg.norm(data.site("tool").xpos - data.body(UNIT_BODY).xpos) < 1e-6


def test_the_scene_holds_the_seats_and_only_the_unit_touches_anything():
    for payload in ("rpcm", "none"):
        assert not load_arm(payload=payload).model.geom_contype.any()
    model = load_arm(worksite=True).model
    touching = np.flatnonzero(model.geom_contype)
    assert [model.body(model.geom_bodyid[g]).name for g in touching] == [UNIT_BODY]
    touched = {model.body(model.geom_bodyid[g]).name for g in np.flatnonzero(model.geom_conaffinity)}
    assert touched == {"support_structure", "holster", "receptacle", "end_effector"}
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


class Hand:
    """Moves the tool down onto the unit in its holster in three seconds, closes there at 4 s, and opens at 6 s."""

    def __init__(self, down, aside):
        # 0.02 m/s per volt, over three seconds.
        self.volts = np.array([down / 0.06, aside / 0.06, 0.0, 0.0, 0.0, 0.0])

    def move(self, view):
        return Motion(self.volts * (view.time < 3.0), 4.0 <= view.time < 6.0)


@pytest.fixture
def gripping(experiment):
    way = load_arm().controller.tool_pose(load_arm().pose(OPERATING_POSE))[0] - SEATS["holster"].seated[0]

    @dataclass(frozen=True)
    class Gripping(experiment):
        short: float = 0.001
        aside: float = 0.0

        def operator(self):
            return Hand(float(way[2]) - self.short, self.aside)

    kind = {"axes": TOOL_AXES, "mode": "cartesian_rate", "worksite": True, "payload": "none", "chain": IDEAL}
    return Gripping(duration=7.0, pose=OPERATING_POSE, **kind)


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


@pytest.mark.slow
def test_latch_does_not_close_beside_the_unit_and_keeps_it_without_power(gripping):
    misses = [replace(gripping, short=2.0 * LATCH.reach), replace(gripping, aside=1.5 * LATCH.reach)]
    *missed, log = simulate([*misses, replace(gripping, shutdown=(4.5, 5.5))])
    assert not any((one.status & Status.UNIT_HELD).any() for one in missed)
    assert ((log.status[200:300] & Status.UNIT_HELD) > 0).all()
    assert (log.status[225:275] & Status.SHUT_DOWN).all()
