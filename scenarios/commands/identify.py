"""`hmtb identify`: any estimator on any record, also of your own robot."""

import shlex
import warnings
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import tyro

from scenarios.commands.compare import compare
from scenarios.commands.output import (
    check_files,
    output_folder,
    print_json,
    print_tables,
    progress,
    say,
    say_each,
)
from scenarios.commands.usage import command_line
from scenarios.files.errors import ScenarioError
from scenarios.identification.methods import ESTIMATORS, typed_orders

if TYPE_CHECKING:
    from scenarios.identification.file_identification import FileIdentification
    from scenarios.identification.identification import Identification
    from sysid import Estimate
    from sysid.validation.structure_scan import Order

SAVED = (".json", ".m", ".c", ".fmu")
"""Endings of files of models."""

FIGURES = ("record", "outputs", "bode", "step", "roots", "residuals")
"""Figures of --out, DATA-NAME.png."""

REPORT = "report.html"
"""Report of --out."""


def identify(
    data: Annotated[tuple[Path, ...], tyro.conf.Positional, tyro.conf.arg(metavar="DATA ...")],
    *,
    method: Annotated[str | None, tyro.conf.arg(metavar="|".join(ESTIMATORS))] = None,
    orders: Annotated[tuple[str, ...], tyro.conf.arg(metavar="[INT|WORD ...]")] = (),
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
    offset: bool = False,
    trend: bool = False,
    direct: bool = False,
    weighting: Annotated[tuple[int, ...], tyro.conf.arg(metavar="[NC ND]")] = (),
    steps: int = 1,
    held_out: float | None = None,
    validate: Path | None = None,
    validate_test: str | None = None,
    save: Annotated[Path | None, tyro.conf.arg(metavar="FILE")] = None,
    out: Path | None = None,
    overwrite: bool = False,
    json: bool = False,
) -> int:
    """Identify a model from a record of the twin or of any robot.

    Without --method and --orders it chooses: delay, structure (arx, armax, oe, bj; state space for several outputs) and
    orders, and prints the candidates and the reason; with --method alone, the delay and the orders of arx, armax, oe,
    bj, tfest, procest or impulseest. The last quarter of the record, of several the longest, then judges the model,
    and the chosen orders are then estimated from all samples; unless --validate names another record, or --held-out
    another part, from which nothing is estimated. The verdict calls no model sufficient whose simulated fit is below
    50 %.

    Methods and their orders: {methods_with_orders}. nk = 1 (the default) means that y(t) depends on u(t-1) first; p = 5
    (the default) is the number of observer Markov parameters. The delay of tfest is estimated, or known in samples;
    kinds of procest are P0 to P3 with D (delay), Z (zero), U (complex poles) and I (integrator), as P2DU; impulseest
    has n samples and a kernel tc, dc or ss. All take several inputs (polynomials of the same orders
    for each), {methods_of_several_outputs} also several outputs.

    It reads the logs and records of hmtb simulate and hmtb convert (.nc, .csv, .mat, .asc, .ch10), other .mat, .npz and
    .nc files (variables by name) and tables as text (.csv, .txt, .dat or any other ending). Columns of tables are
    separated by commas, semicolons, tabs or spaces; without a header they are the inputs, then the outputs, behind
    times or not. Samples that the bus
    lost are left out, as are missing outputs (--missing). Several files are experiments with one model; gaps in the
    times of a table divide it into experiments, samples that jitter are put on a uniform grid, and a warning says so.

    Several joints of a log give one model of all, with the bandwidth of each joint, the coupling between them and
    residual tests of every output; pem_ss is chosen for it. hmtb figures draws it, and the thesis' models of a block
    for each joint.

    The model describes motion about an operating point: the means are removed, and a remaining constant of the output
    (a record that starts from rest has one) is estimated with the model. --keep-mean uses the values as they are.

      hmtb identify siso-5-elbow_pitch.nc
      hmtb identify siso-5-elbow_pitch.nc --method oe --orders 2 2 1
      hmtb identify siso-5-elbow_pitch.nc --method armax --orders 2 2 2 1 --validate siso-8-elbow_pitch.nc
      hmtb identify rpcm.nc --joint shoulder_yaw shoulder_pitch elbow_pitch --method n4sid --orders 6 --save rpcm.json
      hmtb identify robot.csv --input command --output angle --method oe --orders 2 2 1 --save robot.json
      hmtb identify robot.csv --method procest --orders P2DU --out report
      hmtb identify run-1.csv run-2.csv --time stamp --method n4sid --orders 3

    Args:
        data: The record, or several.
        method: One of the methods above; without it, it is chosen.
        orders: Orders of the model, in the sequence given above, as in MATLAB; of several inputs as 1,2 where they
            differ. Without them, they are chosen.
        joint: Which joint of a log, or several of one, which give one multivariable model; the excited one when not
            given.
        input: Names of the input columns of a table, or variables of a .mat or .nc file.
        output: Names of the output columns, likewise.
        dt: Sampling interval of a table without one, s. A column t, time or Time (s), or a variable dt or Ts, gives it.
        time: Name of the column of times, when it is not t, time, stamp or the like.
        time_unit: Unit of the times: s, ms, us, ns, min, h or days; by the name, or the size of times since 1970, when
            not given.
        test: Which test of a 1553 record, by name or number.
        missing: Outputs may be missing, as NaN or empty cells; inputs must be complete. Gaps of the times still cut.
        skip: Leave out this much of the start, s.
        keep_mean: Use the values as they are, without an operating point.
        offset: Fit a constant of the output together with the parameters, so that their deviations allow for it; by
            default it is estimated in turns with the model.
        trend: Fit a straight line in the output together with the parameters: a drift. Where orders are chosen, a line
            is tried without this option too.
        direct: Allow a direct term (nk = 0) in the choice: the output depends on the input of the same sample, and no
            controller computes that input from this output.
        weighting: Weight the errors of oe by a model C/D of the disturbance with these degrees, which is estimated
            beside the path and left out of the model. Where orders of oe are chosen, it is chosen with them.
        steps: Horizon of a further prediction, samples, beside simulation and one step ahead.
        held_out: Part of the record, its end, on which fits and residual test are computed and from which nothing is
            estimated, 0 to 0.9.
        validate: Another record, on which fits and residual test are computed.
        validate_test: Which of its tests, by name or number.
        save: Write the model: all of it as .json, which hmtb compare --models reads, a MATLAB function (.m), C source
            (.c) or an FMU for co-simulation (.fmu).
        out: Folder for report.html, the verdict, the model and charts with values under the pointer on one page, and
            for figures: records, outputs, responses, poles and zeros, residuals.
        overwrite: Replace files that exist, without a question.
        json: Print JSON.
    """
    options = locals()  # before any other local variable: all options, for the commands that repeat and go on
    typed = command_line("hmtb identify", identify, options)
    from scenarios.identification.file_identification import identify_files
    from scenarios.identification.result_tables import advised_options, result_tables, verdict

    numbered = _orders(orders, method)
    # Endings and files that exist are checked before the fit, which may take minutes.
    if save is not None and save.suffix not in SAVED:
        raise ScenarioError(f"--save {save} given, expected a file that ends with {', '.join(SAVED)}")
    replaced = [save] if save else []
    if out is not None and data:
        pictured = [out / f"{data[0].stem}-{name}.png" for name in FIGURES]
        replaced = [out / REPORT, *pictured, *replaced]
    check_files(*replaced, overwrite=overwrite)
    with progress("estimation"):
        found = identify_files(
            data,
            method=method,
            orders=numbered,
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
            offset=offset,
            trend=trend,
            direct=direct,
            weighting=weighting,
            steps=steps,
            held_out=held_out,
            validate=validate,
            validate_test=validate_test,
        )
    remarks = [*found.warnings]
    if save is not None:
        # What the writer of a format warns of is listed with the remarks on the model.
        with warnings.catch_warnings(record=True) as caught, output_folder(save.parent):
            warnings.simplefilter("always", UserWarning)
            _save(found.result.fitted.estimate, save, typed, found.warnings)
        remarks += [str(warning.message) for warning in caught]
    pictures, report = [], None
    if out is not None:
        pictures = _draw(found.result, out, data[0].stem)
        report = _report(found, options, out / REPORT)
    if json:
        written = {"model_file": save, "figures": pictures, "report": report}
        print_json({"verdict": verdict(found.result), **found.record(), "warnings": remarks, **written})
        return 0
    print_tables(result_tables(found))
    say_each("warning: ", remarks)
    if save is not None:
        say_each("model: ", [save])
    say_each("figure: ", pictures)
    if report is not None:
        say_each("report: ", [report])
    # A verdict that advises an option comes before the model that it refuses.
    advised = advised_options(found.result, options)
    if advised:
        again = {**options, **advised, "orders": (), "save": None, "out": None, "overwrite": False}
        say(f"next: {command_line('hmtb identify', identify, again)}")
    else:
        goes_on = bool(pictures) or found.choice is not None
        _say_next(options, found.chosen_options, save, goes_on=goes_on)
    return 0


