"""Parameters of the arm and its surroundings, with units and sources, and how single arms differ from them."""

from hmtb_twin.files.errors import TwinError
from hmtb_twin.parameters.arm_description import ArmDescription
from hmtb_twin.parameters.plant import Plant
from hmtb_twin.parameters.specimen import Specimen
from hmtb_twin.parameters.specimen_draw import Distribution, TwinDistributions, draw_specimen
from hmtb_twin.parameters.values import HandController

__all__ = [
    "ArmDescription",
    "Distribution",
    "HandController",
    "Plant",
    "Specimen",
    "TwinDistributions",
    "TwinError",
    "draw_specimen",
]
