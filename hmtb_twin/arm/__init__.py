"""The arm as MuJoCo simulates it, the controller's own model of it, and pictures of it."""

from hmtb_twin.arm.arm import Arm, load_arm
from hmtb_twin.arm.controller_model import ControllerModel
from hmtb_twin.arm.rendering import Stage, render

__all__ = ["Arm", "ControllerModel", "Stage", "load_arm", "render"]
