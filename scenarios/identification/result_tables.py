"""What `hmtb identify` prints of a model, as tables."""

from collections.abc import Iterable
from dataclasses import dataclass
from math import isfinite

import numpy as np

from scenarios.files.data_file import joints_of
from scenarios.identification.file_identification import FileIdentification
from scenarios.identification.identification import Identification
from sysid import Estimate
from sysid.records.arrays import ComplexArray, FloatArray
from sysid.records.printing import AT_ZERO, poles_table

LISTED = 24
"""Most parameters that are listed one by one."""

SUFFICIENT = 50.0
"""Least simulated fit of a model that a verdict calls sufficient, %."""

BEST = 8
"""Most candidates that are listed."""


@dataclass(frozen=True)
class ResultTable:
    """A table of texts.

    Attributes:
        title: Its title.
        columns: Headings; empty where there are none.
        rows: Cells.
    """

    title: str
    columns: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]


def result_tables(found: FileIdentification) -> tuple[ResultTable, ...]:
    """The model in words, its poles, candidates of a choice, and its parameters."""
    result, choice = found.result, found.choice
    model = result.fitted.estimate
    reason = [("choice", choice.reason)] if choice is not None else []
    tables = [ResultTable(found.title, ("", ""), (("verdict", verdict(result)), *reason, *model_rows(result)))]
    poles = poles_table(model.poles(), model.model.dt).columns
    if poles[0][1]:
        rows = tuple(zip(*(cells for _, cells in poles), strict=True))
        tables.append(ResultTable("Poles from input to output", tuple(head for head, _ in poles), rows))
    if choice is not None:
        best = choice.candidates[0]
        shown = tuple(
            (str(one), f"{one.parameters}", f"{one.loss:.4g}", f"{one.ebic - best.ebic:.1f}", one.remark)
            for one in choice.candidates[:BEST]
        )
        title = f"Candidates, the best {len(shown)} of {len(choice.candidates)}"
        tables.append(ResultTable(title, ("", "parameters", "loss", "EBIC above the best", ""), shown))
    # The parameters of a state-space model are coordinates, which mean nothing one by one.
    if model.polynomials is not None and len(model.parameters) <= LISTED:
        spreads = zip(model.parameter_names, model.parameters, deviations(model), strict=True)
        parameters = tuple(
            (name, f"{value:.6g}", f"{spread:.2g}" if isfinite(spread) else "not known")
            for name, value, spread in spreads
        )
        tables.append(ResultTable("Parameters", ("", "value", "standard deviation"), parameters))
    return tuple(tables)


def deviations(model: Estimate) -> FloatArray:
    """Standard deviations of the parameters (p,); NaN where they are not known."""
    return np.sqrt(np.maximum(np.diag(model.covariance), 0.0))


def verdict(result: Identification) -> str:
    """Whether residual tests and simulation accept the model, and how much of the output it simulates.

    Tests alone would accept models of which the noise model does all the work: it follows any output one step ahead.
    Simulated from the input alone, a sufficient model explains the output at least by half.
    """
    fit, least = ", ".join(f"{value:.1f} %" for value in result.fit.simulation), float(np.min(result.fit.simulation))
    if not least >= 0.0:
        return f"not sufficient: the simulation is worse than the mean of the output; simulated fit {fit}, below 0 %"
    if result.test is None:
        return f"residuals not tested; simulated fit {fit}"
    white, independent = (bool(each.all()) for each in (result.test.white, result.test.independent))
    if not independent:
        text = "not sufficient: the residuals still depend on the input, as beside nonlinearity, feedback or low orders"
    elif not least >= SUFFICIENT:
        text = f"undecided: the residuals do not depend on the input, but the simulated fit is below {SUFFICIENT:g} %"
    elif not white:
        text = "sufficient from input to output: only the disturbance has dynamics that the model lacks"
    else:
        text = "sufficient: the residuals are white and independent of the input"
    return f"{text}; simulated fit {fit}"


def model_rows(result: Identification) -> list[tuple[str, str]]:
    """Rows of orders, operating point, fits, bandwidths, zeros, criteria and residual tests."""
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
        ("zeros (z plane)", roots_text(model.zeros())),
        ("standard deviation of the noise", ", ".join(f"{deviation:.4g}{unit}" for deviation in noise)),
        ("final prediction error", f"{model.fpe:.4g}{unit and f'{unit}²'}"),
        ("AIC, BIC (normalised, per sample)", f"{model.aic:.5g}, {model.bic:.5g}"),
    ]
    if test is None:
        return [*rows, ("residual test", f"not computed: {result.untested}")]
    # The correlations that a figure shows are those of the residuals as they are.
    for name, passed, p, remark in (
        ("residuals white", test.white, test.whiteness_p, ""),
        ("residuals independent of the input", test.independent, test.independence_p, ", tested on whitened residuals"),
    ):
        pairs = zip(np.ravel(passed), np.ravel(p), strict=True)
        texts = ", ".join(f"{'yes' if one else 'no'} (p = {value:.2g})" for one, value in pairs)
        rows.append((name, f"{texts}{remark}"))
    return rows


def roots_text(roots: ComplexArray) -> str:
    """Roots in the z plane, of each pair one, those at zero counted."""
    delays = sum(abs(root) <= AT_ZERO for root in roots)
    # of each pair one
    upper = [root for root in roots if abs(root) > AT_ZERO and root.imag > -AT_ZERO]
    shown = [f"{root.real:.4f}" + (f" ± {root.imag:.4f}j" if root.imag > AT_ZERO else "") for root in upper]
    shown += [f"0 ({delays} times)" if delays > 1 else "0"] if delays else []
    return ", ".join(shown) or "none"
