"""Figures of the thesis' kinds for records of one's own: what `hmtb figures` does, for programs."""

import warnings
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cache, partial
from pathlib import Path

from scenarios.files.data_file import Names, joints_of, read_parts
from scenarios.files.errors import ScenarioError, unknown
from scenarios.files.result_table import ResultTable
from scenarios.files.toml_file import package_table
from scenarios.identification.identification import usable
from scenarios.identification.model_comparison import comparison_table
from scenarios.record_figures import model_kinds, record_kinds
from scenarios.record_figures.drawing import Drawing, no_drawing
from scenarios.record_figures.figure_models import FigureModel, figure_models, model_names, on_record
from scenarios.record_figures.measured_record import Channels, MeasuredRecord
from scenarios.record_figures.model_kinds import JudgedRecord
from scenarios.report.figure_files import ReportFigure, thesis_numbers
from sysid import IOData, SysidError
from sysid.polynomial.fit_with_offset import subtract_means
from sysid.records.importers import one_interval

OF_RECORDS: Mapping[str, Callable[[Mapping[str, MeasuredRecord], Channels], Drawing]] = {
    draw.__name__: draw
    for draw in (record_kinds.record, record_kinds.transfer, record_kinds.correlations, record_kinds.spectra)
}
"""Kinds of figures that need no model."""

OF_MODELS: Mapping[str, Callable[[Mapping[str, JudgedRecord], Channels], Drawing]] = {
    draw.__name__: draw
    for draw in (
        model_kinds.bode,
        model_kinds.markov,
        model_kinds.errors,
        model_kinds.hankel,
        model_kinds.roots,
        model_kinds.outputs,
        model_kinds.residuals,
        model_kinds.tests,
    )
}
"""Kinds of figures of models."""

KINDS = (*OF_RECORDS, *OF_MODELS)
"""Every kind of figure, in the sequence of the page."""


@dataclass(frozen=True)
class LeftOut:
    """A figure, or views of one, that the records do not give.

    Attributes:
        kind: Kind of the figure; `models` for a model.
        reason: Why, in one line.
    """

    kind: str
    reason: str


@dataclass(frozen=True, eq=False)
class RecordFigures:
    """Figures of records.

    Attributes:
        figures: The figures by kind.
        headings: Their headings.
        models: The models in them.
        judged: The records with the models on them, by name; empty where no figure needs models.
        left_out: What is not drawn.
        warnings: Remarks on the files and the models.
    """

    figures: Mapping[str, ReportFigure]
    headings: Mapping[str, str]
    models: tuple[FigureModel, ...]
    judged: Mapping[str, JudgedRecord]
    left_out: tuple[LeftOut, ...]
    warnings: tuple[str, ...]

    def tables(self) -> tuple[ResultTable, ...]:
        """Fits, bandwidths and gains of the models on every record, and their orders."""
        tables = []
        for name, judged in self.judged.items():
            first = judged.measured.longest
            samples = sum(map(len, judged.measured.parts))
            title = f"Models on {name}, {samples} samples every {first.dt:g} s"
            models = [model.judged for model in judged.models]
            if models:
                tables.append(comparison_table(models, first.output_names or (), title))
        orders = [(model.label, model.orders) for model in self.models if model.orders not in model.label]
        if orders:
            tables.append(ResultTable("Orders, output by output", ("model", "orders"), tuple(orders)))
        return tuple(tables)


@cache
def kind_table() -> Mapping[str, Mapping[str, str]]:
    """Heading, caption and figures of the thesis of every kind."""
    return package_table("record_figures.toml")


def checked_kinds(kinds: Sequence[str]) -> tuple[str, ...]:
    """Kinds of figures in the sequence of the page; all where none are named.

    Raises:
        ScenarioError: A kind that does not exist.
    """
    for kind in kinds:
        if kind not in KINDS:
            raise ScenarioError(unknown("kind of figure", kind, KINDS))
    return tuple(kind for kind in KINDS if not kinds or kind in kinds)


