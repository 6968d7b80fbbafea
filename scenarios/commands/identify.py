"""`hmtb identify`: any estimator on any record, also of your own robot."""

import warnings
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import tyro

from scenarios.commands.compare import compare
from scenarios.commands.output import (
    check_files,
    output_folder,
    print_json,
    print_table,
    progress,
    say,
    say_each,
)
from scenarios.commands.usage import command_line
from scenarios.files.errors import ScenarioError

if TYPE_CHECKING:
    from scenarios.identification.identification import Identification

SAVED = (".json", ".m", ".c", ".fmu")
"""Endings of files of models."""

FIGURES = ("record", "outputs", "bode", "step", "roots", "residuals")
"""Figures of --out, DATA-NAME.png."""


def identify(
    data: Annotated[tuple[Path, ...], tyro.conf.Positional, tyro.conf.arg(metavar="DATA ...")],
    *,
    method: Annotated[str | None, tyro.conf.arg(metavar="arx|armax|oe|bj|iv4|okid|n4sid|pem_ss")] = None,
    orders: tuple[int, ...] = (),
    joint: str | None = None,
    input: tuple[str, ...] = ("u",),
    output: tuple[str, ...] = ("y",),
    dt: float | None = None,
    time: str | None = None,
    time_unit: str | None = None,
    test: str | None = None,
    missing: bool = False,
    skip: float = 0.0,
    keep_mean: bool = False,
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
    orders, and prints the candidates and the reason; with --method alone, the delay and the orders of arx, armax, oe or
    bj. The last quarter of the record, of several the longest, then judges the model, unless --validate names another
    or --held-out another part. The verdict calls no model sufficient whose simulated fit is below 50 %.

    Methods and their orders: arx na nb [nk], armax na nb nc [nk], oe nb nf [nk], bj nb nc nd nf [nk], iv4 na nb [nk],
    okid order [p], n4sid order, pem_ss order. nk = 1 (the default) means that y(t) depends on u(t-1) first; p = 5 (the
    default) is the number of observer Markov parameters. All take several inputs (polynomials of the same orders for
    each), okid, n4sid and pem_ss also several outputs.

    It reads the logs and records of hmtb simulate and hmtb convert (.nc, .csv, .mat, .asc, .ch10), other .mat and .nc
    files (variables by name) and tables as text (.csv, .txt, .dat or any other ending). Columns of tables are separated
    by commas, semicolons, tabs or spaces; without a header they are the inputs, then the outputs. Samples that the bus
    lost are left out, as are missing outputs (--missing). Several files are experiments with one model; gaps in the
    times of a table divide it into experiments, samples that jitter are put on a uniform grid, and a warning says so.

    The model describes motion about an operating point: the means are removed, and a remaining constant of the output
    (a record that starts from rest has one) is estimated with the model. --keep-mean uses the values as they are.

      hmtb identify siso-5-elbow_pitch.nc
      hmtb identify siso-5-elbow_pitch.nc --method oe --orders 2 2 1
      hmtb identify siso-5-elbow_pitch.nc --method armax --orders 2 2 2 1 --validate siso-8-elbow_pitch.nc
      hmtb identify robot.csv --input command --output angle --method oe --orders 2 2 1 --save robot.json
      hmtb identify run-1.csv run-2.csv --time stamp --method n4sid --orders 3

    Args:
        data: The record, or several.
        method: One of the methods above; without it, it is chosen.
        orders: Orders of the model, in the sequence given above, as in MATLAB; without them, they are chosen.
        joint: Which joint of a log; the excited one when not given.
        input: Names of the input columns of a table, or variables of a .mat or .nc file.
        output: Names of the output columns, likewise.
        dt: Sampling interval of a table without one, s. A column t, time or Time (s), or a variable dt or Ts, gives it.
        time: Name of the column of times, when it is not t, time, stamp or the like.
        time_unit: Unit of the times: s, ms, us, ns, min or h; by the name, or the size of times since 1970, when not
            given.
        test: Which test of a 1553 record, by name or number.
        missing: Outputs may be missing, as NaN or empty cells; inputs must be complete. Gaps of the times still cut.
        skip: Leave out this much of the start, s.
        keep_mean: Use the values as they are, without an operating point.
        steps: Horizon of a further prediction, samples, beside simulation and one step ahead.
        held_out: Part of the record, its end, on which fits and residual test are computed and from which nothing is
            estimated, 0 to 0.9.
        validate: Another record, on which fits and residual test are computed.
        validate_test: Which of its tests, by name or number.
        save: Write the model: all of it as .json, which hmtb compare --models reads, a MATLAB function (.m), C source
            (.c) or an FMU for co-simulation (.fmu).
        out: Folder for figures: records, outputs, responses, poles and zeros, residuals.
        overwrite: Replace files that exist, without a question.
        json: Print JSON.
    """
    values = locals()
    typed = command_line("hmtb identify", identify, values)
    from scenarios.identification.file_identification import identify_files
    from scenarios.identification.identification import figures
    from scenarios.identification.result_tables import result_tables

    if save is not None and save.suffix not in SAVED:
        raise ScenarioError(f"--save {save} given, expected a file that ends with {', '.join(SAVED)}")
    earlier = [] if out is None else [out / f"{one.stem}-{name}.png" for one in data[:1] for name in FIGURES]
    check_files(*earlier, *([save] if save else []), overwrite=overwrite)
    with progress("estimation"):
        found = identify_files(
            data,
            method=method,
            orders=orders,
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
            steps=steps,
            held_out=held_out,
            validate=validate,
            validate_test=validate_test,
        )
    result, choice = found.result, found.choice
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always", UserWarning)
        if save is not None:
            with output_folder(save.parent):
                _save(result, save, typed)
    texts = (*found.warnings, *(str(one.message) for one in caught))
    pictures: list[Path] = []
    if out is not None:
        from scenarios.report.figures import save_figure

        with progress("figures"), output_folder(out) as folder:
            for name, figure in figures(result).items():
                pictures.append(folder / f"{data[0].stem}-{name}.png")
                save_figure(figure, pictures[-1], dpi=120)
    model = result.fitted.estimate
    record = {"method": model.method, **_record(result), "warnings": texts, "model_file": save, "figures": pictures}
    if choice is not None:
        best = choice.candidates[0]
        record["choice"] = {
            "reason": choice.reason,
            "candidates": [
                {"method": one.method, "orders": one.orders, "ebic": one.ebic - best.ebic, "loss": one.loss}
                for one in choice.candidates
            ],
        }
    if json:
        print_json(record)
        return 0
    for table in result_tables(found):
        print_table(table.title, table.columns, table.rows)
    say_each("warning: ", texts)
    say_each("model: ", [save] if save else [])
    say_each("figure: ", pictures)
    if save is None and pictures:
        again = {**values, "save": Path(f"{data[0].stem}.json"), "out": None, "overwrite": False}
        say(f"next: {command_line('hmtb identify', identify, again)}")
    elif save is not None and save.suffix == ".json":
        values["overwrite"] = False
        of_record = {"data": data[0], "models": (str(save),), "joint": (joint,) if joint else ()}
        say(f"next: {command_line('hmtb compare', compare, {**values, **of_record, 'out': None})}")
    return 0


def _save(result: "Identification", path: Path, typed: str) -> None:
    """Write the model with its operating point, in the format that the ending names."""
    from sysid import exchange

    model = result.fitted.estimate
    if path.suffix == ".json":
        exchange.write_model(model, path, command=typed)
    else:
        {".m": exchange.to_matlab, ".c": exchange.to_c, ".fmu": exchange.to_fmu}[path.suffix](model, path)


def _record(result: "Identification") -> dict[str, Any]:
    """The model as JSON; of a single path bandwidth and gain are numbers, else rows of outputs."""
    from scenarios.identification.result_tables import deviations

    fitted, test = result.fitted, result.test
    model, first = fitted.estimate, fitted.parts[0]
    point = model.operating_point
    single = len(fitted.claims) == len(fitted.claims[0]) == 1

    def of_paths(value: "Callable[[Any], object]", paths: Iterable[Iterable[object]]) -> Any:
        rows = [[value(one) for one in row] for row in paths]
        return rows[0][0] if single else rows

    return {
        "orders": fitted.orders,
        "inputs": first.input_names,
        "outputs": first.output_names,
        "fit": {key: getattr(result.fit, key) for key in ("simulation", "one_step", "steps", "ahead")},
        "bandwidth_hz": of_paths(lambda claim: claim.hz, fitted.claims),
        "ci95": of_paths(lambda claim: [claim.low, claim.high], fitted.claims),
        "poles": model.poles(),
        "zeros": model.zeros(),
        "dc_gain": of_paths(float, model.dc_gain()),
        "parameters": dict(zip(model.parameter_names, model.parameters, strict=True)),
        "deviations": dict(zip(model.parameter_names, deviations(model), strict=True)),
        "noise_covariance": model.noise_variance,
        "fpe": model.fpe,
        "aic": model.aic,
        "bic": model.bic,
        "residuals": None
        if test is None
        else {key: getattr(test, key) for key in ("passed", "whiteness_p", "independence_p")},
        "operating_point": point and dict(zip(("input", "output"), point, strict=True)),
        "samples": sum(map(len, fitted.parts)),
        "dt": first.dt,
    }
