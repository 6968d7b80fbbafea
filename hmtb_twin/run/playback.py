"""Logs to look at: frame by frame for films, and played in MuJoCo's viewer."""

from collections.abc import Iterator, Sequence
from functools import cache
from math import ceil
from time import perf_counter, sleep
from typing import TYPE_CHECKING, Any, cast

import mujoco
import numpy as np

from hmtb_twin.arm.arm import Arm, load_arm
from hmtb_twin.arm.arm_scene import pose_scene
from hmtb_twin.arm.rendering import Stage, scene_model
from hmtb_twin.bus.joint_log import JointLog
from hmtb_twin.bus.record import BusRecord
from hmtb_twin.files.errors import TwinError
from hmtb_twin.parameters.values import SAMPLE_TIME

if TYPE_CHECKING:
    from PIL.ImageFont import FreeTypeFont

MOST_FRAMES = 1_000_000
"""Largest number of frames: more are a typing error."""


def pictured_arm(log: JointLog) -> Arm:
    """Return an arm that looks like that of a log, whatever its drives; nominal where the log has no provenance."""
    return load_arm(
        log.provenance.get("variant", "nominal"),
        log.provenance.get("payload"),
        worksite=log.unit_pose is not None,
    )


def pictured_log(record: BusRecord) -> JointLog:
    """Return a log that looks like a bus record: the arm follows the measured angles, and lost values are held.

    Raises:
        TwinError: All values of a channel were lost, or samples are not those of the bus.
    """
    if not len(record) or abs(record.dt - SAMPLE_TIME) > 1e-9:
        raise TwinError(f"{record.name}: {len(record)} samples every {record.dt:g} s given, expected {SAMPLE_TIME} s")
    command, angles, wrench = map(_held, (record.commanded, record.measured, record.wrench))
    if not all(np.isfinite(values).all() for values in (command, angles, wrench)):
        raise TwinError(f"{record.name}: all values of a channel were lost; there is nothing to replay")
    # What the bus does not carry shows nothing: no volts, no pressures.
    volts, status = np.zeros((len(record), len(record.axes))), np.nan_to_num(record.status).astype(int)
    unknown = np.zeros_like(angles)
    return JointLog(
        record.name, 0, record.dt, record.axes, command, angles, wrench, angles, unknown, volts, volts, status
    )


def _held(values: np.ndarray) -> np.ndarray:
    """Replace each NaN of values (N, n) by the last number before it, or by the first number of its column."""
    finite, columns = np.isfinite(values), np.arange(values.shape[1])
    last = np.maximum.accumulate(np.where(finite, np.arange(len(values))[:, None], -1), axis=0)
    return np.asarray(values[np.where(last < 0, finite.argmax(axis=0), last), columns])


def frame_times(span: tuple[float, float], *, rate: float, speed: float = 1.0) -> np.ndarray:
    """Return the times at which a film shows an experiment.

    Args:
        span: First and last time to show, s.
        rate: Frames per second of film.
        speed: Seconds of the experiment per second of film.

    Returns:
        Times (N,), s.

    Raises:
        TwinError: Too many frames.
    """
    first, last = span
    # A quotient such as 2.9999999999 is a whole number that rounding has spoilt.
    count = int((last - first) / speed * rate + 1e-9) + 1
    if count > MOST_FRAMES:
        raise TwinError(f"{count} frames requested, expected at most {MOST_FRAMES}; play it faster, or show less of it")
    return first + np.arange(count) * speed / rate


def frames(log: JointLog, cameras: Sequence[str], *, size: tuple[int, int], times: np.ndarray) -> Iterator[np.ndarray]:
    """Render a log frame by frame; several views are named.

    Args:
        log: The log.
        cameras: Views, side by side; four of them as two rows of two.
        size: Width and height of each view, pixels.
        times: Times to show (N,), s.

    Yields:
        Pictures (height, width, 3), 8-bit RGB.
    """
    width, height = size
    columns = len(cameras) if len(cameras) < 4 else ceil(len(cameras) / 2)
    rows = ceil(len(cameras) / columns)
    # A thirty-sixth of the picture's height; smaller letters than 12 pixels are illegible.
    font_size = max(12, rows * height // 36)
    labels = []
    if len(cameras) > 1:
        labels = [_label(camera.replace("_", " "), font_size) for camera in cameras]
    with Stage(pictured_arm(log), width, height, draft=len(times) > 1) as stage:
        for time in times:
            tick = min(round(time / log.dt), len(log) - 1)
            unit = None if log.unit_pose is None else log.unit_pose[tick]
            picture = np.zeros((rows * height, columns * width, 3), np.uint8)
            panes = []
            for index, camera in enumerate(cameras):
                row, column = divmod(index, columns)
                pane = picture[row * height :, column * width :][:height, :width]
                pane[:] = stage.picture(camera, log.true_angles[tick], unit)
                panes.append(pane)
            # A single view needs no label.
            for pane, label in zip(panes, labels, strict=False):
                _put(pane[-len(label) :], label)
            force = f"wrist {np.linalg.norm(log.wrench[tick, :3]):5.1f} N"
            _put(picture, _label(f"{log.name}   {tick * log.dt:6.2f} s   {force}", font_size))
            yield picture


def play(log: JointLog, viewer: Any, *, speed: float = 1.0, loop: bool = False) -> None:
    """Play a log in the viewer; returns at its end, or when the window is closed.

    Args:
        log: The log.
        viewer: The module `mujoco.viewer`, which needs a display.
        speed: Seconds of the experiment per second.
        loop: Whether to start again at the end.
    """
    arm = pictured_arm(log)
    model = scene_model(arm)
    data = mujoco.MjData(model)
    with viewer.launch_passive(model, data, show_left_ui=False, show_right_ui=False) as window:
        with window.lock():
            mujoco.mjv_defaultFreeCamera(model, window.cam)
        start = perf_counter()
        while window.is_running():
            time = (perf_counter() - start) * speed
            if time > len(log) * log.dt:
                if not loop:
                    return
                start, time = perf_counter(), 0.0
            tick = min(int(time / log.dt), len(log) - 1)
            # The viewer shows this time; nothing is simulated.
            data.time = tick * log.dt
            if log.unit_pose is not None:
                n = len(log.joints)
                data.qpos[n : n + 7] = np.asarray(log.unit_pose[tick])
            pose_scene(model, data, arm, log.true_angles[tick])
            mujoco.mj_forward(model, data)
            window.sync()
            sleep(1.0 / 60.0)  # the rate of most displays


def _label(text: str, size: int) -> np.ndarray:
    """White text on black, which is legible on any picture."""
    from PIL import Image, ImageDraw

    font = _font(size)
    image = Image.new("RGB", (round(font.getlength(text)) + size, round(1.6 * size)))
    ImageDraw.Draw(image).text((size / 2, size / 4), text, fill=(255, 255, 255), font=font)
    return np.asarray(image)


@cache
def _font(size: int) -> "FreeTypeFont":
    from PIL import ImageFont

    return cast("FreeTypeFont", ImageFont.load_default(size=size))


def _put(picture: np.ndarray, label: np.ndarray) -> None:
    """Copy as much of a label as fits into the upper left corner."""
    height, width = np.minimum(picture.shape[:2], label.shape[:2])
    picture[:height, :width] = label[:height, :width]
