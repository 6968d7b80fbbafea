"""The laboratory: arm, hydraulics, servos, hand controller and recorder, and the truth about them."""

from typing import TYPE_CHECKING

from hmtb_twin.files.lazy_names import lazy_names

if TYPE_CHECKING:
    from hmtb_twin.arm.arm import Arm, load_arm
    from hmtb_twin.arm.rendering import render
    from hmtb_twin.bus.joint_log import JointLog
    from hmtb_twin.control.experiment import IDEAL, Chain, Experiment, Motion, Operator, PayloadChange, Status, View
    from hmtb_twin.control.modes import MODES
    from hmtb_twin.files.errors import OverloadError, TwinError, TwinWarning
    from hmtb_twin.parameters.payloads import Load
    from hmtb_twin.parameters.plant import NOMINAL_PLANT, Plant
    from hmtb_twin.parameters.specimen import NOMINAL_SPECIMEN, Specimen
    from hmtb_twin.parameters.values import SAMPLE_RATE, SAMPLE_TIME, HandController
    from hmtb_twin.parameters.variants import JOINTS, PAYLOADS, POSES, STUDIED_JOINTS, VARIANTS
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
    "Load",
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

# MuJoCo and Pinocchio take a second to load; whoever needs only a sampling time or an error does not wait for them
__getattr__ = lazy_names(__name__, __file__)
