"""The Experiment tab: prepare an experiment, see its commands before anything moves, and run it live."""

import threading
from dataclasses import dataclass, replace
from time import perf_counter
from typing import TYPE_CHECKING, Any, cast

import numpy as np

from hmtb_twin import MODES, VARIANTS, Chain, JointLog, Status, load_arm
from hmtb_twin.control.modes import axis_names
from hmtb_twin.run.experiment_row import experiment_arm
from hmtb_twin.run.live_run import Frame
from scenarios.experiments.log_review import status_words
from scenarios.experiments.preview import preview
from scenarios.experiments.preview_figure import preview_figure
from scenarios.experiments.recipe import scenario_recipe
from scenarios.experiments.registry import load, names, tests_of
from scenarios.experiments.run_review import review
from scenarios.experiments.scenario import Scenario, known_arm
from scenarios.files.errors import ScenarioError
from scenarios.report.html_pieces import card, listing, table
from scenarios.station.fields import Field, Form, Message, reporting
from scenarios.station.live_track import CALIBRATION, LiveTrack
from scenarios.station.recipe import RecipeView
from scenarios.station.strip_chart import DRAWINGS, StripChart

if TYPE_CHECKING:
    import viser

    from scenarios.station.desk import Desk

SPEEDS = {"real time": 1.0, "four times as fast": 4.0, "as fast as it goes": None}
"""Seconds of the experiment per second, by the words of the menu."""

SIZE = (5.2, 7.0)
"""Width and height of the preview, inches."""


@dataclass(frozen=True)
class PreviewCard:
    """A preview as the page shows it.

    Attributes:
        html: Figure, table and lines.
        warnings: What the operator should know before the arm moves.
    """

    html: str
    warnings: tuple[str, ...]


def preview_card(scenario: Scenario) -> PreviewCard:
    """Compute a preview and draw it."""
    seen = preview(scenario)
    head = ("joint", "peak rate", "limit", "from range's end")
    html = card(preview_figure(seen), f"preview of {scenario.name}", SIZE)
    return PreviewCard(html + table(head, seen.table().rows) + listing(seen.lines()), seen.warnings())


def axis_choices(scenario: Scenario) -> tuple[str, ...]:
    """Axes of the scenario's mode to choose from, one or several separated by commas; its own first."""
    axes = axis_names(scenario.mode, scenario.variant)
    together = axes_moved_together(scenario.mode, scenario.variant)
    choices = (", ".join(scenario.axes), *axes, ", ".join(together), ", ".join(axes))
    return tuple(dict.fromkeys(choices))


def axes_moved_together(mode: str, variant: str) -> tuple[str, ...]:
    """Three axes of a mode: those that the thesis moved together, or the first joints of another machine."""
    if mode.startswith("cartesian"):
        return ("x", "y", "z")
    return known_arm(variant).studied or axis_names(mode, variant)[:3]


def variants_of(arm: str) -> tuple[str, ...]:
    """Arms that may take the place of an arm: the variants of the test bed have the same joints."""
    return tuple(VARIANTS) if arm in VARIANTS else (arm,)


def changed_scenario(base: Scenario, values: dict[str, Any]) -> Scenario:
    """The scenario that the fields describe.

    Raises:
        ScenarioError: It is none.
        TwinError: The laboratory has no such arm.
    """
    values = dict(values)
    volts = values.pop("amplitude", None)
    axes = tuple(axis.strip() for axis in values.pop("axes").split(","))
    mode = values["mode"]
    if mode != base.mode and not set(axes) <= set(axis_names(mode, base.variant)):
        # The old mode's axes mean nothing in the new one: the first that the thesis moved is a start.
        axes = axes_moved_together(mode, base.variant)[:1]
    shutdown = values.pop("shutdown").replace(",", " ").split()
    try:
        times = tuple(float(time) for time in shutdown)
    except ValueError:
        raise ScenarioError(f"expected times in s, such as 5 12, given {' '.join(shutdown)!r}") from None
    if volts is not None and volts != base.amplitude:
        base = base.with_amplitude(volts)
    return replace(base, **values, axes=axes, shutdown=times)


