"""The Waveform tab: the excitation, its 100 points and spectrum, and what it is good for."""

import threading
from collections.abc import Mapping
from functools import partial
from inspect import Parameter, getdoc, signature
from pathlib import Path
from typing import TYPE_CHECKING, Any

from scenarios.experiments.excitation import COMPUTED, KINDS, UNITS
from scenarios.experiments.excitation_computer import SETTINGS, Excitation
from scenarios.experiments.excitation_review import check_excites, excitation_rows, excitation_warnings
from scenarios.experiments.model_structures import needed_orders
from scenarios.experiments.preview_figure import waveform_figure
from scenarios.experiments.recipe import excitation_recipe, kind_word
from scenarios.experiments.waveform import parse_points, points_text
from scenarios.files.errors import ScenarioError
from scenarios.report.html_pieces import card, table
from scenarios.station.fields import Field, Form, Message, reporting
from scenarios.station.recipe import RecipeView

if TYPE_CHECKING:
    import viser

    from scenarios.station.desk import Desk

FIRST = {"frequency": 2.5, "f_start": 5.0, "f_end": 10.0, "f_low": 5.0, "f_high": 10.0, "f_center": 7.5}
"""Values to begin with of parameters without default, as in tests of the thesis, Hz."""

REPEATED = "how often the file is played per second, which scales every frequency in it; empty: as it was meant"

LARGEST_FILE = 65_536
"""Largest file that is read, bytes; a hundred numbers with all their digits take 2,500."""

EVERY_AXIS = "every axis"

SHOWN = (*COMPUTED, "points")
"""Kinds that the tab has a form for: a record of any length comes from a scenario file."""


def excitation_fields(kind: str, values: Mapping[str, Any]) -> list[Field]:
    """Return a field for every parameter and setting of a kind, with these values or first ones."""
    hints = parameter_hints(kind)
    fields = []
    for name, parameter in signature(KINDS[kind]).parameters.items():
        # A file of one's own is loaded by a button, not typed.
        if name == "points":
            continue
        label = name.replace("_", " ")
        if name in UNITS:
            label += f" / {UNITS[name]}"
        default = FIRST[name] if parameter.default is Parameter.empty else parameter.default
        fields.append(Field(name, label, values.get(name, default), hint=hints.get(name)))
    rate, count = map(values.get, SETTINGS)
    fields += [
        Field("repeat_frequency", "repetitions / Hz", rate, hint=REPEATED, folder="Repetition", optional=float),
        Field("iterations", "iterations", count, hint="empty: until the end", folder="Repetition", optional=int),
    ]
    return fields


def parameter_hints(kind: str) -> dict[str, str]:
    """What the docstring of an excitation says of each of its arguments."""
    _, _, arguments = (getdoc(KINDS[kind]) or "").partition("Args:\n")
    hints = {}
    for line in arguments.partition("\n\n")[0].splitlines():
        name, _, hint = line.strip().partition(": ")
        # The second line of a long description has no colon.
        if hint:
            hints[name] = hint
    return hints


def values_of(excitation: Excitation) -> dict[str, Any]:
    """Return parameters and settings of an excitation by name."""
    return {**excitation.parameters, **{name: getattr(excitation, name) for name in SETTINGS}}


