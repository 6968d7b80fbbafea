"""The Drive tab: the arm in the hands of whoever looks at it, and the record of the drive."""

import threading
from collections.abc import Callable
from dataclasses import replace
from itertools import count
from pathlib import Path
from time import perf_counter
from typing import TYPE_CHECKING, Any, cast

import numpy as np

from hmtb_twin import IDEAL, MODES, VARIANTS, Chain, JointLog, load_arm
from hmtb_twin.bus.shutdown_intervals import shutdown_intervals
from hmtb_twin.control.modes import TOOL_AXES, axis_names
from hmtb_twin.parameters.values import HAND_CONTROLLER
from hmtb_twin.run.experiment_row import experiment_arm
from hmtb_twin.run.live_run import Frame
from hmtb_twin.run.playback import pictured_arm
from scenarios.experiments.hand_drive import Drive, Stick, displays, drive_recipe, exchange
from scenarios.experiments.log_review import velocity_limited_share
from scenarios.experiments.registry import load
from scenarios.experiments.scenario import known_arm
from scenarios.report.html_pieces import listing, table
from scenarios.station.experiment_tab import variants_of
from scenarios.station.fields import Field, Form, reporting
from scenarios.station.recipe import Recipe, RecipeView
from scenarios.station.stick_pad import StickPad, grid
from scenarios.station.strip_chart import DRAWINGS, StripChart

if TYPE_CHECKING:
    import viser

    from scenarios.station.desk import Desk

WORKSITE = "worksite, the unit in its holster"
"""Where the replacement unit is exchanged."""


def places(arm: str) -> dict[str, str]:
    """Payload at the start of a drive, by the words of the menu; the worksite fits the test bed alone."""
    in_free_space = {f"free space, payload {name}": name for name in known_arm(arm).payloads}
    return ({WORKSITE: "none"} if arm in VARIANTS else {}) | in_free_space


PHASES = ("phase", "from / s", "to / s")
"""Head of the table of an exchange."""

ALL = "all"
"""The menu's word for all axes of a mode."""


def axis_choices(mode: str, arm: str) -> tuple[str, ...]:
    """Axes of a mode to choose from: all, three together, or one."""
    names = axis_names(mode, arm)
    together = (", ".join(names[:3]), ", ".join(names[3:])) if len(names) > 3 else ()
    # Where there are four, the last stands alone in both.
    return tuple(dict.fromkeys((ALL, *together, *names)))


_RARE = "Arm, seed, duration"


def drive_fields(arm: str) -> tuple[Field, ...]:
    """What a drive of an arm is described by."""
    machine, mode, where = known_arm(arm), "cartesian_rate", tuple(places(arm))
    return (
        Field("mode", "mode", mode, MODES, "offsets of joints or of the tool, or their velocities"),
        Field("axes", "axes", ALL, axis_choices(mode, arm), "that the hand controller moves"),
        Field("place", "place", where[0], where),
        Field("imperfect", "imperfections", True, hint="noise, bias, converters, hold, limits, friction"),
        Field("pose", "pose", machine.operating_pose, tuple(machine.poses), folder=_RARE),
        Field("variant", "arm", arm, variants_of(arm), folder=_RARE),
        Field("seed", "seed", 0, folder=_RARE),
        Field("duration", "longest duration / s", 600.0, folder=_RARE),
    )


def drive(values: dict[str, Any]) -> Drive:
    """The drive that the fields describe, with a stick of its own; raises `ScenarioError` if they describe none."""
    values = dict(values)
    mode, chosen, arm = values["mode"], values.pop("axes"), values["variant"]
    worksite = values["place"] == WORKSITE
    # Another mode may have other axes: then all of its own.
    axes = tuple(chosen.split(", ")) if chosen in axis_choices(mode, arm)[1:] else axis_names(mode, arm)
    # A circuit compensates the bias where the tool is steered [Morris1996, sec. II.3B].
    hand_controller = load("rpcm").hand_controller if mode.startswith("cartesian") else HAND_CONTROLLER
    chain = Chain() if values.pop("imperfect") else IDEAL
    return Drive(
        name="drive",
        axes=axes,
        excitation=(),
        payload=places(arm)[values.pop("place")],
        worksite=worksite,
        chain=chain,
        hand_controller=hand_controller,
        # In free space the payload is in the hand; at the worksite the unit waits in its holster, and the fingers are
        # open.
        stick=Stick(axes, grip=not worksite),
        **values,
    )


