"""The Identify tab: data, estimator and orders in; models side by side with their verdicts and figures out."""

import shlex
import threading
from math import inf
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Any

from scenarios.experiments.scenario import known_arm
from scenarios.files.errors import ScenarioError
from scenarios.identification.comparison_figures import FIGURES
from scenarios.identification.file_identification import IdentificationRequest
from scenarios.identification.methods import ESTIMATORS
from scenarios.identification.model_display import identification_recipe, model_list, numbers
from scenarios.station.fields import Field, Form, Message, reporting
from scenarios.station.recipe import RecipeView
from scenarios.station.session import Session
from sysid import write_model
from sysid.selection.structure_search import ORDERS

if TYPE_CHECKING:
    import viser

    from scenarios.station.desk import Desk

FILE, EXCITED, CHOICE = "a file", "the excited one", "choose for me"
"""Choices of no record of the session, of the joint that the record names, and of no estimator."""

SHARES = {"the same samples": 0.0, "its last quarter": 0.25, "its second half": 0.5}
"""Parts of the record that judge the model, by their words."""

_LISTED = {f"{method.name.upper()}: {method.title}": method.name for method in ESTIMATORS.values() if not method.words}

MENU = {CHOICE: None, **_LISTED}
"""Estimators by the words of the menu."""

LIMITS = {"nb": (1, 10), "nf": (0, 10), "order": (1, 12), "p": (1, 60)}
"""Ends of the sliders of orders; others go from 0 to 10."""

TABLE = ("input", "output", "dt", "time", "time_unit", "test", "missing")
"""Fields of files from elsewhere."""

PRETREATMENT, COLUMNS = "Pretreatment and prediction", "Columns of the table"
"""Folders of rare fields."""


def fields(records: tuple[str, ...], shown: str, joints: tuple[str, ...]) -> tuple[Field, ...]:
    """The fields that say which data to take, and how."""
    start = shown or FILE
    return (
        Field("record", "record", start, (*records, FILE)),
        Field("file", "file", "", hint="path of a log, a record, or a table; several separated by semicolons"),
        Field("joint", "joint", EXCITED, (EXCITED, *joints)),
        Field("validate", "validate on", "its last quarter", (*SHARES, *records, FILE)),
        Field("other", "validation file", ""),
        Field("skip", "leave out start / s", 0.0, folder=PRETREATMENT),
        Field("keep_mean", "keep means", initial=False, folder=PRETREATMENT, hint="no operating point"),
        Field("steps", "steps ahead", 1, folder=PRETREATMENT, hint="horizon of a further prediction, samples"),
        Field("input", "inputs", "u", folder=COLUMNS, hint="names of columns, separated by commas"),
        Field("output", "outputs", "y", folder=COLUMNS, hint="names of columns, separated by commas"),
        Field("dt", "interval / s", None, folder=COLUMNS, hint="of a table without times", optional=float),
        Field("time", "times", "", folder=COLUMNS, hint="name of the column, when it is not t, time or the like"),
        Field("time_unit", "unit of times", "", folder=COLUMNS, hint="s, ms, us, ns, min, h or days"),
        Field("missing", "missing outputs", initial=False, folder=COLUMNS, hint="outputs may have empty cells or NaN"),
        Field("test", "test of a record", "", folder=COLUMNS, hint="name or number, where a 1553 record holds several"),
    )


def checked(session: Session, values: dict[str, Any]) -> dict[str, Any]:
    """The values of the fields as options of an identification, with the record and what judges beside.

    Raises:
        ScenarioError: A value that no record can go with.
    """
    for name, smallest, unit in (("steps", 1, "sample"), ("skip", 0, "s")):
        if not values[name] >= smallest:
            raise ScenarioError(f"expected {smallest} {unit} or more, given {values[name]:g}")
    for name in ("input", "output"):
        values[name] = tuple(column.strip() for column in values[name].split(",") if column.strip())
        if not values[name]:
            raise ScenarioError("expected the name of a column, or several separated by commas")
    if values["dt"] is not None and not 0.0 < values["dt"] < inf:
        raise ScenarioError(f"expected more than 0 s, given {values['dt']:g} s")
    for name in ("time", "time_unit", "test", "other"):
        values[name] = values[name] or None
    values["joint"] = () if values["joint"] == EXCITED else (values["joint"],)
    values["file"] = tuple(Path(path.strip()) for path in values["file"].split(";") if path.strip())
    values["other"] = values["other"] and Path(values["other"])
    for path in filter(None, (*values["file"], values["other"])):
        if not path.exists():
            raise ScenarioError(f"there is no file {str(path)!r}")
        if not path.is_file() and not path.is_dir():
            raise ScenarioError(f"{str(path)!r} is neither a file nor a folder")  # a pipe or device may never end
    log = session.records.get(values["record"])
    if log is not None:
        if values["skip"] >= len(log) * log.dt:
            raise ScenarioError(f"expected less than the {len(log) * log.dt:g} s of the record")
        if not values["joint"] and (len(log.axes) != 1 or log.axes[0] not in log.joints):
            raise ScenarioError(f"{log.name} moves {', '.join(log.axes)}: choose the joint")
    return values