class WaveformTab:
    """Fields of an excitation, its plot and numbers, its file, and the button that puts it into the experiment.

    Args:
        station: The station.
        client: The browser that steers it.
    """

    title = "Waveform"

    def __init__(self, station: "Desk", client: "viser.ClientHandle") -> None:
        self._session, self._client = station.session, client
        self._lock = threading.Lock()  # the last that is taken: nothing outside is called under it
        played = self._session.scenario.excitation
        # Where an operator has the stick, nothing is played.
        first_played = played[0] if played and played[0].kind in SHOWN else Excitation("prbs")
        start = self._session.waveform or first_played
        self._last, self._follows = start, False
        self._shown: Excitation | None = None
        self._points: Any = start.parameters.get("points")
        gui = client.gui
        with gui.add_folder(None):
            self._kind: Any = gui.add_dropdown(
                "excitation", [*map(kind_word, SHOWN)], initial_value=kind_word(start.kind)
            )
        self._about = Message(gui)
        self._forms: dict[str, tuple[Any, Form[Excitation]]] = {}
        for kind in SHOWN:
            values = values_of(start) if kind == start.kind else {}
            fields = excitation_fields(kind, values)
            # All are built at once and one is shown: each keeps what was typed while another is looked at.
            with gui.add_folder(None, visible=False) as folder:
                form = Form(gui, fields, partial(self._make, kind), partial(self._changed, kind))
            self._forms[kind] = folder, form
        self._figure = gui.add_html("")
        self._warnings = Message(gui)
        self._axis: Any = gui.add_dropdown("play it on", (EVERY_AXIS,))
        self._use = gui.add_button("Use in the experiment", color="green")
        self._state = Message(gui)
        self._numbers = gui.add_html("")
        with gui.add_folder("Orders of excitation that models need", expand_by_default=False):
            self._orders = gui.add_html("")
        self._take = gui.add_button("Take from the experiment", color="gray")
        upload = gui.add_upload_button("Load a file of 100 points", color="gray", mime_type="text/plain,.txt,.csv,.dat")
        self._save = gui.add_button("Save the 100 points (TXT)", color="gray")
        self._recipe = RecipeView(client, lambda: excitation_recipe(self._last, self._session.waveform_file))
        self._kind.on_update(lambda _: self._pick())
        self._axis.on_update(lambda _: self._compare())
        upload.on_upload(reporting(client, lambda: self._load(upload.value.name, upload.value.content)))
        self._use.on_click(reporting(client, self._put_in))
        self._take.on_click(reporting(client, self._take_out))
        self._save.on_click(reporting(client, self._save_points))
        self._pick()
        self._session.watch(self._prepared)

    def _make(self, kind: str, values: Mapping[str, Any]) -> Excitation:
        if kind == "points":
            if self._points is None:
                raise ScenarioError("load a file of your own, below: 100 numbers in V, one per line")
            values = {"points": self._points, **values}
        parameters = {name: value for name, value in values.items() if name not in SETTINGS}
        excitation = Excitation(kind, parameters, **{name: values[name] for name in SETTINGS})
        check_excites(excitation)
        return excitation

    def _pick(self) -> None:
        """Show the fields of the kind that is chosen, and what they describe."""
        with self._lock:
            for kind, (folder, _) in self._forms.items():
                folder.visible = kind_word(kind) == self._kind.value
            chosen = next(kind for kind in SHOWN if kind_word(kind) == self._kind.value)
            self._about.say((getdoc(KINDS[chosen]) or "").splitlines()[0].replace("`", ""), remark=True)
        self._forms[chosen][1].update()

    def _changed(self, kind: str, excitation: Excitation | None) -> None:
        with self._lock:
            # `_begin_with` fills the form of another kind before it is shown.
            if kind_word(kind) != self._kind.value:
                return
            self._use.disabled = self._save.disabled = excitation is None
            self._figure.visible = self._numbers.visible = excitation is not None or kind != "points"
            drawn, self._shown = self._shown, excitation
            if excitation is None:
                self._warnings.say("")
            elif excitation != drawn:
                self._show(excitation)
        self._compare()

    def _show(self, excitation: Excitation) -> None:
        self._last = self._session.waveform = excitation
        wave, word = excitation.waveform(), kind_word(excitation.kind)
        order, needed = wave.order_of_excitation(), needed_orders()
        self._figure.content = card(waveform_figure(wave), f"{word}: 100 points and their spectrum", (5.2, 3.5))
        self._warnings.say("; ".join(excitation_warnings(excitation)))
        self._numbers.content = table((), excitation_rows(excitation))
        head = ("model of the study", "needs", "has")
        rows = [(model, str(needed_order), str(order)) for model, needed_order in needed.items()]
        too_poor = [row for row, needed_order in enumerate(needed.values()) if needed_order > order]
        self._orders.content = table(head, rows, red=too_poor)
        self._recipe.refresh()

    def _compare(self) -> None:
        """Say whether the experiment plays what is shown."""
        scenario = self._session.scenario
        if self._axis.options != (options := (EVERY_AXIS, *scenario.axes)):
            self._axis.options = options
        self._axis.visible = len(scenario.axes) > 1
        played = self._played()
        self._follows = bool(played) and all(excitation == self._shown for excitation in played)
        kinds = dict.fromkeys(kind_word(excitation.kind) for excitation in played)
        shown_kinds = ", ".join(kinds) or "nothing: an operator has the stick"
        if self._shown is None:
            state = "The figure shows the last waveform without error" if self._figure.visible else ""
        elif self._follows:
            state = f"{scenario.name} plays this"
        else:
            state = f"{scenario.name} does not play this yet, it plays {shown_kinds}"
        self._state.say(state, remark=True)

    def _played(self) -> list[Excitation]:
        """What the experiment plays on the axis that is chosen, or on every axis."""
        played = self._session.scenario.played()
        return [played[self._axis.value]] if self._axis.value in played else list(played.values())

    def _prepared(self) -> None:
        followed = self._follows
        self._compare()
        # What was entered here and is not used yet stays, whatever happens to the experiment.
        if followed and not self._follows and self._played() and self._played()[0].kind in SHOWN:
            self._take_out()

    def _put_in(self) -> None:
        if self._shown is None:
            raise ScenarioError("a field is wrong: its message says what is expected")
        axis = None if self._axis.value == EVERY_AXIS else self._axis.value
        self._session.prepare(self._session.scenario.with_excitation(self._shown, axis))

    def _take_out(self) -> None:
        if not (played := self._played()):
            raise ScenarioError(f"{self._session.scenario.name} plays nothing: an operator has the stick")
        self._begin_with(played[0], "points.txt")

    def _begin_with(self, excitation: Excitation, file: str) -> None:
        if excitation.kind not in SHOWN:
            raise ScenarioError(
                "the experiment plays a record of its scenario file; expected an excitation of the list above"
            )
        if excitation.kind == "points":
            # A form has no field for points: they are kept beside it.
            self._points, self._session.waveform_file = excitation.parameters["points"], file
        form = self._forms[excitation.kind][1]
        form.set({name: value for name, value in values_of(excitation).items() if name in form.handles})
        self._kind.value = kind_word(excitation.kind)
        self._pick()
        self._recipe.refresh()

    def _load(self, name: str, content: bytes) -> None:
        if len(content) > LARGEST_FILE:
            raise ScenarioError(
                f"waveform file {name!r}: {len(content)} bytes, expected 100 numbers in at most {LARGEST_FILE} bytes"
            )
        excitation = Excitation("points", {"points": parse_points(content, name)})
        check_excites(excitation)
        self._begin_with(excitation, name)

    def _save_points(self) -> None:
        kind, file = self._last.kind, self._session.waveform_file
        stem = Path(file).stem if kind == "points" else kind
        content = points_text(self._last.waveform().points.tolist()).encode()
        self._client.send_file_download(f"{stem}.txt", content, save_immediately=True)
