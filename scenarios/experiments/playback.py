"""Replay of logs, from a file or simulated on the spot, in MuJoCo's viewer."""

import os
import sys
from pathlib import Path
from time import perf_counter, sleep
from typing import Any

import mujoco
import numpy as np

from hmtb_twin import JOINTS, JointLog, load_arm, simulate
from hmtb_twin.arm.rendering import scene_model
from hmtb_twin.parameters.values import OPERATING_POSE
from scenarios.experiments.logged_arm import pictured_arm
from scenarios.experiments.registry import load
from scenarios.files.errors import ScenarioError

REFRESH = 1.0 / 60.0
"""Shortest time between two pictures, s."""


def load_or_simulate(name: str, *, seed: int | None = None, duration: float | None = None) -> JointLog:
    """Return a log by name.

    Args:
        name: A file that ends in `.nc`, else a registered scenario or a TOML file, which is simulated.
        seed: Draws other noise, for a scenario.
        duration: Length instead of the scenario's own, s.

    Raises:
        ScenarioError: There is no such scenario, a seed for a file, or the simulation failed.
        TwinError: The file is no joint log.
    """
    if name.endswith(".nc"):
        if seed is not None or duration is not None:
            raise ScenarioError(f"{name} is recorded: seed and duration belong to a scenario that is yet to run")
        return JointLog.load(Path(name))
    result = simulate([load(name, duration=duration, seed=seed)])
    for label, reason in result.failed.items():
        raise ScenarioError(f"{label}: {reason}")
    return result.logs[0]


def show(payload: str) -> None:
    """Open the viewer with the arm at the approach point and its servos on; returns when the window is closed.

    Raises:
        TwinError: Unknown payload.
        ScenarioError: No display.
    """
    arm = load_arm(payload=payload)
    viewer = _viewer()
    data = arm.rest(arm.pose(OPERATING_POSE))
    viewer.launch(arm.model, data)


def play(log: JointLog, *, speed: float = 1.0, loop: bool = False) -> None:
    """Play a log in the viewer; returns at its end, or when the window is closed.

    Args:
        log: The log.
        speed: Seconds of the experiment per second.
        loop: Whether to start again at the end.

    Raises:
        ScenarioError: No display.
    """
    viewer = _viewer()
    model = scene_model(pictured_arm(log))
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
            _pose(model, data, log, min(int(time / log.dt), len(log) - 1))
            window.sync()
            sleep(REFRESH)


def _pose(model: mujoco.MjModel, data: mujoco.MjData, log: JointLog, tick: int) -> None:
    data.time = tick * log.dt
    data.qpos[: len(JOINTS)] = log.true_angles[tick]
    if log.unit_pose is not None:
        data.qpos[len(JOINTS) : len(JOINTS) + 7] = np.asarray(log.unit_pose[tick])
    mujoco.mj_forward(model, data)


def check_display() -> None:
    """Raise `ScenarioError` where there is no display to open a window on, before any work is done for it."""
    if sys.platform == "linux" and not (os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY")):
        raise ScenarioError("no display here, so no window for the viewer; hmtb video makes films without one")


def _viewer() -> Any:
    check_display()
    import mujoco.viewer

    return mujoco.viewer
