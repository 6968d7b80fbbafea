"""The operator's station: a page in the browser with the arm, from the waveform to the verdict."""

from typing import TYPE_CHECKING

from hmtb_twin.files.lazy_names import lazy_names

if TYPE_CHECKING:
    from scenarios.station.server import open_server
    from scenarios.station.session import Session
    from scenarios.station.station import Station

__all__ = ["Session", "Station", "open_server"]

__getattr__ = lazy_names(__name__, __file__)
