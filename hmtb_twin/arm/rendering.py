"""Pictures of the arm at its worksite."""

import os
import sys
from copy import copy
from types import TracebackType
from typing import Any

import mujoco
import numpy as np

from hmtb_twin.arm.arm import Arm
from hmtb_twin.arm.arm_scene import arm_scene, pose_scene
from hmtb_twin.arm.rigid_bodies import spec_of_test_bed, write_bodies
from hmtb_twin.files.errors import TwinError

NO_OPENGL = (
    "no OpenGL here, so no picture of the arm; on Debian or Ubuntu install libegl1 and libgl1-mesa-dri or a display"
)
"""Advice where MuJoCo cannot render."""

LARGEST = 4096
"""Largest width or height of a picture, pixels."""


def scene_model(arm: Arm) -> mujoco.MjModel:
    """Return the arm with the worksite round it, which an arm at the worksite has already; its joints are first."""
    if arm.worksite:
        return arm.model
    if arm.description.rigid is not None:
        return arm_scene(arm)
    # A picture needs angles only.
    spec = spec_of_test_bed("scene.xml")
    write_bodies(spec, arm.description, arm.payload, arm.specimen)
    return spec.compile()


class Stage:
    """The worksite, lit and ready for pictures; a context that frees the graphics when it ends.

    Args:
        arm: The arm; its payload is shown or left out.
        width: Pixels.
        height: Pixels.
        draft: Whether shadows and curved surfaces may be coarse and the floor dull, for two fifths of the time.

    Raises:
        TwinError: A size that no picture has, or this machine has no OpenGL; the message says what to install.
    """

    def __init__(self, arm: Arm, width: int = 960, height: int = 720, *, draft: bool = False) -> None:
        if not (16 <= width <= LARGEST and 16 <= height <= LARGEST):
            raise TwinError(f"a picture of {width} x {height} pixels given, expected 16 to {LARGEST} each way")
        self._model, self._arm = copy(scene_model(arm)), arm
        self._data = mujoco.MjData(self._model)
        self._model.vis.global_.offwidth, self._model.vis.global_.offheight = width, height
        # Near the edge of the shadow map, floor that the lamp grazes is speckled: the edge lies outside the views.
        self._model.vis.map.shadowscale = 0.8
        if draft:
            quality = self._model.vis.quality
            quality.shadowsize, quality.numslices, quality.numstacks, quality.numquads = 1024, 24, 8, 2
        self._window = mujoco.MjrRect(0, 0, width, height)
        self.cameras = tuple(self._model.camera(i).name for i in range(self._model.ncam))
        try:
            self._context = _opengl_context(width, height)
            self._context.make_current()
            self._scene = mujoco.MjvScene(self._model, maxgeom=1000)
            self._scene.flags[mujoco.mjtRndFlag.mjRND_REFLECTION] = not draft
            self._renderer = mujoco.MjrContext(self._model, mujoco.mjtFontScale.mjFONTSCALE_100)
            mujoco.mjr_setBuffer(mujoco.mjtFramebuffer.mjFB_OFFSCREEN, self._renderer)
        except (ImportError, AttributeError, OSError, RuntimeError, mujoco.FatalError) as error:
            raise TwinError(NO_OPENGL) from error

    def __enter__(self) -> "Stage":
        """Return the stage, ready to render."""
        return self

    def __exit__(
        self, error_type: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Free the graphics."""
        self._renderer.free()
        self._context.free()

    def picture(self, camera: str, angles: np.ndarray, unit: np.ndarray | None = None) -> np.ndarray:
        """Render one picture.

        Args:
            camera: One of `cameras`.
            angles: Joint angles (7,), rad.
            unit: Pose of the replacement unit of an arm at the worksite, position in m and quaternion (7,).

        Returns:
            Picture (height, width, 3), 8-bit RGB.

        Raises:
            TwinError: There is no such camera.
        """
        if camera not in self.cameras:
            raise TwinError(f"unknown camera {camera!r}, available: {', '.join(self.cameras)}")
        if unit is not None:
            n = len(angles)
            self._data.qpos[n : n + len(unit)] = unit
        pose_scene(self._model, self._data, self._arm, angles)
        mujoco.mj_camlight(self._model, self._data)
        view = mujoco.MjvCamera()
        view.type, view.fixedcamid = mujoco.mjtCamera.mjCAMERA_FIXED, self._model.camera(camera).id
        mujoco.mjv_updateScene(
            self._model, self._data, mujoco.MjvOption(), None, view, mujoco.mjtCatBit.mjCAT_ALL, self._scene
        )
        picture = np.empty((self._window.height, self._window.width, 3), dtype=np.uint8)
        mujoco.mjr_render(self._window, self._scene, self._renderer)
        mujoco.mjr_readPixels(picture, None, self._window, self._renderer)
        # OpenGL counts rows from below.
        return picture[::-1].copy()


def render(
    arm: Arm,
    camera: str = "overview",
    width: int = 960,
    height: int = 720,
    *,
    angles: np.ndarray | None = None,
) -> np.ndarray:
    """Render one picture of the arm at its worksite.

    Args:
        arm: The arm; its payload is shown or left out.
        camera: One of the scene's cameras.
        width: Pixels.
        height: Pixels.
        angles: Joint angles (7,), rad; the operating pose by default.

    Returns:
        Picture (height, width, 3), 8-bit RGB.

    Raises:
        TwinError: There is no such camera, or this machine has no OpenGL; the message says what to install.
    """
    if angles is None:
        angles = arm.pose(arm.description.operating_pose)
    with Stage(arm, width, height) as stage:
        return stage.picture(camera, angles)


def _opengl_context(width: int, height: int) -> Any:
    """Open an off-screen context, without a window system where there is none."""
    if sys.platform == "linux" and not os.environ.get("DISPLAY"):
        # MuJoCo chooses its back end from MUJOCO_GL when it is imported, which is long past.
        from mujoco.egl import GLContext
    else:
        from mujoco import GLContext
    return GLContext(width, height)
