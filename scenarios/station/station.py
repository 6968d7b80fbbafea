"""The station: a page with the arm and five tabs, steered by one browser and watched by any others."""

import threading
import warnings
from pathlib import Path
from time import sleep
from typing import TYPE_CHECKING, Any

from hmtb_twin import VARIANTS, load_arm
from hmtb_twin.run.live_motion import Motion
from scenarios.experiments.registry import load, tests_of
from scenarios.jobs.work import Work
from scenarios.station.desk import Desk
from scenarios.station.drive_tab import DriveTab
from scenarios.station.experiment_tab import ExperimentTab
from scenarios.station.identify_tab import IdentifyTab
from scenarios.station.scene import Scene
from scenarios.station.server import close_server, open_server
from scenarios.station.session import Session
from scenarios.station.study_tab import StudyTab
from scenarios.station.waveform_tab import WaveformTab

if TYPE_CHECKING:
    import viser

FIRST_SCENARIO = "siso-5-elbow_pitch"
"""The experiment that a new station of the test bed has prepared."""

FIRST_CAMERA = "overview"
"""The camera that a new browser looks through."""

PANEL = 480
"""Width of the tabs, pixels: 800 remain for the arm on a small screen."""


TABS: tuple[Any, ...] = (WaveformTab, ExperimentTab, DriveTab, IdentifyTab, StudyTab)
"""The tabs from left to right, in the order of the work."""


class Station(Desk):
    """Server, scene, session and tabs of one station.

    Args:
        folder: Where files are written.
        port: Port on the loopback address; 0 takes a free one.
        arm: The arm that is operated, by name or by the path of its files.

    Raises:
        ScenarioError: viser is not installed, the port is taken, or there is no such arm.
    """

    def __init__(self, folder: Path, port: int = 0, arm: str = "nominal") -> None:
        # Of another machine its first test: a binary sequence on its first joint.
        first = FIRST_SCENARIO if arm in VARIANTS else next(iter(tests_of(arm)))
        # A browser that leaves while something is sent to it is no news for the terminal.
        warnings.filterwarnings("ignore", message="Queued a .* on a closed connection")
        server, session = open_server(port), Session(folder, load(first, arm=arm), arm=arm)
        scene = Scene(server, load_arm(session.scenario.variant, session.scenario.payload))
        super().__init__(server, session, scene, Motion(scene.show), Work())
        # Browsers come and go in threads of their own.
        self._lock = threading.RLock()
        self._operator: int | None = None
        self.server.gui.configure_theme(show_logo=False, show_share_button=False)
        self.server.gui.main_panel.dock_right()
        self.server.gui.main_panel.set_width(PANEL)
        self.server.on_client_connect(self._joined)
        self.server.on_client_disconnect(self._left)

    @property
    def address(self) -> str:
        """Address of the page."""
        return f"http://{self.server.get_host()}:{self.server.get_port()}"

    def wait(self) -> None:
        """Serve until the keyboard interrupts."""
        while True:
            # The server works in threads of its own.
            sleep(1.0)

    def close(self) -> None:
        """Stop whatever runs, and the server."""
        self.motion.stop()
        self.work.close()
        close_server(self.server)

    def _joined(self, client: "viser.ClientHandle") -> None:
        self.scene.look_through(client, FIRST_CAMERA)
        self._build_view(client)
        with self._lock:
            if self._operator is None:
                self._operator = client.client_id
                self._build(client)
            else:
                client.gui.add_markdown(
                    "**You watch.** Another browser steers this station; when it leaves, you steer."
                )

    def _build_view(self, client: "viser.ClientHandle") -> None:
        """Build what every browser has for itself: its eye on the arm, and its colours."""
        gui = client.gui
        with gui.add_folder("View", expand_by_default=False):
            camera = gui.add_dropdown("camera", self.scene.cameras, initial_value=FIRST_CAMERA)
            camera.on_update(lambda _: self.scene.look_through(client, camera.value))
            ghost = gui.add_checkbox("ghost of the command", True)
            ghost.on_update(lambda _: self.scene.show_ghost(visible=ghost.value))
            dark = gui.add_checkbox("dark", False)
            dark.on_update(
                lambda _: gui.configure_theme(dark_mode=dark.value, show_logo=False, show_share_button=False)
            )

    def _left(self, client: "viser.ClientHandle") -> None:
        with self._lock:
            if client.client_id != self._operator:
                return
            self._operator = None
            self.session.forget_watchers()
            # The browser that has watched for longest takes over.
            for watcher in self.server.get_clients().values():
                self._operator = watcher.client_id
                # Also removes the line by which this browser only watches.
                watcher.gui.reset()
                self._build_view(watcher)
                self._build(watcher)
                return

    def _build(self, client: "viser.ClientHandle") -> None:
        """Build the tabs in the browser that controls the station; the session restores earlier entries."""
        self.session.forget_watchers()
        tabs = client.gui.add_tab_group()
        for tab in TABS:
            with tabs.add_tab(tab.title):
                tab(self, client)
