"""`hmtb identify`: any estimator on any record, also of your own robot."""

from collections.abc import Callable, Iterable
from functools import partial
from math import isfinite
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import tyro

from scenarios.commands.output import output_folder, print_json, print_table, say_each
from scenarios.commands.usage import command_line
from scenarios.files.errors import ScenarioError

if TYPE_CHECKING:
    from scenarios.identification.identification import Identification
    from sysid.records.arrays import ComplexArray

SAVED = (".json", ".m", ".c", ".fmu")
"""Endings of files of models."""

LISTED = 24
"""Most parameters that are listed one by one."""

BEST = 8
"""Most candidates that are listed."""


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
    validate: Path | None = None,
    validate_test: str | None = None,
    save: Annotated[Path | None, tyro.conf.arg(metavar="FILE")] = None,
    out: Path | None = None,
    json: bool = False,
) -> int:
    """Identify a model from a record of the twin or of any robot.

    Without --method and --orders it chooses: delay, structure (arx, armax, oe, bj; state space for several outputs) and
    orders, and prints the candidates and the reason; with --method alone, the delay and the orders of arx, armax, oe or
    bj. The last quarter of the record, of several the longest, then judges the model, unless --validate names another.

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
        missing: Outputs may be missing, as NaN or empty cells; inputs must be complete.
        skip: Leave out this much of the start, s.
        keep_mean: Use the values as they are, without an operating point.
        steps: Horizon of a further prediction, samples, beside simulation and one step ahead.
        validate: Another record, on which fits and residual test are computed.
        validate_test: Which of its tests, by name or number.
        save: Write the model: all of it as .json, which hmtb compare --models reads, a MATLAB function (.m), C source
            (.c) or an FMU for co-simulation (.fmu).
        out: Folder for figures: records, outputs, responses, poles and zeros, residuals.
        json: Print JSON.
    """
    typed = command_line("hmtb identify", identify, locals())
    import warnings

    from scenarios.files.data_file import joints_of, read_parts
    from scenarios.identification.identification import figures, usable
    from scenarios.identification.identification import identify as identify_model
    from scenarios.identification.order_choice import choose_and_identify, held_out
    from sysid.records.channels import listed
    from sysid.records.importers import one_interval
    from sysid.records.printing import poles_table

    if not data:
        raise ScenarioError("expected the path of a record; see hmtb identify --help")
    if save is not None and save.suffix not in SAVED:
        raise ScenarioError(f"--save {save} given, expected a file that ends with {', '.join(SAVED)}")
    if orders and method is None:
        raise ScenarioError(f"--orders {' '.join(map(str, orders))} given without --method")
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always", UserWarning)
        read = partial(read_parts, input=input, output=output, dt=dt, time=time, time_unit=time_unit, missing=missing)
        parts = one_interval(
            [part for path in data for part in usable(read(path, joint=joint, test=test), skip, path, test)]
        )
        check = None
        if validate is not None:
            # A log is validated on the joint that the model is of, whichever it excites.
            others = read(validate, joint=joints_of(parts[0]) or joint, test=validate_test)
            check = usable(others, skip, validate, validate_test)
        if orders and method is not None:
            result, choice = identify_model(parts, method, orders, keep_mean=keep_mean, steps=steps, check=check), None
        else:
            if check is None:
                parts, check = held_out(parts)
            result, choice = choose_and_identify(parts, method, keep_mean=keep_mean, steps=steps, check=check)
        if save is not None:
            with output_folder(save.parent):
                _save(result, save, typed)
    texts = (*(str(one.message) for one in caught), *result.warnings)
    pictures: list[Path] = []
    if out is not None:
        from scenarios.report.figures import save_figure

        with output_folder(out) as folder:
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
    judged = validate.name if validate else "a last quarter, which it was not estimated from" if check else ""
    print_table(
        f"{model.method.upper()} from {listed([path.name for path in data])}"
        + (f", fits to {judged}" if judged else ""),
        ("", ""),
        [("verdict", _verdict(result)), *([("choice", choice.reason)] if choice else []), *_rows(result)],
    )
    poles = poles_table(model.poles(), model.model.dt).columns
    if poles[0][1]:
        rows = list(zip(*(cells for _, cells in poles), strict=True))
        print_table("Poles from input to output", [head for head, _ in poles], rows)
    if choice is not None:
        shown = [
            (str(one), f"{one.parameters}", f"{one.loss:.4g}", f"{one.ebic - best.ebic:.1f}", one.remark)
            for one in choice.candidates[:BEST]
        ]
        title = f"Candidates, the best {len(shown)} of {len(choice.candidates)}"
        print_table(title, ("", "parameters", "loss", "EBIC above the best", ""), shown)
    # The parameters of a state-space model are coordinates, which mean nothing one by one.
    if model.polynomials is not None and len(model.parameters) <= LISTED:
        spreads = record["deviations"].items()
        rows = [
            (name, f"{record['parameters'][name]:.6g}", f"{spread:.2g}" if isfinite(spread) else "not known")
            for name, spread in spreads
        ]
        print_table("Parameters", ("", "value", "standard deviation"), rows)
    say_each("warning: ", texts)
    say_each("model: ", [save] if save else [])
    say_each("figure: ", pictures)
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
    import numpy as np

    fitted, test = result.fitted, result.test
    model, first = fitted.estimate, fitted.parts[0]
    point = model.operating_point
    single = len(fitted.claims) == len(fitted.claims[0]) == 1

    def of_paths(value: "Callable[[Any], object]", paths: Iterable[Iterable[object]]) -> Any:
        rows = [[value(one) for one in row] for row in paths]
        return rows[0][0] if single else rows

    deviations = np.sqrt(np.maximum(np.diag(model.covariance), 0.0))
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
        "deviations": dict(zip(model.parameter_names, deviations, strict=True)),
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


