"""Identified models as a page shows them: identified, drawn and listed side by side, with their numbers."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import matplotlib
import numpy as np

from hmtb_twin import TwinError
from scenarios.experiments.recipe import Recipe
from scenarios.files.data_file import joints_of
from scenarios.files.errors import ScenarioError
from scenarios.identification.comparison_figures import StyledModel, side_by_side
from scenarios.identification.file_identification import FileIdentification, IdentificationRequest
from scenarios.identification.model_comparison import (
    JudgedModel,
    compare_models,
    judged_identification,
    records_about_means,
)
from scenarios.identification.named_models import ModelName
from scenarios.identification.result_tables import result_tables
from scenarios.report.figures import SETTINGS
from scenarios.report.html_pieces import card, listing, table
from sysid.plots import PALETTE, Style

WIDTH = 4.8
"""Width of a figure, inch: at that of the panel, letters are as large as its text."""

COLUMNS = ("model", "fit / %", "bandwidth / Hz", "95 % interval / Hz", "holds truth")
"""Columns of the list of models."""


@dataclass(frozen=True, eq=False)
class IdentifiedModel:
    """A model in the list of the page.

    Attributes:
        request: What was asked for.
        found: The model, as `hmtb identify` gives it.
        judged: The same model for comparisons.
        known: Truth and printed models on the record that judges the model.
        remarks: Why there is no truth or no printed model.
        style: Its colour and line in all figures.
    """

    request: IdentificationRequest
    found: FileIdentification
    judged: JudgedModel
    known: tuple[JudgedModel, ...]
    remarks: tuple[str, ...]
    style: Style

    @property
    def name(self) -> str:
        """Method and orders; in the list with a number."""
        return self.judged.label

    def renamed(self, name: str, style: Style) -> "IdentifiedModel":
        """Return the model with another name and style."""
        return replace(self, judged=replace(self.judged, label=name), style=style)


def identify_request(request: IdentificationRequest) -> IdentifiedModel:
    """Identify a model, and judge truth and printed models on the same record; raises what `identify_files` raises."""
    found = request.run()
    judged = judged_identification(found.result, records_about_means(found.result))
    known, remarks = known_beside(found, request.data[0])
    return IdentifiedModel(request, found, judged, known, remarks, PALETTE[judged.kind])


def known_beside(found: FileIdentification, path: Path) -> tuple[tuple[JudgedModel, ...], tuple[str, ...]]:
    """Judge the truth and the printed models of a joint on the record that judges a model.

    Args:
        found: The model.
        path: Its file: the truth is that of the log's arm.

    Returns:
        The models, and why there is no truth or no printed model; neither for records that are of no single joint.
    """
    records = [record.retrend() for record in found.result.checked]
    if len(joints_of(records[0])) != 1:
        return (), ()
    # As the identified model was judged, so that the fits compare.
    keep_mean = found.result.fitted.estimate.operating_point is None
    judged: list[JudgedModel] = []
    remarks: list[str] = []
    for kind, words in (("truth", "truth"), ("published", "printed model")):
        try:
            _, models = compare_models([ModelName(kind, kind)], records, path, keep_mean=keep_mean)
            judged += models
        # A foreign record has neither; the page says so beside the model.
        except (ScenarioError, TwinError) as error:
            remarks.append(f"no {words}: {error}")
    return tuple(judged), tuple(remarks)


def draw_figures(models: Sequence[IdentifiedModel], kinds: Sequence[str]) -> dict[str, str]:
    """Draw models side by side, and beside them what is known of these kinds: cards by the names of the figures."""
    drawn = [StyledModel(model.judged, model.style) for model in models]
    beside = [known for known in models[0].known if known.kind in kinds]
    names = ", ".join(model.name for model in models)
    cards = {}
    with matplotlib.rc_context(SETTINGS):
        for title, items in side_by_side(drawn, beside, WIDTH).items():
            pieces = []
            for item in items:
                pieces.append(listing([item]) if isinstance(item, str) else card(item, f"{title}: {names}"))
            cards[title] = "".join(pieces)
    return cards


def identification_recipe(models: Sequence[IdentifiedModel]) -> Recipe:
    """Commands and Python that reproduce the models without the page."""
    calls = ",\n    ".join(model.request.python for model in models)
    python = (
        "from pathlib import Path\n\n"
        "from scenarios.identification.file_identification import identify_files\n"
        "from scenarios.identification.result_tables import result_tables\n\n"
        f"models = [\n    {calls},\n]\n"
        "for model in models:\n"
        "    for table in result_tables(model):\n"
        '        print(table.title, *map("  ".join, table.rows), sep="\\n")'
    )
    return Recipe([model.request.words for model in models], python)


def model_list(models: Sequence[IdentifiedModel], known: Sequence[JudgedModel]) -> str:
    """Models with their colours, and beside them the truth and printed models."""
    rows = [(*_list_row(model.judged), holds_truth(model.judged, model.known)) for model in models]
    rows += [(*_list_row(judged), "") for judged in known]
    colours = [model.style.colour for model in models] + [PALETTE[judged.kind].colour for judged in known]
    return table(COLUMNS, rows, colours=colours)


def _list_row(judged: JudgedModel) -> tuple[str, str, str, str]:
    """Name, fit in simulation, bandwidth and 95 % interval; with several paths no single bandwidth is shown."""
    fits = ", ".join(f"{value:.2f}" for value in judged.fit.simulation)
    if judged.bandwidth_hz.size > 1:
        return judged.label, fits, "several", ""
    return judged.label, fits, *judged.bandwidth_cells(0, 0)


def holds_truth(judged: JudgedModel, known: Sequence[JudgedModel]) -> str:
    """Whether the interval of the bandwidth holds that of the truth: yes or no; nothing where one is not known."""
    low, high = judged.ci95[0, 0]
    truths = [model.bandwidth_hz[0, 0] for model in known if model.kind == "truth"]
    if not truths or not np.isfinite([truths[0], low]).all():
        return ""
    return "yes" if low <= truths[0] <= high else "no"


def numbers(model: IdentifiedModel) -> str:
    """What `hmtb identify` prints of a model."""
    pieces = [listing([*(f"warning: {text}" for text in model.found.warnings), *model.remarks])]
    for result_table in result_tables(model.found):
        columns = result_table.columns if any(result_table.columns) else ()
        pieces.append(listing([result_table.title]) + table(columns, result_table.rows))
    return "".join(pieces)