class DriveTab:
    """The hand controller, what the operator sees of the arm, and the record.

    Args:
        station: The station.
        client: The browser that steers it. A drive goes on while its page is loaded again.

    Attributes:
        drive: The drive that runs; None when none does.
        name: Name of the last record; empty before.
        buttons: By their labels.
    """

    title = "Drive"

    def __init__(self, station: "Desk", client: "viser.ClientHandle") -> None:
        self._station, self._client, gui = station, client, client.gui
        machine = known_arm(station.session.arm)
        last: Any = station.session.memory.get(self.title)
        # A drive goes on while its page is loaded again: the new tab takes over lock, drive and record of the last one.
        self._lock = last._lock if last else threading.RLock()
        self.drive: Drive | None = last.drive if last else None
        self.name: str = last.name if last else ""
        self._moving = last is not None and last._moving
        self._drawn = 0.0
        self._setup = gui.add_folder("What is driven")
        with self._setup:
            self._form = Form(gui, drive_fields(station.session.arm), drive, self._changed)
        with gui.add_folder("Drive"):
            self._build_buttons()
        self._displays = gui.add_html("")
        outcome = last._outcome.content if last else ""
        self._outcome = gui.add_html(outcome)
        volts = last.volts.value if last else 2.0
        self.volts = gui.add_slider("deflection / V", 0.1, HAND_CONTROLLER.adc_range, 0.1, volts)
        self._pad = StickPad(gui, self._push, max(len(machine.free), len(TOOL_AXES)))
        with gui.add_folder("Strip charts"):
            self._joint: Any = gui.add_dropdown("joint", machine.joints, initial_value=machine.compared[-1])
            self._angles = StripChart(gui, "joint angle / deg", ("command", "angle"), height=125)
            self._forces = StripChart(gui, "force / N", ("wrist", "contact"), height=125)
        self._joint.on_update(lambda _: self._angles.clear())
        self._recipe = RecipeView(client, self.recipe)
        if last:
            self._form.set({name: handle.value for name, handle in last._form.handles.items()})
        self._form.update()
        self._show(moving=self._moving)
        station.session.memory[self.title] = self

    def _build_buttons(self) -> None:
        gui, motion = self._client.gui, self._station.motion
        grid(gui, "drive-buttons", "1fr 1fr 1fr")
        actions: dict[str, Callable[[], None]] = {
            "Drive": self._begin,
            "End": motion.stop,
            "Close (C)": lambda: self._hold(closed=True),
            "Open (V)": lambda: self._hold(closed=False),
            "EMERGENCY SHUTDOWN": lambda: motion.switch_power(on=False),
            "Power on again": lambda: motion.switch_power(on=True),
            "Replay": self._replay,
            "Save .nc": self._save,
            "Download .nc": self._download,
        }
        colours: dict[str, Any] = {"Drive": "green", "EMERGENCY SHUTDOWN": "red"}
        self.buttons = {label: gui.add_button(label, color=colours.get(label)) for label in actions}
        for label, action in actions.items():
            handle = reporting(self._client, action)
            self.buttons[label].on_click(handle)
            if label.endswith(")"):  # its key
                gui.add_command(label, hotkey=cast(Any, label[-2])).on_trigger(handle)

    def _changed(self, planned: Drive | None) -> None:
        if planned is not None:
            menu, choices = self._form.handles["axes"], axis_choices(planned.mode, planned.variant)
            if menu.options != choices:
                menu.options = choices
            self._pad.show(axis_names(planned.mode, planned.variant), planned.stick.volts())

    def _push(self, axis: str, way: int) -> None:
        if self.drive is not None:
            self.drive.stick.push(axis, way * self.volts.value)

    def _hold(self, *, closed: bool) -> None:
        if self.drive is not None:
            self.drive.stick.grip = closed

    def _show(self, *, moving: bool) -> None:
        """Show the buttons for what can be done now, where the tab itself moves the arm or not."""
        self._moving = moving
        driven, idle = self.drive is not None, not moving
        gripping = self.drive is not None and self.drive.worksite
        # Where the arm is driven, the fields give their place to what the operator sees.
        self._setup.visible = not driven
        recorded = idle and bool(self.name)
        # In the sequence of the buttons: drive, end, close, open, shutdown, power on, replay, save, download.
        visible = (idle, moving, gripping, gripping, driven, driven, recorded, recorded, recorded)
        for button, is_visible in zip(self.buttons.values(), visible, strict=True):
            button.visible = is_visible

    def _begin(self) -> None:
        station = self._station
        with self._lock:
            station.motion.check_free()
            made = replace(self._form.checked(), name=self._free_name())
            station.scene.load(experiment_arm(made, worksite=True, load=load_arm))
            self._clear(made.axes[0])
            self._outcome.content = ""
            # Looked up at each call: when the page is loaded again during the drive, another tab shows the rest of it.
            watch, done = lambda frames: self._tab.watch(frames), lambda log, why: self._tab.done(log, why)
            station.motion.run(made, watch=watch, done=done)
            self.drive = made
            self._show(moving=True)

    @property
    def _tab(self) -> "DriveTab":
        """The tab of the browser that steers now."""
        return cast(DriveTab, self._station.session.memory[self.title])

    def _clear(self, axis: str) -> None:
        if axis in self._joint.options:
            self._joint.value = axis
        self._angles.clear()
        self._forces.clear()

    def _free_name(self) -> str:
        records = self._station.session.records
        names = (f"drive-{k}" for k in count(1))
        # Files of earlier sessions keep their names too.
        return next(name for name in names if name not in records and not self._file(name).exists())

    def _file(self, name: str) -> Path:
        return self._station.session.folder / f"{name}.nc"

    def watch(self, frames: list[Frame]) -> None:
        """Draw the arm's motion."""
        joint = self._joint.options.index(self._joint.value)
        for frame in frames:
            angles = np.degrees((frame.command[joint], frame.angles[joint])).tolist()
            self._angles.add(frame.tick, frame.time, tuple(angles))
            self._forces.add(frame.tick, frame.time, (frame.wrist_force, frame.contact_force or 0.0))
        # Every drawing sends the whole chart to the browser.
        if perf_counter() - self._drawn < DRAWINGS:
            return
        self._drawn = perf_counter()
        self._angles.draw()
        self._forces.draw()
        self._displays.content = listing(displays(frames[-1], self.drive))
        if self.drive is not None:
            self._pad.show(axis_names(self.drive.mode, self.drive.variant), self.drive.stick.volts())

    def done(self, log: JointLog | None, why: str | None) -> None:
        """Keep the record of a drive that has ended, and show its outcome."""
        with self._lock:
            self.drive = None
            lines = [f"failed: {why}"] if why else []
            phases: list[tuple[str, str, str]] = []
            if log is not None:
                self.name = self._station.session.keep(log)
                limited = f"{100 * velocity_limited_share(log):.3g} % of it at a velocity limit"
                lines.insert(0, f"{self.name}: {len(log) * log.dt:g} s recorded, {limited}")
                lines += map(str, shutdown_intervals(log))
                exchange_lines, phases = exchange(log)
                lines += exchange_lines
            lines.append(self._station.motion.timing)
            phase_table = table(PHASES, phases) if phases else ""
            self._outcome.content = listing(lines) + phase_table
            self._recipe.refresh()
            self._end()
            # Shows the stick at rest again.
            self._form.update()

    def _end(self) -> None:
        self._angles.draw()
        self._forces.draw()
        self._displays.content = ""
        self._show(moving=False)

    def _replay(self) -> None:
        log = self._station.session.records[self.name]
        with self._lock:
            self._station.motion.check_free()
            self._station.scene.load(pictured_arm(log))
            self._clear(log.axes[0])
            self._station.motion.replay(
                log, watch=lambda frames: self._tab.watch(frames), done=lambda *_: self._tab._end()
            )
            self._show(moving=True)

    def _save(self) -> None:
        self._station.save(self.name, self._client)

    def _download(self) -> None:
        path = self._station.save(self.name, self._client)
        self._client.send_file_download(path.name, path.read_bytes())

    def recipe(self) -> Recipe:
        """The record of the last drive without the page."""
        if not self.name:
            return Recipe((), "# after a drive: its record as commands and in Python")
        return drive_recipe(self._station.session.records[self.name], str(self._file(self.name)))
