"""`hmtb figures`: figures of the thesis' kinds for records of one's own."""

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import tyro

from scenarios.commands.output import output_folder, print_json, print_table, print_tables, progress, say, say_each
from scenarios.commands.usage import command_line
from scenarios.files.errors import ScenarioError, unknown
from scenarios.files.printable import counted

if TYPE_CHECKING:
    from scenarios.record_figures.record_figures import RecordFigures

PAGE = "figures.html"
"""Page with all figures."""

KINDS = (
    *("record", "transfer", "correlations", "spectra", "bode", "markov", "errors", "hankel"),
    *("roots", "outputs", "residuals", "tests"),
)
"""Kinds of figures; here too, because help texts load nothing that draws."""

FORMATS = ("svg", "png", "csv")
"""Formats of --format."""


def figures(
    data: Annotated[tuple[Path, ...], tyro.conf.Positional, tyro.conf.arg(metavar="LOG ...")],
    *,
    kinds: Annotated[tuple[str, ...], tyro.conf.arg(metavar="|".join(KINDS))] = (),
    models: Annotated[tuple[str, ...], tyro.conf.arg(metavar="MODEL...")] = (),
    joint: Annotated[tuple[str, ...], tyro.conf.arg(metavar="NAME...")] = (),
    input: tuple[str, ...] = ("u",),
    output: tuple[str, ...] = ("y",),
    dt: float | None = None,
    time: str | None = None,
    time_unit: str | None = None,
    test: str | None = None,
    missing: bool = False,
    skip: float = 0.0,
    keep_mean: bool = False,
    format: str = "svg",
    out: Path | None = None,
    overwrite: bool = False,
    json: bool = False,
) -> int:
    """Draw the kinds of figures of the thesis for any record.

    Kinds of figures, with the figures of the thesis that they resemble:

      record         inputs and outputs, whole and magnified (20 to 26, 66)
      transfer       transfer function by a Hamming window (22)
      correlations   of output, input, and both, and the pulse response (25)
      spectra        of disturbance, output and input, and the cross spectrum (27 to 30)
      bode           several models on one Bode plot (49, 58 to 63)
      markov         Markov parameters of system and observer (50)
      errors         prediction and smoothing errors of observers (51)
      hankel         Hankel singular values (52)
      roots          poles and transmission zeros, also of multivariable models (41, 64, 65)
      outputs        measured and simulated outputs (42, 43, 67 to 69, 73 to 75)
      residuals      one step ahead, output by output (39, 70, 76)
      tests          whiteness and independence of them, pair by pair (40, 71, 72, 77, 78)

    Models are identified from the first record, each method with orders and delay of its own choice unless they are
    given, and judged on every record: the others validate them. Several joints or outputs give multivariable models: a
    method of one output (arx, armax, oe, bj, iv4) gives a block for each joint, as the thesis' SysID model, one of
    several (okid, n4sid, pem_ss) the response of every path. What a record cannot give is named with the reason, and
    the rest is drawn. The smoothing error, which the thesis does not define, is that of the best estimate of a sample
    from p samples on both sides of it. Files are read as identify reads them.

      hmtb figures siso-5-elbow_pitch.nc
      hmtb figures siso-5-elbow_pitch.nc siso-8-elbow_pitch.nc --models armax:2/2/2/2 okid:2/5 truth
      hmtb figures mimo-7-independent.nc rpcm.nc --joint shoulder_yaw shoulder_pitch elbow_pitch
      hmtb figures robot.csv --input command --output angle --kinds spectra bode --format svg,png,csv

    Args:
        data: The record, or several with the same channels.
        kinds: Kinds of figures; all when none is named.
        models: Models, named as for hmtb compare, or by a method alone, whose orders are then chosen (of okid that of
            least BIC with 5 observer Markov parameters); by default arx, armax, oe and okid, of several outputs armax
            and okid.
        joint: Which joint of a log, or several of one; the excited one when not given.
        input: Names of the input columns of a table, or variables of a .mat or .nc file.
        output: Names of the output columns, likewise.
        dt: Sampling interval of a table without one, s.
        time: Name of the column of times, when it is not t, time, stamp or the like.
        time_unit: Unit of the times: s, ms, us, ns, min, h or days.
        test: Which test of a 1553 record, by name or number.
        missing: Outputs may be missing, as NaN or empty cells; inputs must be complete. Gaps of the times still cut.
        skip: Leave out this much of the start of every record, s.
        keep_mean: Use the values as they are, without an operating point.
        format: Formats of the files of the figures, comma-separated: svg, png, and csv, the values of the curves.
        out: Folder for figures.html, a page with all figures, and the files of the figures; NAME-figures of the first
            record when not given.
        overwrite: Replace files that exist, without a question.
        json: Print JSON.
    """
    options = locals()  # before any other local variable: all options, for the command on the page
    typed = command_line("hmtb figures", figures, {**options, "out": None, "overwrite": False, "json": False})
    from scenarios.record_figures.figure_page import write_figure_page
    from scenarios.record_figures.record_figures import checked_kinds, record_figures
    from scenarios.report.figure_files import write_figures

    formats = _checked_formats(format)
    drawn_kinds = checked_kinds(kinds)
    if len(set(joint)) < len(joint):
        raise ScenarioError(f"--joint {' '.join(joint)} given, expected each joint once")
    if not data:
        raise ScenarioError("expected the path of a record; see hmtb figures --help")
    # In the folder where the command runs, not beside the record, which may be read-only.
    folder_path = out or Path(f"{data[0].stem}-figures")
    replaced = _replaced_files(folder_path, drawn_kinds, formats)
    with output_folder(folder_path, *replaced, overwrite=overwrite) as folder:
        with progress("figures") as show:
            drawn = record_figures(
                data,
                kinds=kinds,
                models=models,
                joint=joint,
                input=input,
                output=output,
                dt=dt,
                time=time,
                time_unit=time_unit,
                test=test,
                missing=missing,
                skip=skip,
                keep_mean=keep_mean,
                progress=show,
            )
        # An empty page would look like success.
        if not drawn.figures:
            reasons = "; ".join(dict.fromkeys(item.reason for item in drawn.left_out))
            raise ScenarioError(f"{data[0].name} gives no figure: {reasons}")
        with progress("files"):
            files = write_figures(drawn.figures.values(), folder, formats)
            title = f"Figures of {', '.join(path.name for path in data)}"
            page = write_figure_page(drawn, folder / PAGE, title, typed)
    if json:
        print_json(_json_record(drawn, page, files))
        return 0
    _print(drawn, folder_path, page, files)
    return 0


