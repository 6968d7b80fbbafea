"""The replacement unit in a batch of simulations: latch, pose and contact forces."""

from collections.abc import Sequence
from copy import copy
from dataclasses import replace

import mujoco
import numpy as np
from mujoco import batch

from hmtb_twin.arm.arm import Arm
from hmtb_twin.arm.controller_model import controller_model
from hmtb_twin.arm.worksite_model import LATCH_WELD, TOUCH_SENSOR, UNIT_BODY
from hmtb_twin.control.experiment import UnitView
from hmtb_twin.parameters.worksite import LATCH

END_EFFECTOR = "end_effector"
"""Body whose fingers close about the unit's fitting."""


class WorksiteRun:
    """The latch, the unit and its contacts in every simulation of a batch.

    Fingers that close about the fitting hold the unit in its present pose; fingers that miss it hold nothing until they
    have been opened again. The latch's switch tells the controller the payload for its feedforward torque.

    Args:
        simulations: The batch, in its first state.
        arms: Arm at the worksite of each simulation, all of one structure.

    Attributes:
        held: Whether the end effector holds the unit, per simulation.
    """

    def __init__(self, simulations: batch.Batch, arms: Sequence[Arm]) -> None:
        self._arms, self._joints = arms, len(arms[0].joints)
        self.held = np.array([arm.description.payloads[arm.payload] is not None for arm in arms])
        self._closed = self.held.copy()
        # Each simulation has its own models, which hold the pose of the unit between the fingers.
        self._working = [copy(arm.model) for arm in arms]
        self._shut: list[mujoco.MjModel | None] = [None for _ in self.held]
        self._angles, self._active = simulations.bind("qpos"), simulations.bind("eq_active")
        self._positions, self._rotations = simulations.bind("xpos"), simulations.bind("xmat")
        self._site_positions, self._site_rotations = simulations.bind("site_xpos"), simulations.bind("site_xmat")
        history = simulations.bind("history")
        model = arms[0].model
        self._weld = model.equality(LATCH_WELD).id
        self._unit, self._hand = model.body(UNIT_BODY).id, model.body(END_EFFECTOR).id
        self._tool = model.site("tool").id
        sensor = model.sensor(TOUCH_SENSOR).id
        samples = model.sensor_history[sensor, 0]
        # A history holds two numbers of its own, then the times, then the values.
        first = model.sensor_historyadr[sensor] + 2 + samples
        self._touch = history[:, first : first + samples]

    @property
    def unit_pose(self) -> np.ndarray:
        """Position and quaternion of the unit (n, 7), m and 1."""
        return self._angles[:, self._joints :]

    @property
    def contact_force(self) -> np.ndarray:
        """Largest sum of normal forces between unit and worksite during the last tick (n, 1), N."""
        # A blow may be over before the tick ends: the largest of all its physics steps counts.
        return self._touch.max(axis=1, keepdims=True)

    def look(self, i: int) -> UnitView:
        """Return where the unit of simulation i is, and whether it is held."""
        position, rotation = self._unit_frame(i)
        return UnitView(position.copy(), rotation.copy(), bool(self.held[i]))

    def close(self, i: int, closed: bool) -> bool:
        """Open or close the fingers of simulation i; return whether its models have changed."""
        # Fingers that missed the unit must be opened before they can hold it.
        before, self._closed[i] = self._closed[i], closed
        if closed == before:
            return False
        self.held[i] = closed and self._within_fingers(i)
        self._active[i, self._weld] = self.held[i]
        # Opening the fingers only switches the weld off: its pose stays in the models and is not used.
        if self.held[i]:
            for model in filter(None, (self._working[i], self._shut[i])):
                self._hold(i, model)
        return bool(self.held[i])

    def model(self, i: int, *, powered: bool) -> mujoco.MjModel:
        """Return the model of simulation i with or without servo power."""
        return self._working[i] if powered else self._without_power(i)

    def carrying(self, i: int) -> Arm:
        """Return the arm of simulation i with the controller's model for its present payload."""
        arm = self._arms[i]
        payload = "rpcm" if self.held[i] else "none"
        return arm if payload == arm.payload else replace(arm, controller=controller_model(payload, arm.variant))

    def _unit_frame(self, i: int) -> tuple[np.ndarray, np.ndarray]:
        """Return position (3,) and rotation (3, 3) of the unit of simulation i, as views of the batch's arrays."""
        return self._positions[i, self._unit], self._rotations[i, self._unit].reshape(3, 3)

    def _without_power(self, i: int) -> mujoco.MjModel:
        """Return the model of simulation i after a shutdown, the unit held where it is in the working model."""
        shut = self._shut[i]
        if shut is None:
            # Made at the first shutdown: most experiments have none.
            shut = self._shut[i] = copy(self._arms[i].unpowered)
            shut.eq_data[self._weld] = self._working[i].eq_data[self._weld]
        return shut

    def _within_fingers(self, i: int) -> bool:
        """Return whether the unit's fitting is between the fingers, within the reach of the latch."""
        position, rotation = self._unit_frame(i)
        tool = self._site_rotations[i, self._tool].reshape(3, 3)
        distance = np.linalg.norm(position - self._site_positions[i, self._tool])
        # The angle of a rotation from its trace; by rounding the cosine may exceed one.
        angle = np.arccos(np.clip((np.sum(tool * rotation) - 1.0) / 2.0, -1.0, 1.0))
        return bool(distance <= LATCH.reach and angle <= LATCH.turn)

    def _hold(self, i: int, model: mujoco.MjModel) -> None:
        """Write the pose of the unit in the end effector into a model."""
        position, rotation = self._unit_frame(i)
        hand = self._rotations[i, self._hand].reshape(3, 3)
        # Data of a weld: anchor (3), relative position (3), relative quaternion (4), torque scale.
        model.eq_data[self._weld, 3:6] = hand.T @ (position - self._positions[i, self._hand])
        mujoco.mju_mat2Quat(model.eq_data[self._weld, 6:10], (hand.T @ rotation).ravel())
