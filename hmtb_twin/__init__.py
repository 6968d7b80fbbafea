"""The laboratory: arm, hydraulics, servos, hand controller, recorder; and the truth about them."""

from hmtb_twin.arm import Arm, load_arm
from hmtb_twin.bus_faults import BusFaults
from hmtb_twin.bus_record import BusRecord
from hmtb_twin.bus_run import BusRun, read_run, record_run
from hmtb_twin.chain import IDEAL, Chain
from hmtb_twin.errors import OverloadError, TwinError, TwinWarning
from hmtb_twin.experiment import Experiment, Motion, Operator, UnitView, View
from hmtb_twin.joint_log import JointLog
from hmtb_twin.linearization import linearize
from hmtb_twin.modes import MODES, axis_names
from hmtb_twin.parameters import JOINTS, POSES, STUDIED_JOINTS, HandController
from hmtb_twin.payloads import PAYLOADS
from hmtb_twin.plant import NOMINAL_PLANT, Plant
from hmtb_twin.rendering import render
from hmtb_twin.simulation import Logs, simulate
from hmtb_twin.specimen import NOMINAL_SPECIMEN, Specimen
from hmtb_twin.specimen_draw import Distribution, TwinDistributions, drawn
from hmtb_twin.status import Status
from hmtb_twin.truth import JointTruth, Truth
from hmtb_twin.variants import VARIANTS, Variant

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
