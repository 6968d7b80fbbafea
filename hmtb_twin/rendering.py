"""Pictures of the arm at its worksite."""

import os
import sys
from typing import Any

import mujoco
import numpy as np

from hmtb_twin.arm import Arm
from hmtb_twin.errors import TwinError
from hmtb_twin.parameters import JOINTS, OPERATING_POSE
from hmtb_twin.resources import model_file

NO_OPENGL = (
    "no OpenGL here, so no picture of the arm; on Debian or Ubuntu install libegl1 and libgl1-mesa-dri or a display"
)
"""What to do where MuJoCo cannot render."""


def render(
    arm: Arm,
    camera: str = "overview",
    width: int = 960,
    height: int = 720,
    *,
    angles: np.ndarray | None = None,
) -> np.ndarray:
    """Render the arm at its worksite.

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
    spec = mujoco.MjSpec.from_file(str(model_file("hmtb/scene.xml")))
    if arm.payload == "none":
        spec.delete(spec.body("rpcm"))
    model = spec.compile()
    cameras = [model.camera(i).name for i in range(model.ncam)]
    if camera not in cameras:
        raise TwinError(f"unknown camera {camera!r}, available: {', '.join(cameras)}")
    data = mujoco.MjData(model)
    data.qpos[: len(JOINTS)] = arm.pose(OPERATING_POSE) if angles is None else angles
    mujoco.mj_forward(model, data)
    try:
        context = _opengl_context(width, height)
    except (ImportError, AttributeError, OSError, RuntimeError) as error:
        raise TwinError(NO_OPENGL) from error
    context.make_current()
    try:
        return _draw(model, data, model.camera(camera).id, width, height)
    except mujoco.FatalError as error:
        raise TwinError(NO_OPENGL) from error
    finally:
        context.free()


def _opengl_context(width: int, height: int) -> Any:
    """Open an off-screen context, without a window system where there is none."""
    if sys.platform == "linux" and not os.environ.get("DISPLAY"):
        # MuJoCo chooses its back end from MUJOCO_GL when it is imported, which is long past.
        from mujoco.egl import GLContext
    else:
        from mujoco import GLContext
    return GLContext(width, height)


def _draw(model: mujoco.MjModel, data: mujoco.MjData, camera: int, width: int, height: int) -> np.ndarray:
    view = mujoco.MjvCamera()
    view.type, view.fixedcamid = mujoco.mjtCamera.mjCAMERA_FIXED, camera
    scene = mujoco.MjvScene(model, maxgeom=1000)
    mujoco.mjv_updateScene(model, data, mujoco.MjvOption(), None, view, mujoco.mjtCatBit.mjCAT_ALL, scene)
    renderer = mujoco.MjrContext(model, mujoco.mjtFontScale.mjFONTSCALE_100)
    mujoco.mjr_setBuffer(mujoco.mjtFramebuffer.mjFB_OFFSCREEN, renderer)
    window = mujoco.MjrRect(0, 0, width, height)
    picture = np.empty((height, width, 3), dtype=np.uint8)
    mujoco.mjr_render(window, scene, renderer)
    mujoco.mjr_readPixels(picture, None, window, renderer)
    renderer.free()
    return picture[::-1].copy()