def _checked_formats(text: str) -> tuple[str, ...]:
    """Formats of the files of figures.

    Raises:
        ScenarioError: A format that does not exist, or none.
    """
    formats = tuple(word.strip() for word in text.split(",") if word.strip())
    for word in formats or ("",):
        if word not in FORMATS:
            raise ScenarioError(unknown("format", word, FORMATS))
    return formats


def _replaced_files(out: Path, kinds: Sequence[str], formats: Sequence[str]) -> list[str]:
    """Names of the files that the figures may replace, relative to their folder."""
    # Which views there will be, only the records tell: those of earlier figures of these kinds stand for them.
    files = [PAGE]
    for kind in kinds:
        for ending in formats:
            files += [path.name for path in sorted(out.glob(f"{kind}*.{ending}"))]
    return files


def _json_record(drawn: "RecordFigures", page: Path, files: Sequence[Path]) -> dict[str, object]:
    """Figures with their captions, models with their fits, and what is not drawn, as JSON."""
    listed = []
    for name, figure in drawn.figures.items():
        views = [list(view) for view in figure.chart.views]
        listed.append({"kind": name, "thesis": figure.thesis, "caption": figure.caption, "views": views})
    models = {}
    for name, judged in drawn.judged.items():
        models[name] = [model.judged.record() for model in judged.models]
    return {
        "page": page,
        "figures": listed,
        "files": files,
        "models": models,
        "orders": {model.label: model.orders for model in drawn.models},
        "not_drawn": [vars(item) for item in drawn.left_out],
        "warnings": drawn.warnings,
    }


def _print(drawn: "RecordFigures", folder: Path, page: Path, files: Sequence[Path]) -> None:
    """Print the models, the figures, and what is not drawn."""
    from scenarios.record_figures.record_figures import kind_table

    print_tables(drawn.tables())
    rows = []
    for name, figure in drawn.figures.items():
        rows.append((name, drawn.headings[name], kind_table()[name]["thesis"], f"{len(figure.chart.views)}"))
    print_table("Figures", ("kind", "", "of the thesis", "views"), rows)
    say_each("warning: ", drawn.warnings)
    say_each("not drawn: ", [f"{item.kind}: {item.reason}" for item in drawn.left_out])
    say(f"files: {counted(len(files), 'file')} in {folder}")
    say(f"page: {page}")
