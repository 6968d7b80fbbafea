"""`hmtb identify`: any estimator on any record, also of your own robot."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import tyro

from scenarios.commands.output import output_folder, print_json, print_table, say

if TYPE_CHECKING:
    from scenarios.identification.identification import Identification
    from sysid import Estimate

LISTED = 24
"""Parameters that are listed one by one."""


def identify(
    data: Annotated[Path, tyro.conf.Positional, tyro.conf.arg(metavar="DATA")],
    /,
    *,
    method: Annotated[str, tyro.conf.arg(metavar="arx|armax|oe|bj|iv4|okid|n4sid|pem_ss")],
    orders: tuple[int, ...],
    joint: str | None = None,
    input: tuple[str, ...] = ("u",),
    output: tuple[str, ...] = ("y",),
    dt: float | None = None,
    test: str | None = None,
    missing: bool = False,
    skip: float = 0.0,
    keep_mean: bool = False,
    steps: int = 1,
    validate: Path | None = None,
    validate_test: str | None = None,
    out: Path | None = None,
    json: bool = False,
) -> int:
    """Identify a model from a record of the twin or of any robot.

    Methods and their orders: arx na nb [nk], armax na nb nc [nk], oe nb nf [nk], bj nb nc nd nf [nk], iv4 na nb [nk],
    okid order [p], n4sid order, pem_ss order. nk = 1 (the default) means that y(t) depends on u(t-1) first; p = 5 (the
    default) is the number of observer Markov parameters. All take several inputs (polynomials of the same orders for
    each), okid, n4sid and pem_ss also several outputs.

    It reads the logs and records of hmtb simulate and hmtb convert (.nc, .csv, .mat, .asc, .ch10), other .mat and .nc
    files (variables by name) and tables as text (.csv, .txt, .dat, any other: columns by commas, semicolons, tabs or
    spaces, with a header, or bare: inputs, then outputs). Samples that the bus lost are left out, as are missing
    outputs (--missing).

    The model describes motion about an operating point: the means are removed, and a remaining constant of the output
    (a record that starts from rest has one) is estimated with the model. --keep-mean uses the values as they are.

    hmtb identify robot.csv --input command --output angle --method oe --orders 2 2 1

    Args:
        data: The record.
        method: One of the methods above.
        orders: Orders of the model, in the field's usual sequence.
        joint: Which joint of a log; the excited one when not given.
        input: Names of the input columns of a table, or variables of a .mat or .nc file.
        output: Names of the output columns, likewise.
        dt: Sampling interval of a table without one, s. A column t, time or Time (s), or a variable dt or Ts, gives it.
        test: Which test of a 1553 record, by name or number.
        missing: Outputs may be missing, as NaN or empty cells; inputs must be complete.
        skip: Leave out this much of the start, s.
        keep_mean: Use the values as they are, without an operating point.
        steps: Horizon of a further prediction, samples, beside simulation and one step ahead.
        validate: Another record, for fits and residual test.
        validate_test: Which of its tests, by name or number.
        out: Folder for figures: records, outputs, responses, poles and zeros, residuals.
        json: Print JSON.
    """
    import warnings

    from scenarios.files.data_file import of_joint, read_parts
    from scenarios.identification.identification import identify as identify_model
    from scenarios.identification.identification import usable

    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always", UserWarning)
        read = read_parts(data, joint=joint, input=input, output=output, dt=dt, test=test, missing=missing)
        parts, check = usable(read, skip, method, data, test), None
        if validate is not None:
            # A log is validated on the joint that the model is of, whichever it excites.
            same = of_joint(parts[0]) or joint
            others = read_parts(
                validate, joint=same, input=input, output=output, dt=dt, test=validate_test, missing=missing
            )
            check = usable(others, skip, method, validate, validate_test)
    result = identify_model(parts, method, orders, keep_mean=keep_mean, steps=steps, check=check)
    texts = (*(str(one.message) for one in caught), *result.warnings)
    title = f"{method.upper()} from {data.name}" + (f", fits to {validate.name}" if validate else "")
    pictures: list[Path] = []
    if out is not None:
        from scenarios.identification.identification import figures
        from scenarios.report.figures import save_figure

        with output_folder(out) as folder:
            for name, figure in figures(result).items():
                pictures.append(folder / f"{data.stem}-{name}.png")
                save_figure(figure, pictures[-1], dpi=120)
    if json:
        print_json({**_record(method, result), "warnings": texts, "figures": pictures})
        return 0
    print_table(title, ("", ""), _rows(result))
    model = result.fitted.estimate
    # The parameters of a state-space model are coordinates, which mean nothing one by one.
    if model.polynomials is not None and len(model.parameters) <= LISTED:
        print_table("Parameters", ("", "value", "standard deviation"), _parameters(model))
    for text in texts:
        say(f"warning: {text}")
    for path in pictures:
        say(f"figure: {path}")
    return 0


def _record(method: str, result: "Identification") -> dict[str, object]:
    """The model as JSON; of a single path bandwidth and gain are numbers, else rows of outputs."""
    model, claims = result.fitted.estimate, result.fitted.claims
    single = len(claims) == len(claims[0]) == 1
    hz, ends = (
        [[value(one) for one in row] for row in claims] for value in (lambda c: c.hz, lambda c: [c.low, c.high])
    )
    gain = model.dc_gain()
    test = result.test
    return {
        "method": method,
        "orders": result.fitted.orders,
        "inputs": result.fitted.parts[0].input_names,
        "outputs": result.fitted.parts[0].output_names,
        "fit": {
            "simulation": result.fit.simulation,
            "one_step": result.fit.one_step,
            "steps": result.fit.steps,
            "ahead": result.fit.ahead,
        },
        "bandwidth_hz": hz[0][0] if single else hz,
        "ci95": ends[0][0] if single else ends,
        "poles": model.poles(),
        "zeros": model.zeros(),
        "dc_gain": gain[0, 0] if single else gain,
        "parameters": dict(zip(model.parameter_names, model.parameters, strict=True)),
        "deviations": dict(zip(model.parameter_names, _deviations(model), strict=True)),
        "noise_covariance": model.noise_variance,
        "fpe": model.fpe,
        "aic": model.aic,
        "bic": model.bic,
        "residuals": None
        if test is None
        else {"passed": test.passed, "whiteness_p": test.whiteness_p, "independence_p": test.independence_p},
        "operating_point": None
        if result.fitted.level is None
        else {"input": result.fitted.level[0], "output": result.fitted.level[1]},
        "samples": sum(map(len, result.fitted.parts)),
        "dt": result.fitted.parts[0].dt,
    }


def _rows(result: "Identification") -> list[tuple[str, str]]:
    import numpy as np

    from scenarios.files.data_file import of_joint

    model, first, fit = result.fitted.estimate, result.fitted.parts[0], result.fit
    ins, outs = first.input_names or (), first.output_names or ()
    rows = [
        ("orders", ", ".join(f"{name} {value}" for name, value in result.fitted.orders.items())),
        ("record", f"{sum(map(len, result.fitted.parts))} samples every {first.dt:g} s"),
    ]
    if result.fitted.level is not None:
        named = zip((*ins, *outs), (*result.fitted.level[0], *result.fitted.level[1]), strict=True)
        # Records of joints are in rad; what other tables hold, only their owner knows.
        unit = " rad" if of_joint(first) else ""
        rows.append(("operating point", ", ".join(f"{name} {_number(value)}{unit}" for name, value in named)))
    rows += [
        ("fit in simulation", _percents(fit.simulation, outs)),
        ("fit one step ahead", _percents(fit.one_step, outs)),
    ]
    if fit.steps > 1:
        rows.append((f"fit {fit.steps} steps ahead", _percents(fit.ahead, outs)))
    gain = model.dc_gain()
    for i, row in enumerate(result.fitted.claims):
        for j, band in enumerate(row):
            path = f", {ins[j]} → {outs[i]}" if gain.size > 1 else ""
            if np.isfinite(band.hz):
                interval = f"{band.hz:.4g} Hz, 95 % interval "
                known = np.isfinite(band.low)
                interval += f"{band.low:.4g} to {band.high:.4g} Hz" if known else "not known to this method"
            else:
                interval = "—" if band.refused else "none below Nyquist"
            rows.append((f"bandwidth (-3 dB){path}", interval))
            endless = not abs(gain[i, j]) < 1e9
            rows.append((f"gain at 0 Hz{path}", "none, it integrates" if endless else f"{gain[i, j]:.4f}"))
    rows += [
        ("poles (z plane)", _roots(model.poles())),
        ("zeros (z plane)", _roots(model.zeros())),
        ("standard deviation of the noise", ", ".join(f"{np.sqrt(v):.4g}" for v in np.diag(model.noise_variance))),
        ("final prediction error", f"{model.fpe:.4g}; AIC {model.aic:.5g}, BIC {model.bic:.5g}"),
    ]
    if result.test is None:
        rows.append(("residual test", f"not computed: {result.untested}"))
    else:
        test = result.test
        rows.append(("residuals white", _verdicts(test.white, test.whiteness_p)))
        rows.append(("residuals independent of the input", _verdicts(test.independent, test.independence_p)))
    return rows


def _parameters(model: "Estimate") -> list[tuple[str, str, str]]:
    import numpy as np

    return [
        (name, f"{value:.6g}", f"{spread:.2g}" if np.isfinite(spread) else "not known")
        for name, value, spread in zip(model.parameter_names, model.parameters, _deviations(model), strict=True)
    ]


def _deviations(model: "Estimate") -> list[float]:
    import numpy as np

    return [float(value) for value in np.sqrt(np.maximum(np.diag(model.covariance), 0.0))]


def _percents(fits: object, outputs: tuple[str, ...]) -> str:
    import numpy as np

    values = np.asarray(fits, dtype=float)
    names = outputs if len(values) > 1 else ("",)
    return ", ".join(f"{name} {value:.2f} %".strip() for name, value in zip(names, values, strict=True))


def _verdicts(passed: object, p: object) -> str:
    import numpy as np

    pairs = zip(np.ravel(np.asarray(passed)), np.ravel(np.asarray(p, dtype=float)), strict=True)
    return ", ".join(f"{'yes' if one else 'no'} (p = {value:.2g})" for one, value in pairs)


def _roots(roots: object) -> str:
    import numpy as np

    shown = (
        f"{root.real:.4f}" + (f"{root.imag:+.4f}j" if abs(root.imag) > 1e-9 else "")
        for root in np.asarray(roots, dtype=complex)
    )
    return ", ".join(shown) or "none"


def _number(value: float) -> str:
    return f"{0.0 if abs(value) < 1e-12 else value:.4g}"