def _orders(words: Sequence[str], method: str | None) -> "tuple[Order | str, ...]":
    """Orders: whole numbers, and words such as the kind of a process model where a method has them."""
    orders = typed_orders(words, method)
    if orders is None:
        raise ScenarioError(f"--orders: expected whole numbers, given {' '.join(words)}")
    return orders


def _with_methods(text: str) -> str:
    """The help text with the methods of the table."""
    usages = [f"{name} {method.usage}" for name, method in ESTIMATORS.items()]
    *first, last = [name for name, method in ESTIMATORS.items() if method.outputs]
    return text.format(
        methods_with_orders=", ".join(usages), methods_of_several_outputs=f"{', '.join(first)} and {last}"
    )


identify.__doc__ = _with_methods(identify.__doc__ or "")


def _say_next(options: Mapping[str, Any], chosen: Mapping[str, Any], save: Path | None, *, goes_on: bool) -> None:
    """Write the command that goes on from here: save the model, then compare it with others on the same record.

    A choice is written out, so that the command gives the same model at once; one with cautions is repeated.
    """
    first = options["data"][0]
    # What was asked for once, figures and the consent to replace files, is not repeated.
    again = {**options, **chosen, "out": None, "overwrite": False}
    if save is None and goes_on:
        again["save"] = Path(f"{first.stem}.json")
        say(f"next: {command_line('hmtb identify', identify, again)}")
    elif save is not None and save.suffix == ".json":
        of_record = {"data": first, "models": (str(save),)}
        say(f"next: {command_line('hmtb compare', compare, {**again, **of_record})}")


