"""The laboratory: arm, hydraulics, servos, hand controller, recorder; and the truth about them."""

from hmtb_twin.arm.arm import Arm, load_arm
from hmtb_twin.arm.rendering import render
from hmtb_twin.bus.faults import BusFaults
from hmtb_twin.bus.joint_log import JointLog
from hmtb_twin.bus.record import BusRecord
from hmtb_twin.bus.recorder_run import BusRun, read_run, record_run
from hmtb_twin.control.chain import IDEAL, Chain
from hmtb_twin.control.experiment import Experiment, Motion, Operator, UnitView, View
from hmtb_twin.control.modes import MODES, axis_names
from hmtb_twin.control.status import Status
from hmtb_twin.parameters.errors import OverloadError, TwinError, TwinWarning
from hmtb_twin.parameters.payloads import PAYLOADS
from hmtb_twin.parameters.plant import NOMINAL_PLANT, Plant
from hmtb_twin.parameters.specimen import NOMINAL_SPECIMEN, Specimen
from hmtb_twin.parameters.specimen_draw import Distribution, TwinDistributions, drawn
from hmtb_twin.parameters.values import JOINTS, POSES, STUDIED_JOINTS, HandController
from hmtb_twin.parameters.variants import VARIANTS, Variant
from hmtb_twin.run.simulation import Logs, simulate
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
    "STUDIED_JOINTS",
    "VARIANTS",
    "Arm",
    "BusFaults",
    "BusRecord",
    "BusRun",
    "Chain",
    "Distribution",
    "Experiment",
    "HandController",
    "JointLog",
    "JointTruth",
    "Logs",
    "Motion",
    "Operator",
    "OverloadError",
    "Plant",
    "Specimen",
    "Status",
    "Truth",
    "TwinDistributions",
    "TwinError",
    "TwinWarning",
    "UnitView",
    "Variant",
    "View",
    "axis_names",
    "drawn",
    "linearize",
    "load_arm",
    "read_run",
    "record_run",
    "render",
    "simulate",
]
