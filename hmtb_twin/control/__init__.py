"""From the stick to the joint commands: data acquisition board, hand controller, control modes, shutdown."""

from typing import TYPE_CHECKING

from hmtb_twin.files.lazy_names import lazy_names

if TYPE_CHECKING:
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

# a joint log needs the flags of a tick, and a reader of records need not load MuJoCo for them
__getattr__ = lazy_names(__name__, __file__)