def followed_joint(scenario: Scenario) -> int:
    """Column of the joint whose angle the page draws: the first that is excited, else the last that is compared."""
    arm = known_arm(scenario.variant)
    excited = [axis for axis in scenario.axes if axis in arm.joints]
    return arm.joint_index(excited[0] if excited else arm.compared[-1])


class ExperimentTab:
    """Fields of a scenario, its preview, and the live run.

    Args:
        station: The station.
        client: The browser that steers it.
    """

    title = "Experiment"

    def __init__(self, station: "Desk", client: "viser.ClientHandle") -> None:
        self._station, self._client = station, client
        gui = client.gui
        arm, prepared = station.session.arm, station.session.scenario.name
        options = names() if arm in VARIANTS else tuple(tests_of(arm))
        # An experiment from a file is not in the menu.
        first = prepared if prepared in options else options[0]
        self._start = gui.add_dropdown("start from", options, initial_value=first)
        self._start.on_update(reporting(client, lambda: station.session.prepare(load(self._start.value, arm=arm))))
        self._fields = gui.add_folder("What is done", expand_by_default=True)
        self._build_form()
        # The tab of a page that was loaded before: a run goes on while its page is loaded again.
        last: Any = station.session.memory.get(self.title)
        self._build_run(last)
        self._build_preview()
        with gui.add_folder("Scenario file", expand_by_default=False):
            upload = gui.add_upload_button("Load a scenario file (TOML)")
            upload.on_upload(reporting(client, lambda: self._load(upload.value.name, upload.value.content)))
        self._recipe = RecipeView(client, lambda: scenario_recipe(station.session.scenario))
        self._prepared = station.session.scenario
        self._previewed: Scenario | None = None
        station.session.watch(self._refresh)
        self._take_over(last)
        self._show_preview()

    def _build_run(self, last: Any) -> None:
        """Build buttons, progress and strip charts of the live run."""
        station, client = self._station, self._client
        gui = client.gui
        self._run = gui.add_button("Run", color="green")
        speed = last._speed.value if last and last._running else "real time"
        self._speed = gui.add_dropdown("speed", tuple(SPEEDS), initial_value=speed)
        self._progress: Any = gui.add_progress_bar(0.0, visible=False)
        self._state = Message(gui)
        self._emergency = gui.add_button("EMERGENCY SHUTDOWN", color="red", visible=False)
        self._reset = gui.add_button("Power on again", visible=False)
        self._stop = gui.add_button("Stop and keep the record", visible=False)
        self._drawn = 0.0
        self._joint = 0
        with gui.add_folder("Strip charts"):
            self._charts = [
                StripChart(gui, "moved joint / deg", ("command", "angle")),
                StripChart(gui, "wrist force / N", ("force",)),
                StripChart(gui, "tracked bandwidth / Hz", ("bandwidth", "from", "to")),
            ]
            self._tracked = Message(gui)
        self._outcome = gui.add_html("")
        self._save = gui.add_button("Save the log", visible=False)
        self._run.on_click(reporting(client, self._start_run))
        self._stop.on_click(reporting(client, station.motion.stop))
        self._emergency.on_click(reporting(client, lambda: station.motion.switch_power(on=False)))
        self._reset.on_click(reporting(client, lambda: station.motion.switch_power(on=True)))
        self._save.on_click(reporting(client, self._save_log))

    def _build_preview(self) -> None:
        gui = self._client.gui
        with gui.add_folder("Preview: the commands, before anything moves"):
            self._preview_state = Message(gui)
            self._preview_warnings = Message(gui)
            self._preview = gui.add_html("")

    def _take_over(self, last: Any) -> None:
        """Show the run of the tab that this one replaces, which may still go on."""
        self._lock = last._lock if last else threading.RLock()
        self._last: str = last._last if last else ""  # name of the record of the last run
        with self._lock:
            self._station.session.memory[self.title] = self
            self._track: LiveTrack | None = None
            if last:
                self._joint, self._outcome.content = last._joint, last._outcome.content
                self._track = last._track
            if self._track:
                self._track.chart, self._track.message = self._charts[2], self._tracked
            self._buttons(running=last is not None and last._running)

    def _build_form(self) -> None:
        scenario, gui = self._station.session.scenario, self._client.gui
        # A folder of viser can be removed, but not emptied.
        for child in list(self._fields._children.values()):
            child.remove()
        machine = known_arm(scenario.variant)
        # One's own payload of a scenario file is no name of the arm's.
        payloads = tuple(dict.fromkeys((*machine.payloads, scenario.payload)))
        volts, times = scenario.amplitude, " ".join(f"{time:g}" for time in scenario.shutdown)
        fields = [
            Field("name", "name", scenario.name),
            Field("mode", "mode", scenario.mode, MODES),
            Field("axes", "axes", ", ".join(scenario.axes), axis_choices(scenario)),
        ]
        if volts is not None:
            fields.append(Field("amplitude", "amplitude / V", volts))
        fields.append(Field("duration", "duration / s", scenario.duration))
        fields += [
            Field("payload", "payload", scenario.payload, payloads, folder=RARE),
            Field("pose", "pose", scenario.pose, tuple(machine.poses), folder=RARE),
            Field("variant", "arm", scenario.variant, variants_of(scenario.variant), folder=RARE),
            Field("seed", "seed", scenario.seed, folder=RARE),
            Field("shutdown", "shutdowns / s", times, hint=SHUTDOWN_HINT, folder=RARE),
        ]
        with self._fields:
            kinds = dict.fromkeys(excitation.kind for excitation in scenario.excitation)
            action = scenario.task or ", ".join(kinds) or "nothing"
            actor = "an operator does the task" if scenario.task else "the excitation computer plays"
            gui.add_markdown(f"{actor} **{action}**; choose another in the tab Waveform")
            self._form = Form(gui, fields, lambda values: changed_scenario(self._base(), values), self._changed)
            with gui.add_folder("Imperfections of the laboratory", expand_by_default=False):
                self._chain = {name: gui.add_checkbox(name, on) for name, on in vars(scenario.chain).items()}
                for box in self._chain.values():
                    box.on_update(lambda _: self._update())

    def _base(self) -> Scenario:
        return replace(self._prepared, chain=Chain(**{name: box.value for name, box in self._chain.items()}))

    def _update(self) -> None:
        self._form.update()

    def _changed(self, scenario: Scenario | None) -> None:
        if scenario is not None and scenario != self._prepared:
            # Another mode has other axes to choose from.
            rebuild = scenario.mode != self._prepared.mode
            self._prepared = scenario
            self._station.session.prepare(scenario)
            if rebuild:
                self._build_form()

    def _refresh(self) -> None:
        scenario = self._station.session.scenario
        if scenario != self._prepared:
            self._prepared = scenario
            self._build_form()
        self._recipe.refresh()
        self._show_preview()

    def _load(self, name: str, content: bytes) -> None:
        try:
            toml = content.decode()
        # The browser sends any file, also one that is no text.
        except UnicodeDecodeError as error:
            raise ScenarioError(f"{name}: expected a TOML file in UTF-8: {error}") from error
        self._station.session.prepare(Scenario.from_toml(toml, source=name, folder=self._station.session.folder))

    def _show_preview(self) -> None:
        scenario, work = self._station.session.scenario, self._station.work
        if scenario == self._previewed:
            return
        if work.label:
            if work.label != PREVIEW:
                self._preview_state.say(f"waits: {work.label} is being computed", remark=True)
            # Of several waiting previews the last alone is computed: they have the same label.
            work.when_free(PREVIEW, self._show_preview)
            return
        self._previewed = scenario
        self._preview_state.say("is being computed ...", remark=True)

        def done(seen: PreviewCard) -> None:
            self._preview_state.say("")
            self._preview.content = seen.html
            self._preview_warnings.say("; ".join(seen.warnings))

        def failed(why: str) -> None:
            self._preview_state.say(why)
            self._preview.content = ""
            self._preview_warnings.say("")

        work.start(PREVIEW, preview_card, scenario, done=done, failed=failed)

    def _start_run(self) -> None:
        self._station.motion.check_free()
        self._form.checked()
        station, scenario = self._station, self._station.session.scenario
        station.scene.load(experiment_arm(scenario, worksite=True, load=load_arm))
        self._joint = followed_joint(scenario)
        for chart in self._charts:
            chart.clear()
        self._outcome.content = ""
        if self._track:
            self._track.close()
        self._tracked.say("")
        # A joint alone, long enough to calibrate.
        moved = known_arm(scenario.variant).joints[self._joint]
        followed = scenario.axes == (moved,) and scenario.duration > CALIBRATION
        self._track = LiveTrack(self._charts[2], self._tracked) if followed else None

        def done(log: JointLog | None, why: str | None) -> None:
            with self._lock:
                self._tab._done(log, why, scenario)

        self._buttons(running=True)  # before the run, which may end at once
        station.motion.run(
            scenario,
            speed=SPEEDS[self._speed.value],
            watch=lambda frames: self._tab._watch(frames, scenario),
            done=done,
        )

    @property
    def _tab(self) -> "ExperimentTab":
        """The tab of the browser that steers now."""
        return cast(ExperimentTab, self._station.session.memory[self.title])

    def _buttons(self, *, running: bool) -> None:
        self._running = running
        # What cannot be changed now gives its place to the strip charts.
        for handle in (self._run, self._fields, self._start, self._speed):
            handle.visible = not running
        for handle in (self._stop, self._emergency, self._progress):
            handle.visible = running
        self._reset.visible = False
        self._save.visible = not running and bool(self._last)

    def _watch(self, frames: list[Frame], scenario: Scenario) -> None:
        for frame in frames:
            joint = np.degrees((frame.command[self._joint], frame.angles[self._joint]))
            self._charts[0].add(frame.tick, frame.time, tuple(joint.tolist()))
            self._charts[1].add(frame.tick, frame.time, (frame.wrist_force,))
            if self._track and frame.measured is not None:
                self._track.add(frame.command[self._joint], frame.measured[self._joint])
        if perf_counter() - self._drawn < DRAWINGS:
            return
        self._drawn = perf_counter()
        # The third chart is drawn by the thread of `LiveTrack`.
        for chart in self._charts[:2]:
            chart.draw()
        last = frames[-1]
        self._progress.value = 100.0 * min(last.time / scenario.duration, 1.0)
        self._reset.visible = bool(last.status & Status.SHUT_DOWN)
        words = status_words(last.status)
        self._state.say(f"{last.time:.1f} of {scenario.duration:g} s   {', '.join(words)}", remark=True)

    def _done(self, log: JointLog | None, why: str | None, scenario: Scenario) -> None:
        self._last = ""
        lines = [f"failed: {why}"] if why else []
        if log is not None:
            run = Scenario.from_toml(log.provenance["scenario"])
            self._last = self._station.session.keep(log)
            lines.insert(0, f"{self._last}: {len(log) * log.dt:g} s recorded")
            # A run that was stopped has no task to judge.
            if len(log) == round(run.duration / log.dt):
                lines += _review_lines(log, run)
            # The buttons added shutdowns while it ran: the scenario becomes what was done.
            if run != scenario and run.shutdown != scenario.shutdown:
                self._station.session.prepare(run)
        lines.append(self._station.motion.timing)
        for chart in self._charts[:2]:
            chart.draw()
        if self._track:
            self._track.close()
        self._outcome.content = listing(lines)
        failure = f"{scenario.name}: {why}" if why else ""
        self._state.say(failure)
        self._buttons(running=False)

    def _save_log(self) -> None:
        self._station.save(self._last, self._client)


def _review_lines(log: JointLog, run: Scenario) -> list[str]:
    """What the review of a whole run says: clipping, limits, task, shutdowns, warnings."""
    judged = review(log, run)
    clipped, limited = judged.shares()
    lines = [f"converter clips {clipped}, command rate-limited {limited}"]
    if judged.task:
        lines.append(str(judged.task))
    lines += map(str, judged.shutdowns)
    lines += [f"warning: {warning}" for warning in judged.warnings]
    return lines


RARE = "Arm, seed, shutdowns"
"""Folder of the fields that are rarely changed."""

PREVIEW = "the preview"
"""Name of the work."""

SHUTDOWN_HINT = "times of power off and power on, alternating; empty for none"
