"""The laboratory: arm, hydraulics, servos, hand controller and recorder, and the truth about them."""

from importlib import import_module
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from hmtb_twin.arm.arm import Arm, load_arm
    from hmtb_twin.arm.rendering import render
    from hmtb_twin.bus.joint_log import JointLog
    from hmtb_twin.control.experiment import IDEAL, Chain, Experiment, Motion, Operator, PayloadChange, Status, View
    from hmtb_twin.control.modes import MODES
    from hmtb_twin.files.errors import OverloadError, TwinError, TwinWarning
    from hmtb_twin.parameters.payloads import PAYLOADS
    from hmtb_twin.parameters.plant import NOMINAL_PLANT, Plant
    from hmtb_twin.parameters.specimen import NOMINAL_SPECIMEN, Specimen
    from hmtb_twin.parameters.values import JOINTS, POSES, SAMPLE_RATE, SAMPLE_TIME, STUDIED_JOINTS, HandController
    from hmtb_twin.parameters.variants import VARIANTS
    from hmtb_twin.run.simulation import simulate
    from hmtb_twin.truth.linearization import linearize
    from hmtb_twin.truth.truth import JointTruth, Truth

__all__ = [
    "IDEAL",
    "JOINTS",
    "MODES",
    "NOMINAL_PLANT",
    "NOMINAL_SPECIMEN",
    "PAYLOADS",
    "POSES",
    "SAMPLE_RATE",
    "SAMPLE_TIME",
    "STUDIED_JOINTS",
    "VARIANTS",
    "Arm",
    "Chain",
    "Experiment",
    "HandController",
    "JointLog",
    "JointTruth",
    "Motion",
    "Operator",
    "OverloadError",
    "PayloadChange",
    "Plant",
    "Specimen",
    "Status",
    "Truth",
    "TwinError",
    "TwinWarning",
    "View",
    "linearize",
    "load_arm",
    "render",
    "simulate",
]

_NAMES = {
    "arm.arm": ("Arm", "load_arm"),
    "arm.rendering": ("render",),
    "bus.joint_log": ("JointLog",),
    "control.experiment": ("IDEAL", "Chain", "Experiment", "Motion", "Operator", "PayloadChange", "Status", "View"),
    "control.modes": ("MODES",),
    "files.errors": ("OverloadError", "TwinError", "TwinWarning"),
    "parameters.payloads": ("PAYLOADS",),
    "parameters.plant": ("NOMINAL_PLANT", "Plant"),
    "parameters.specimen": ("NOMINAL_SPECIMEN", "Specimen"),
    "parameters.values": ("JOINTS", "POSES", "SAMPLE_RATE", "SAMPLE_TIME", "STUDIED_JOINTS", "HandController"),
    "parameters.variants": ("VARIANTS",),
    "run.simulation": ("simulate",),
    "truth.linearization": ("linearize",),
    "truth.truth": ("JointTruth", "Truth"),
}
_MODULES = {name: module for module, names in _NAMES.items() for name in names}


def __getattr__(name: str) -> object:
    # MuJoCo and Pinocchio take a second to load; whoever needs only a sampling time or an error does not wait for them.
    if name not in _MODULES:
        raise AttributeError(f"module 'hmtb_twin' has no attribute {name!r}")
    return getattr(import_module(f"hmtb_twin.{_MODULES[name]}"), name)
