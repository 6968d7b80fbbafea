"""The drives' equations as MuJoCo's callbacks, compiled once per process."""

from functools import cache
from threading import Lock
from typing import Any

import mujoco

from hmtb_twin.files.errors import TwinError
from hmtb_twin.hydraulics import valve_equations as eq
from hmtb_twin.hydraulics.struct_offsets import struct_offsets

_compiling = Lock()
"""The cache alone would let two threads compile, and MuJoCo takes one equation of each kind."""


def install_equations() -> tuple[Any, Any]:
    """Install the drives' equations as MuJoCo's callbacks, again if somebody has removed them.

    Without them MuJoCo simulates drives that never move, without a warning; therefore this is called wherever an arm is
    loaded or brought to rest.

    For `mjData.timer` MuJoCo reads a clock some twenty times per evaluation, a fifth of the processor time. Unless
    somebody has installed another one, it gets a clock that stands still, and `mjData.timer` stays at zero.

    Returns:
        The compiled functions, kept alive by a cache.

    Raises:
        TwinError: MuJoCo's structures are not recognised, or another callback is installed.
    """
    with _compiling:
        rates, bias, clock = _compiled()
    callbacks = (
        ("mjcb_act_dyn", mujoco.get_mjcb_act_dyn(), mujoco.set_mjcb_act_dyn, rates.ctypes),
        ("mjcb_act_bias", mujoco.get_mjcb_act_bias(), mujoco.set_mjcb_act_bias, bias.ctypes),
    )
    for name, present, _, ours in callbacks:
        if present is not None and present is not ours:
            raise TwinError(
                f"another callback is installed as MuJoCo's {name}; the arm's drives need it, and MuJoCo has one per "
                "process: remove it, or run the arm in a process of its own"
            )
    # Only after both have been checked: one callback without the other would give wrong physics without a warning.
    for _, present, install, ours in callbacks:
        if present is None:
            install(ours)
    if mujoco.get_mjcb_time() is None:
        mujoco.set_mjcb_time(clock.ctypes)
    return rates, bias


@cache
def _compiled() -> tuple[Any, Any, Any]:
    """Compile the callbacks, their machine code kept on disk where possible."""
    offsets = struct_offsets()
    try:
        return eq.compiled_callbacks(offsets)
    except RuntimeError:
        # Neither the folder of the package nor that of the user is writable.
        return eq.compiled_callbacks(offsets, cached=False)
