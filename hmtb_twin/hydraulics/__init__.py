"""Drives as MuJoCo user dynamics, and the equilibrium of arms at rest."""

from hmtb_twin.hydraulics.callbacks import install_equations
from hmtb_twin.hydraulics.drive_actuators import add_linear_drives, add_orifice_actuators
from hmtb_twin.hydraulics.valve_equilibrium import settled_arm

__all__ = ["add_linear_drives", "add_orifice_actuators", "install_equations", "settled_arm"]
