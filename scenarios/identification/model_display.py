"""Identified models as a page shows them: identified, drawn and listed side by side, with their numbers."""

from collections.abc import Sequence
from dataclasses import dataclass

import matplotlib

from scenarios.experiments.recipe import Recipe
from scenarios.identification.file_identification import FileIdentification
from scenarios.identification.model_comparison import JudgedModel
from scenarios.identification.request import IdentificationRequest
from scenarios.identification.result_tables import result_tables
from scenarios.identification.side_by_side import DrawnModel, bandwidth_row, holds_truth, known_models, side_by_side
from scenarios.report.figures import SETTINGS
from scenarios.report.html_pieces import card, listing, table
from sysid.plots import PALETTE, Style

WIDTH = 4.8
"""Width of a figure, inch: at that of the panel, letters are as large as its text."""


@dataclass(frozen=True, eq=False)
class IdentifiedModel:
    """A model in the list of the page.

    Attributes:
        request: What was asked for.
        found: The model.
        known: Truth and printed models on the record that judges the model.
        remarks: Why there is no truth or no printed model.
        name: Method and orders; in the list with a number.
        style: Its colour and line in all figures.
    """

    request: IdentificationRequest
    found: FileIdentification
    known: tuple[JudgedModel, ...]
    remarks: tuple[str, ...]
    name: str
    style: Style


def identify_request(request: IdentificationRequest) -> IdentifiedModel:
    """Identify a model, and judge truth and printed models on the same record; raises what `identify_files` raises."""
    found = request.run()
    fitted = found.result.fitted
    name = f"{fitted.estimate.method.upper()} {'/'.join(map(str, fitted.orders.values()))}"
    known, remarks = known_models(found, request.data[0])
    return IdentifiedModel(request, found, known, remarks, name, PALETTE[fitted.estimate.method])


def draw_figures(models: Sequence[IdentifiedModel], kinds: Sequence[str]) -> dict[str, str]:
    """Draw models side by side, and beside them what is known of these kinds: cards by the names of the figures."""
    drawn = [DrawnModel(one.name, one.found.result, one.style) for one in models]
    beside = [one for one in models[0].known if one.kind in kinds]
    names = ", ".join(one.name for one in drawn)
    with matplotlib.rc_context(SETTINGS):
        return {
            title: "".join(
                listing([one]) if isinstance(one, str) else card(one, f"{title}: {names}") for one in figures
            )
            for title, figures in side_by_side(drawn, beside, WIDTH).items()
        }


def identification_recipe(models: Sequence[IdentifiedModel]) -> Recipe:
    """Commands and Python that reproduce the models without the page."""
    calls = ",\n    ".join(one.request.python for one in models)
    python = (
        "from pathlib import Path\n\n"
        "from scenarios.identification.file_identification import identify_files\n"
        "from scenarios.identification.result_tables import result_tables\n\n"
        f"models = [\n    {calls},\n]\n"
        "for model in models:\n"
        "    for table in result_tables(model):\n"
        '        print(table.title, *map("  ".join, table.rows), sep="\\n")'
    )
    return Recipe([one.request.words for one in models], python)


def model_list(models: Sequence[IdentifiedModel], known: Sequence[JudgedModel]) -> str:
    """Models with their colours, and beside them the truth and printed models."""
    rows = [(one.name, *bandwidth_row(one.found), holds_truth(one.found, one.known)) for one in models]
    rows += [(one.label, *bandwidth_row(one), "") for one in known]
    colours = [one.style.colour for one in models] + [PALETTE[one.kind].colour for one in known]
    return table(("model", "fit / %", "bandwidth / Hz", "95 % interval / Hz", "holds truth"), rows, colours=colours)


def numbers(model: IdentifiedModel) -> str:
    """What `hmtb identify` prints of a model."""
    pieces = [listing([f"warning: {text}" for text in model.found.warnings] + list(model.remarks))]
    pieces += [
        listing([part.title]) + table(part.columns if any(part.columns) else (), part.rows)
        for part in result_tables(model.found)
    ]
    return "".join(pieces)
