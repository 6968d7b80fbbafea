"""From the stick to the joint commands: data acquisition board, hand controller, control modes, shutdown."""

from importlib import import_module
from typing import TYPE_CHECKING

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

_MODULES = {
    "MODES": "modes",
    "Chain": "experiment",
    "ControlStation": "control_station",
    "DataAcquisitionBoard": "data_acquisition",
    "Experiment": "experiment",
    "HandControllerInterface": "hand_controller",
    "Operator": "experiment",
    "Status": "experiment",
}


def __getattr__(name: str) -> object:
    # a joint log needs the flags of a tick, and a reader of records need not load MuJoCo for them
    if name not in _MODULES:
        raise AttributeError(f"module 'hmtb_twin.control' has no attribute {name!r}")
    return getattr(import_module(f"hmtb_twin.control.{_MODULES[name]}"), name)
