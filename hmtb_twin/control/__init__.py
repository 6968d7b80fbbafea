"""From the stick to the joint commands: data acquisition board, hand controller, control modes, shutdown."""

from hmtb_twin.control.control_station import ControlStation
from hmtb_twin.control.data_acquisition import DataAcquisitionBoard
from hmtb_twin.control.experiment import Chain, Experiment, Operator, Status
from hmtb_twin.control.hand_controller import HandControllerInterface
from hmtb_twin.control.modes import MODES

__all__ = [
    "MODES",
    "Chain",
    "ControlStation",
    "DataAcquisitionBoard",
    "Experiment",
    "HandControllerInterface",
    "Operator",
    "Status",
]
