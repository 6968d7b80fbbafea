"""What every tab of the station works with: the page's server, the session, the arm, what moves it, and long work."""

from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING

from hmtb_twin.run.live_motion import Motion
from scenarios.identification.identified_models import IdentifiedModels
from scenarios.jobs.work import Work
from scenarios.station.scene import Scene
from scenarios.station.session import Session

if TYPE_CHECKING:
    import viser


@dataclass
class Desk:
    """What every tab works with; it outlives the browsers.

    Attributes:
        server: The page's server.
        session: What the tabs share.
        scene: The arm.
        motion: What moves it.
        work: Long computations.
        identified: Models identified so far.
    """

    server: "viser.ViserServer"
    session: Session
    scene: Scene
    motion: Motion
    work: Work
    identified: IdentifiedModels = field(init=False)

    def __post_init__(self) -> None:
        self.identified = IdentifiedModels(self.work, self.session.tell)

    def save(self, name: str, client: "viser.ClientHandle") -> Path:
        """Write a record of the session into its folder, tell the browser where, and return the file."""
        path = self.session.file_of(name)
        self.session.tell()  # the tab Study lists the file
        client.add_notification("Saved", str(path), color="green", auto_close_seconds=8.0)
        return path
