"""The controller's own model of an arm: Pinocchio on the same MJCF, never the plant itself."""

from collections.abc import Iterable
from functools import lru_cache
from pathlib import Path
from tempfile import TemporaryDirectory
from xml.etree import ElementTree

import numpy as np
import pinocchio as pin

from hmtb_twin.arm.rigid_bodies import write_controller_bodies
from hmtb_twin.arm_files.known_arms import arm_named
from hmtb_twin.parameters.arm_description import EARTH, ArmDescription
from hmtb_twin.parameters.resources import model_file


class ControllerModel:
    """Rigid-body model of the arm in the controller's computer.

    Args:
        mjcf: The model as MJCF text.
        gravity: Acceleration of gravity, m/s^2.
    """

    def __init__(self, mjcf: str, gravity: float = EARTH) -> None:
        with TemporaryDirectory() as folder:
            path = Path(folder, "arm.xml")
            path.write_text(mjcf, encoding="utf-8")
            self._model = pin.buildModelFromMJCF(str(path))
        self._model.gravity.linear = np.array([0.0, 0.0, -gravity])
        self._data = self._model.createData()
        # A joint or a link of the user's may have this name, too.
        self._tool = self._model.getFrameId("tool", pin.FrameType.OP_FRAME)

    def gravity_torque(self, angles: Iterable[np.ndarray]) -> np.ndarray:
        """Return the torque that holds the arm at each pose.

        Args:
            angles: Poses, each (7,), rad.

        Returns:
            Torques (n, 7), N m.
        """
        model, data = self._model, self._data
        # Pinocchio overwrites its result in place: copy each.
        return np.array([pin.computeGeneralizedGravity(model, data, q).copy() for q in angles])

    def gravity_gradient(self, angles: np.ndarray) -> np.ndarray:
        """Return how the holding torques change with the pose (7,), shape (7, 7), N m/rad."""
        return np.array(pin.computeGeneralizedGravityDerivatives(self._model, self._data, np.asarray(angles, float)))

    def inertia_matrix(self, angles: np.ndarray) -> np.ndarray:
        """Return the joint-space inertia matrix at a pose (7,), shape (7, 7), kg m^2."""
        upper = np.triu(pin.crba(self._model, self._data, np.asarray(angles, float)))
        return upper + np.triu(upper, 1).T

    def tool_pose(self, angles: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return where the tool is at a pose.

        Args:
            angles: Joint angles (7,), rad.

        Returns:
            Position (3,), m, and rotation (3, 3) of the tool frame, both in the world: `p = position + rotation @ x`.
        """
        pin.forwardKinematics(self._model, self._data, np.asarray(angles, float))
        placement = pin.updateFramePlacement(self._model, self._data, self._tool)
        # Pinocchio returns views that the next call overwrites.
        return placement.translation.copy(), placement.rotation.copy()

    def tool_jacobian(self, angles: np.ndarray) -> np.ndarray:
        """Return how the tool moves with the joints, in its own frame.

        Args:
            angles: Joint angles (7,), rad.

        Returns:
            Jacobian (6, 7): rows 0-2 linear velocity, m/rad, rows 3-5 angular velocity, rad/rad, both along the axes of
            the tool frame.
        """
        jacobian = pin.computeFrameJacobian(
            self._model, self._data, np.asarray(angles, float), self._tool, pin.ReferenceFrame.LOCAL
        )
        return np.array(jacobian)

    def tool_path(self, angles: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return where the tool was along a record of joint angles.

        Args:
            angles: Joint angles (N, 7), rad.

        Returns:
            Positions (N, 3), m, and rotations (N, 3, 3) of the tool frame in the world.
        """
        angles = np.asarray(angles, float)
        positions, rotations = np.empty((len(angles), 3)), np.empty((len(angles), 3, 3))
        model, data, tool = self._model, self._data, self._tool
        for q, position, rotation in zip(angles, positions, rotations, strict=True):
            pin.forwardKinematics(model, data, q)
            placement = pin.updateFramePlacement(model, data, tool)
            position[:], rotation[:] = placement.translation, placement.rotation
        return positions, rotations


def controller_model(payload: str, variant: str = "nominal") -> ControllerModel:
    """Return the controller's model of an arm with a payload, both by name; see `model_of_controller`."""
    return model_of_controller(payload, arm_named(variant))


@lru_cache(maxsize=16)
def model_of_controller(payload: str, arm: ArmDescription) -> ControllerModel:
    """Return the controller's model of an arm with a payload, built once.

    Args:
        payload: Name of a payload of the arm.
        arm: The arm.

    Returns:
        The model, of the same MJCF as the plant; its arithmetic is shared and must not be used by several threads.
    """
    mjcf = model_file("hmtb/hmtb.xml").read_text(encoding="utf-8") if arm.rigid is None else arm.rigid.mjcf
    root = ElementTree.fromstring(mjcf)
    write_controller_bodies(root, arm, payload)
    return ControllerModel(ElementTree.tostring(root, encoding="unicode"), arm.gravity)
