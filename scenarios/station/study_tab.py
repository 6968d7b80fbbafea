"""The Study tab: open what exists on disk, look at it, and replay it on the arm in step with its plots."""

from pathlib import Path
from time import perf_counter
from typing import TYPE_CHECKING, Any

import numpy as np

from hmtb_twin import JointLog
from hmtb_twin.parameters.values import SAMPLE_TIME
from hmtb_twin.run.live_run import Frame, frame_of
from hmtb_twin.run.playback import pictured_arm
from scenarios.experiments.presentation import Presentation, moved_joints, present_log
from scenarios.experiments.preview_figure import COLOURS, RED
from scenarios.experiments.recipe import Recipe
from scenarios.experiments.scenario import known_arm
from scenarios.report.html_pieces import listing, table
from scenarios.station.fields import Message, reporting
from scenarios.station.opening import files_in, open_place
from scenarios.station.recipe import RecipeView
from scenarios.station.strip_chart import DRAWINGS, time_chart

if TYPE_CHECKING:
    import viser

    from scenarios.station.desk import Desk

SPEEDS = ("0.25", "0.5", "1", "2", "4", "8", "16")
"""Seconds of the log per second."""

WINDOW = 1000
"""Ticks that the plots show: 20 s."""

CHOOSE = "…"
"""First entry of a menu whose other entries open something at once."""

RECORD = "record "
"""Beginning of the entries of records of this session."""


class LogPlot:
    """Signals of a log over time, with a line at the time that the arm shows.

    Args:
        gui: Where to put it, in the container that is open.
        names: Name of each signal.
    """

    def __init__(self, gui: "viser.GuiApi", names: tuple[str, ...]) -> None:
        axes = ({"size": 30, "ticks": {"size": 4}}, {"size": 50, "ticks": {"size": 4}})
        self._chart = time_chart(gui, {**dict(zip(names, COLOURS, strict=False)), "shown": RED}, 130, axes)

    def load(self, title: str, values: np.ndarray) -> None:
        """Take signals (N, n)."""
        self._values = values
        low, high = float(values.min()), float(values.max())
        # A constant signal has no range of its own: 5 % of its value, or one around zero.
        margin = 0.05 * (high - low) or 0.05 * abs(high) or 1.0
        self._ends = (low - margin, high + margin)
        self._chart.visible, self._chart.title = bool(values.any()), title
        self._chart.scales = {"x": {"time": False}, "y": {"range": self._ends}}

    def draw(self, tick: int) -> None:
        """Draw the stretch that a tick falls into, and the line at this tick."""
        # Whole windows: the curves stand still while the line moves across them.
        first = tick // WINDOW * WINDOW
        # The line takes two samples at the same time.
        rows = np.sort(np.r_[first : min(first + WINDOW, len(self._values)), tick, tick])
        line = np.full(len(rows), np.nan)
        line[tick - first : tick - first + 2] = self._ends
        self._chart.data = (rows * SAMPLE_TIME, *self._values[rows].T, line)