def record_figures(
    data: Sequence[Path],
    *,
    kinds: Sequence[str] = (),
    models: Sequence[str] = (),
    joint: Names = (),
    input: Names = "u",
    output: Names = "y",
    dt: float | None = None,
    time: str | None = None,
    time_unit: str | None = None,
    test: str | None = None,
    missing: bool = False,
    skip: float = 0.0,
    keep_mean: bool = False,
    progress: Callable[[int, int, str], None] | None = None,
) -> RecordFigures:
    """Draw figures of records; arguments are the options of `hmtb figures`, which describes them.

    Args:
        data: The record, from which models are identified, and others that judge them.
        kinds: Some of `KINDS`; none stand for all.
        models: Names of models; none stand for those of the thesis' figures.
        joint: Joint of a log, or several; the excited one when none is named.
        input: Names of the input columns of a table.
        output: Names of the output columns.
        dt: Sampling interval of a table without one, s.
        time: Name of the column of times.
        time_unit: Unit of the times.
        test: Which test of a 1553 record.
        missing: Whether outputs may be missing.
        skip: Length of the start that is left out, s.
        keep_mean: Whether to use the values as they are, without an operating point.
        progress: Called with the steps that are done, those in all, and the name of the next.

    Raises:
        ScenarioError: Kinds or models that do not exist, files that cannot be read or used.
        TwinError: Likewise, of our own logs and records.
        SysidError: Records with other channels than the first.
    """
    drawn_kinds = checked_kinds(kinds)
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always", UserWarning)
        read = partial(read_parts, input=input, output=output, dt=dt, time=time, time_unit=time_unit, missing=missing)
        records = _measured(data, partial(read, test=test), joint, skip=skip, keep_mean=keep_mean, test=test)
    remarks = [str(warning.message) for warning in caught]
    first = next(iter(records.values()))
    channels = Channels.of(first.longest)
    of_models = [kind for kind in drawn_kinds if kind in OF_MODELS]
    names = model_names(models, first.longest.ny) if of_models else []
    steps = len(drawn_kinds) + (len(names) > 0)
    tell = progress or (lambda done, total, step: None)
    left_out: list[LeftOut] = []
    used: tuple[FigureModel, ...] = ()
    judged: dict[str, JudgedRecord] = {}
    # Models come first: they take nearly all the time, and a wrong name should fail before anything is drawn.
    if names:
        tell(0, steps, "models")
        used, refused = figure_models(names, first)
        left_out += [LeftOut("models", line) for line in refused]
        for name, measured in records.items():
            judged[name] = JudgedRecord(measured, tuple(on_record(model, measured) for model in used))
        for model in used:
            # Remarks on printed models name their equation themselves.
            subject = "" if model.kind == "published" else f"{model.label}: "
            remarks += [f"{subject}{remark}" for remark in model.remarks]
    figures: dict[str, ReportFigure] = {}
    headings: dict[str, str] = {}
    for number, kind in enumerate(drawn_kinds, start=steps - len(drawn_kinds)):
        tell(number, steps, kind)
        drawing = _drawing(kind, records, judged if used else {}, channels)
        left_out += [LeftOut(kind, reason) for reason in drawing.reasons]
        if drawing.chart.views:
            row = kind_table()[kind]
            figures[kind] = ReportFigure(kind, drawing.chart, _caption(row), thesis_numbers(row["thesis"]))
            headings[kind] = row["heading"]
    return RecordFigures(figures, headings, used, judged, tuple(left_out), tuple(remarks))


def _measured(
    data: Sequence[Path],
    read: Callable[..., tuple[IOData, ...]],
    joint: Names,
    *,
    skip: float,
    keep_mean: bool,
    test: str | None,
) -> dict[str, MeasuredRecord]:
    """Records by the names of their files, with the same channels.

    Raises:
        ScenarioError: No record, two of one name, or other channels than those of the first.
    """
    if not data:
        raise ScenarioError("expected the path of a record; see hmtb figures --help")
    records: dict[str, MeasuredRecord] = {}
    joints = joint
    for path in data:
        parts = usable(read(path, joint=joints or None), skip, path, test)
        first = parts[0]
        # The other logs are read for the same joints, whichever they excite.
        joints = joints or joints_of(first)
        if path.stem in records:
            raise ScenarioError(f"{path} given beside another file of that name; expected files with other names")
        # Spectra and correlations are those of the motion about the operating point, as in the thesis.
        about = tuple(parts) if keep_mean else tuple(subtract_means(parts))
        records[path.stem] = MeasuredRecord(path.stem, path, about, keep_mean)
        expected = next(iter(records.values())).longest
        if (first.input_names, first.output_names) != (expected.input_names, expected.output_names):
            raise ScenarioError(
                f"{path.name} has the channels {_channels(first)}, {data[0].name} has {_channels(expected)}; expected "
                "the same"
            )
    # Records of other sampling intervals are refused, with both intervals.
    one_interval([measured.longest for measured in records.values()])
    return records


def _channels(record: IOData) -> str:
    return ", ".join((*(record.input_names or ()), *(record.output_names or ())))


def _drawing(
    kind: str, records: Mapping[str, MeasuredRecord], judged: Mapping[str, JudgedRecord], channels: Channels
) -> Drawing:
    """A figure of a kind; what the records cannot give has a reason."""
    try:
        if kind in OF_RECORDS:
            return OF_RECORDS[kind](records, channels)
        if not judged:
            return no_drawing("no model could be identified")
        return OF_MODELS[kind](judged, channels)
    except SysidError as error:
        return no_drawing(str(error))


def _caption(row: Mapping[str, str]) -> str:
    """Caption of a kind, with the figures of the thesis that show it."""
    numbers = row["thesis"].replace("-", "–").split()
    plural = "s" if len(numbers) > 1 or "–" in numbers[0] else ""
    listed = f"{', '.join(numbers[:-1])} and {numbers[-1]}" if len(numbers) > 1 else numbers[0]
    return f"{row['caption']} In the thesis: figure{plural} {listed}."