class IdentifyTab:
    """Fields of an identification, the models that it gave, their numbers and figures.

    Args:
        station: The station.
        client: The browser that steers it.
    """

    title = "Identify"

    def __init__(self, station: "Desk", client: "viser.ClientHandle") -> None:
        self._station, self._client, self._models = station, client, station.identified
        self._lock = threading.RLock()
        self._revision, self._record = -1, station.session.shown
        gui = client.gui
        self._form = Form(
            gui,
            fields(tuple(station.session.records), station.session.shown, known_arm(station.session.arm).joints),
            lambda values: checked(station.session, dict(values)),
            lambda _: self._arrange(),
        )
        self._estimator = gui.add_dropdown("estimator", tuple(MENU))
        self._choose = gui.add_checkbox("choose orders", initial_value=False)
        self._orders = gui.add_folder("Orders")
        self._sliders: dict[str, Any] = {}
        self._wanted: dict[str, int] = {}
        self._estimator.on_update(lambda _: self._arrange())
        self._choose.on_update(lambda _: self._arrange())
        self._run = gui.add_button("Identify", color="green")
        self._run.on_click(reporting(client, lambda: self._models.identify(self.request())))
        self._stop = gui.add_button("Stop", color="red", visible=False)
        self._stop.on_click(reporting(client, station.work.stop))
        self._progress = gui.add_progress_bar(100.0, animated=True, visible=False)
        self._state = Message(gui)
        self._results = gui.add_folder("Models", visible=False)
        with self._results:
            self._list = gui.add_html("")
            self._boxes = gui.add_folder("Shown in the figures", expand_by_default=False)
            self._shown: dict[int | str, Any] = {}
            self._selected: Any = gui.add_dropdown("numbers of", ("",))
            self._selected.on_update(lambda _: self._select())
            self._action = gui.add_button_group("this model", ("save as JSON", "remove"))
            self._action.on_click(reporting(client, self._act))
            tabs = gui.add_tab_group()
            self._cards: dict[str, Any] = {}
            for name in ("Numbers", *FIGURES):
                with tabs.add_tab(name):
                    self._cards[name] = gui.add_html("")
        self._recipe = RecipeView(client, lambda: identification_recipe(list(self._models.listed.values())))
        station.session.watch(self._refresh)
        self._arrange()
        self._refresh()

    def _arrange(self) -> None:
        """Show the form fields and order sliders of the chosen record and estimator; hide the others."""
        handles, method = self._form.handles, MENU[self._estimator.value]
        self._form.folders[COLUMNS].visible = handles["file"].visible = handles["record"].value == FILE
        handles["other"].visible = handles["validate"].value == FILE
        self._choose.visible = method in ORDERS
        defaults: dict[str, int] = {}
        if method is not None and not (method in ORDERS and self._choose.value):
            # Order two is a start for every structure; what the estimator has a default for keeps it.
            estimator = ESTIMATORS[method]
            defaults = dict.fromkeys(estimator.orders, 2)
            for name, order in estimator.optional.items():
                defaults[name] = int(order)
        self._orders.visible = bool(defaults)
        # The same sliders stay, with the orders that were set.
        if tuple(defaults) == tuple(self._sliders):
            return
        # Orders that were set come back with the next estimator that has them.
        self._wanted |= {name: slider.value for name, slider in self._sliders.items()}
        for slider in self._sliders.values():
            slider.remove()
        with self._orders:
            self._sliders = {}
            for name, default in defaults.items():
                low, high = LIMITS.get(name, (0, 10))
                order = self._wanted.get(name, default)
                self._sliders[name] = self._client.gui.add_slider(name, low, high, 1, order)

    def request(self) -> IdentificationRequest:
        """What the fields ask for; records of the session are written to files.

        Raises:
            ScenarioError: A field is wrong.
        """
        options = self._form.checked()
        session, method = self._station.session, MENU[self._estimator.value]
        record, judge = options.pop("record"), options.pop("validate")
        file, judging_file = options.pop("file"), options.pop("other")
        if record != FILE:
            file = (session.file_of(record),)
            # Logs of the session name their channels and times themselves.
            options = {name: value for name, value in options.items() if name not in TABLE}
        if not file:
            raise ScenarioError("choose a record, or type the path of a file")
        options |= {"method": method, "orders": tuple(slider.value for slider in self._sliders.values())}
        if judge in SHARES:
            # The command line holds a quarter out where it chooses orders: what it does by itself is not stated.
            default = 0.0 if self._sliders else 0.25
            options["held_out"] = None if SHARES[judge] == default else SHARES[judge]
        elif judge != FILE:
            options["validate"] = session.file_of(judge)
        elif judging_file is not None:
            options["validate"] = judging_file
        else:
            raise ScenarioError("type the path of the file that judges the model")
        return IdentificationRequest(file, options)

    def _select(self) -> None:
        model_number = int(self._selected.value.partition(":")[0] or 0)
        if model_number in self._models.listed and model_number != self._models.selected:
            self._models.select(model_number)

    def _act(self) -> None:
        if self._action.value == "remove":
            self._models.remove(self._models.selected)
            return
        model = self._models.listed[self._models.selected]
        fitted = model.found.result.fitted
        estimate, orders = fitted.estimate, "-".join(map(str, fitted.orders.values()))
        name = f"{model.request.data[0].stem}-{estimate.method}-{orders}.json"
        # `write_model` writes a file; the browser wants its bytes.
        with TemporaryDirectory() as folder:
            command = shlex.join((*model.request.words, "--save", name))
            content = write_model(estimate, Path(folder) / name, command=command).read_bytes()
        self._client.send_file_download(name, content)

    def _refresh(self) -> None:
        """Show what the session and the models are now."""
        with self._lock:
            session, models, handles = self._station.session, self._models, self._form.handles
            names = tuple(session.records)
            # The last option is a file.
            if names != handles["record"].options[:-1]:
                handles["record"].options = (*names, FILE)
                handles["validate"].options = (*SHARES, *names, FILE)
            if session.shown != self._record:
                self._record = session.shown
                self._form.set({"record": session.shown or FILE})
            # Watchers are called for every change of the session, also where no model changed.
            if models.revision == self._revision:
                return
            self._revision, busy = models.revision, models.busy
            self._stop.visible = self._progress.visible = bool(busy)
            self._run.visible = not busy
            state = f"{busy} is under way ..." if busy else models.failure
            self._state.say(state, remark=bool(busy))
            self._results.visible = bool(models.listed)
            if models.listed:
                self._show_models()
            self._recipe.refresh()

    def _show_models(self) -> None:
        models = self._models
        if [*models.listed, "truth", "published"] != list(self._shown):
            self._build_boxes()
            self._selected.options = tuple(model.name for model in models.listed.values())
        selected = models.listed[models.selected]
        self._selected.value = selected.name
        contents = {name: models.figures.get(name, "") for name in FIGURES} | {"Numbers": numbers(selected)}
        for name, content in contents.items():
            # Figures are large: those that have not changed are not sent again.
            if self._cards[name].content != content:
                self._cards[name].content = content
        self._list.content = model_list(list(models.listed.values()), selected.known)

    def _build_boxes(self) -> None:
        models, gui = self._models, self._client.gui
        for box in self._shown.values():
            box.remove()
        labels: dict[int | str, tuple[str, str]] = {}
        for model_number, model in models.listed.items():
            labels[model_number] = (model.name, model.found.title)
        labels["truth"] = ("truth", "small-signal model of the arm")
        labels["published"] = ("printed", "models of the thesis")
        self._shown = {}
        with self._boxes:
            for key, (label, hint) in labels.items():
                checked_now = key not in models.hidden and key in {*models.listed, *models.beside}
                self._shown[key] = gui.add_checkbox(label, checked_now, hint=hint)
        for box in self._shown.values():
            box.on_update(lambda _: self._tick())

    def _tick(self) -> None:
        off = {key for key, box in self._shown.items() if not box.value}
        beside = tuple(key for key in ("truth", "published") if key not in off)
        self._models.show(hidden={key for key in off if isinstance(key, int)}, beside=beside)