def _verdict(result: "Identification") -> str:
    """Whether the residual tests accept the model, and how much of the output it simulates."""
    fit = ", ".join(f"{value:.1f} %" for value in result.fit.simulation)
    if result.test is None:
        return f"residuals not tested; simulated fit {fit}"
    white, independent = (bool(each.all()) for each in (result.test.white, result.test.independent))
    if not independent:
        text = "not sufficient: the residuals still depend on the input, as beside nonlinearity, feedback or low orders"
    elif not white:
        text = "sufficient from input to output: only the disturbance has dynamics that the model lacks"
    else:
        text = "sufficient: the residuals are white and independent of the input"
    return f"{text}; simulated fit {fit}"


def _rows(result: "Identification") -> list[tuple[str, str]]:
    import numpy as np

    from scenarios.files.data_file import joints_of

    fitted, fit, test = result.fitted, result.fit, result.test
    model, first = fitted.estimate, fitted.parts[0]
    ins, outs = first.input_names or (), first.output_names or ()

    def percents(fits: Iterable[float]) -> str:
        return ", ".join(
            f"{name} {value:.2f} %".strip() for name, value in zip(outs if outs[1:] else ("",), fits, strict=True)
        )

    rows = [
        ("orders", ", ".join(f"{name} {value}" for name, value in fitted.orders.items())),
        ("record", f"{sum(map(len, fitted.parts))} samples every {first.dt:g} s"),
    ]
    # Records of joints are in rad; what other tables hold, only their owner knows.
    unit = " rad" if joints_of(first) else ""
    if model.operating_point is not None:
        levels = np.where(np.abs(level := np.concatenate(model.operating_point)) < 1e-12, 0.0, level)
        named = (f"{name} {value:.4g}{unit}" for name, value in zip((*ins, *outs), levels, strict=True))
        rows.append(("operating point", ", ".join(named)))
    rows += [("fit in simulation", percents(fit.simulation)), ("fit one step ahead", percents(fit.one_step))]
    rows += [(f"fit {fit.steps} steps ahead", percents(fit.ahead))] if fit.steps > 1 else []
    gain = model.dc_gain()
    for i, row in enumerate(fitted.claims):
        for j, band in enumerate(row):
            path = f", {ins[j]} → {outs[i]}" if gain.size > 1 else ""
            if np.isfinite(band.hz):
                known = np.isfinite(band.low)
                interval = f"{band.low:.4g} to {band.high:.4g} Hz" if known else "not known to this method"
                text = f"{band.hz:.4g} Hz, 95 % interval {interval}"
            else:
                text = "—" if band.refused else "none below Nyquist"
            rows.append((f"bandwidth (-3 dB){path}", text))
            integrates = not abs(gain[i, j]) < 1e9
            rows.append((f"gain at 0 Hz{path}", "none, it integrates" if integrates else f"{gain[i, j]:.4f}"))
    noise = np.sqrt(np.diag(model.noise_variance))
    rows += [
        ("zeros (z plane)", _roots(model.zeros())),
        ("standard deviation of the noise", ", ".join(f"{deviation:.4g}{unit}" for deviation in noise)),
        ("final prediction error", f"{model.fpe:.4g}{unit and f'{unit}²'}"),
        ("AIC, BIC (normalised, per sample)", f"{model.aic:.5g}, {model.bic:.5g}"),
    ]
    if test is None:
        return [*rows, ("residual test", f"not computed: {result.untested}")]
    for name, passed, p in (
        ("residuals white", test.white, test.whiteness_p),
        ("residuals independent of the input", test.independent, test.independence_p),
    ):
        pairs = zip(np.ravel(passed), np.ravel(p), strict=True)
        rows.append((name, ", ".join(f"{'yes' if one else 'no'} (p = {value:.2g})" for one, value in pairs)))
    return rows


def _roots(roots: "ComplexArray") -> str:
    from sysid.records.printing import AT_ZERO

    delays = sum(abs(root) <= AT_ZERO for root in roots)
    # of each pair one
    upper = [root for root in roots if abs(root) > AT_ZERO and root.imag > -AT_ZERO]
    shown = [f"{root.real:.4f}" + (f" ± {root.imag:.4f}j" if root.imag > AT_ZERO else "") for root in upper]
    shown += [f"0 ({delays} times)" if delays > 1 else "0"] if delays else []
    return ", ".join(shown) or "none"
