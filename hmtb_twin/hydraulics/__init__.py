"""Servo valves with square-root orifices as MuJoCo user dynamics, and the equilibrium of arms at rest."""

from importlib import import_module
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from hmtb_twin.hydraulics.orifice import add_orifice_actuators, install_valve_equations, settled_arm

__all__ = ["add_orifice_actuators", "install_valve_equations", "settled_arm"]


def __getattr__(name: str) -> object:
    # Numba, which compiles the equations, takes a second to load, and only servo valves need it.
    if name not in __all__:
        raise AttributeError(f"module 'hmtb_twin.hydraulics' has no attribute {name!r}")
    return getattr(import_module("hmtb_twin.hydraulics.orifice"), name)