def _save(model: "Estimate", path: Path, typed: str, remarks: Sequence[str]) -> None:
    """Write the model with its operating point, in the format that the ending names."""
    from dataclasses import replace

    from sysid import exchange

    if path.suffix == ".json":
        # The remarks have those of the estimator, and others on the reading of the data.
        model = replace(model, diagnostics={**model.diagnostics, "warnings": tuple(remarks)})
        exchange.write_model(model, path, command=typed)
    else:
        {".m": exchange.to_matlab, ".c": exchange.to_c, ".fmu": exchange.to_fmu}[path.suffix](model, path)


def _report(found: "FileIdentification", options: Mapping[str, Any], path: Path) -> Path:
    """Write the report with the command and the call that give its model again."""
    from scenarios.identification.file_identification import DEFAULTS, IMPORTS, IdentificationRequest
    from scenarios.model_report.report_page import write_model_report

    again = {name: value for name, value in options.items() if name in DEFAULTS}
    again["orders"] = _orders(options["orders"], options["method"])
    request = IdentificationRequest(tuple(options["data"]), {**again, **found.chosen_options})
    with progress("report"):
        return write_model_report(found, path, shlex.join(request.words), IMPORTS + request.python)


def _draw(result: "Identification", out: Path, stem: str) -> list[Path]:
    """Draw the figures of a model into a folder."""
    from scenarios.identification.identification import figures
    from scenarios.report.figures import save_figure

    pictures = []
    with progress("figures"), output_folder(out) as folder:
        for name, figure in figures(result).items():
            picture = folder / f"{stem}-{name}.png"
            save_figure(figure, picture, dpi=120)
            pictures.append(picture)
    return pictures