class StudyTab:
    """What to open, what it is, its parts, and the replay of its log.

    Args:
        station: The station.
        client: The browser that steers it.
    """

    title = "Study"

    def __init__(self, station: "Desk", client: "viser.ClientHandle") -> None:
        self._station, self._client = station, client
        gui: Any = client.gui
        self._place = gui.add_text("open", "", hint="path of a file or folder, or name of a scenario")
        self._message = Message(gui)
        self._menu = gui.add_dropdown("or choose", (CHOOSE,), hint="records of this session, files of its folder")
        self._buttons = gui.add_button_group("", ("Open", "Refresh the menu"))
        self._stop = gui.add_button("Stop", color="red", visible=False)
        self._about = gui.add_html("")
        self._part = gui.add_dropdown("part of it", (CHOOSE,), visible=False)
        self._replay = gui.add_folder("Replay", visible=False)
        with self._replay:
            self._time = gui.add_slider("time / s", 0.0, 1.0, SAMPLE_TIME, 0.0)
            self._steering = gui.add_button_group("", ("Play", "Pause", "To the start"))
            self._speed = gui.add_dropdown("times as fast", SPEEDS, initial_value="1")
            self._joint = gui.add_dropdown("joint", known_arm(station.session.arm).joints)
            self._plots = [LogPlot(gui, names) for names in (("command", "measured"), ("x", "y", "z"), ("load",))]
            self._loop = gui.add_checkbox("again and again", False)
        self._opened: Presentation | None = None
        self._recipe = RecipeView(client, self._opened_recipe)
        self._put, self._drawn, self._tick = 0.0, 0.0, 0
        for handle, action in (
            (self._menu, self._choose),
            (self._buttons, self._press),
            (self._stop, station.work.stop),
            (self._part, self._choose_part),
            (self._time, self._drag),
            (self._steering, self._steer),
            (self._speed, self._set_pace),
            (self._loop, self._set_pace),
            (self._joint, self._load_plots),
        ):
            # Menus and sliders are updated, buttons are clicked.
            connect = handle.on_update if hasattr(handle, "on_update") else handle.on_click
            connect(reporting(client, action))
        station.session.watch(self._list)
        self._pause()  # a replay that another browser began
        self._list()

    def _opened_recipe(self) -> Recipe:
        return self._opened.recipe if self._opened else Recipe((), "")

    def _list(self) -> None:
        session = self._station.session
        self._menu.options = (CHOOSE, *(RECORD + name for name in session.records), *files_in(session.folder))
        opened = session.memory.get(self.title)
        if opened is not None and opened is not self._opened:
            self._opened = opened
            self._show(opened)

    def _press(self) -> None:
        if self._buttons.value == "Open":
            self._open(self._place.value.strip())
        self._list()

    def _choose(self) -> None:
        choice = self._menu.value
        if choice.startswith(RECORD):
            self._compute(choice, present_log, self._station.session.records[choice.removeprefix(RECORD)])
        elif choice != CHOOSE:
            self._place.value = str(self._station.session.folder / choice)
            self._open(self._place.value)

    def _choose_part(self) -> None:
        if self._opened is not None and self._part.value not in (CHOOSE, self._opened.part):
            self._open(self._opened.place, self._part.value)

    def _open(self, place: str, part: str = "") -> None:
        self._compute(f"opening {part or Path(place).name}", open_place, place, part)

    def _compute(self, label: str, function: Any, *arguments: object) -> None:
        def done(opened: Presentation) -> None:
            self._station.session.memory[self.title] = opened
            self._station.session.tell()
            self._end("")

        def begin() -> None:
            self._message.say(f"{label} ...", remark=True)
            self._stop.visible = True
            work.start(label, function, *arguments, done=done, failed=self._end)

        work = self._station.work
        if work.label:
            self._message.say(f"{label} begins after {work.label}", remark=True)
        work.when_free(self.title, begin)

    def _end(self, message: str) -> None:
        self._message.say(message)
        self._stop.visible = False

    def _show(self, opened: Presentation) -> None:
        """Show what was opened; its log joins the records of the session."""
        self._pause()
        tables = ""
        for title, head, rows in opened.tables:
            if title:
                tables += listing((title,))
            tables += table(head, rows)
        # A log leaves room for its replay below.
        height = 460 if opened.log is None else 200
        self._about.content = (
            f'<div style="max-height:{height}px;overflow:auto">{listing((f"{opened.kind}: {opened.place}",))}'
            f"{tables}{listing(opened.lines)}</div>"
        )
        self._place.value = self._place.value or opened.place
        self._part.options = (CHOOSE, *opened.parts)
        self._part.value, self._part.visible = opened.part or CHOOSE, bool(opened.parts)
        self._recipe.refresh()
        log = opened.log
        self._replay.visible = log is not None
        if log is None:
            return
        if opened.complete and not self._is_kept(log):
            self._station.session.keep(log)
        self._tick = 0
        self._time.max = (len(log) - 1) * SAMPLE_TIME
        self._joint.options = moved_joints(log)
        self._load_plots()
        if not self._station.motion.running:
            self._pose(log)

    def _is_kept(self, log: JointLog) -> bool:
        """Whether the session has a record of the same name with the same angles."""
        records = self._station.session.records.values()
        return any(log.name == record.name and np.array_equal(log.measured, record.measured) for record in records)

    def _load_plots(self) -> None:
        if self._opened is None or (log := self._opened.log) is None:
            return
        joint, column = self._joint.value.replace("_", " "), log.joint_index(self._joint.value)
        electric = log.provenance.get("drives") == "electric"
        load = "motor current, {} / A" if electric else "load pressure, {} / MPa"
        angles, force, pressure = self._plots
        angles.load(f"{joint} / deg", np.degrees(np.c_[log.felt[:, column], log.measured[:, column]]))
        force.load("wrist force, sensor frame / N", log.wrench[:, :3])
        pressure.load(load.format(joint), log.load_pressure[:, [column]])
        self._follow()

    def _follow(self) -> None:
        """Draw the plots and put the slider where the arm is."""
        self._put = self._tick * SAMPLE_TIME
        self._time.value = self._put
        for plot in self._plots:
            plot.draw(self._tick)

    def _pose(self, log: JointLog) -> None:
        """Put the arm where the slider stands."""
        arm = pictured_arm(log)
        if arm is not self._station.scene.arm:
            self._station.scene.load(arm)
        self._station.scene.show(frame_of(log, self._tick))

    def _steer(self) -> None:
        motion, button = self._station.motion, self._steering.value
        if self._opened is None or (log := self._opened.log) is None:
            return
        if button == "Pause":
            self._pause()
        elif button == "To the start":
            self._time.value = 0.0
        elif motion.playback is None:
            motion.check_free()
            # Play after the end begins again.
            if self._tick == len(log) - 1:
                self._tick = 0
            self._pose(log)
            speed, loop, first = float(self._speed.value), self._loop.value, self._tick * SAMPLE_TIME
            motion.replay(log, first=first, speed=speed, loop=loop, watch=self._watch, done=lambda *_: self._follow())

    def _pause(self) -> None:
        if self._station.motion.playback is not None:
            self._station.motion.stop()

    def _set_pace(self) -> None:
        if (playback := self._station.motion.playback) is not None:
            playback.speed, playback.loop = float(self._speed.value), self._loop.value

    def _drag(self) -> None:
        # The slider was moved by `_follow`, not by the user.
        if self._time.value == self._put or self._opened is None or (log := self._opened.log) is None:
            return
        self._tick = min(round(self._time.value / SAMPLE_TIME), len(log) - 1)
        if (playback := self._station.motion.playback) is not None:
            playback.seek(self._time.value)
            return
        self._follow()
        if not self._station.motion.running:
            self._pose(log)

    def _watch(self, frames: list[Frame]) -> None:
        self._tick = frames[-1].tick
        if perf_counter() - self._drawn > DRAWINGS:
            self._drawn = perf_counter()
            self._follow()
