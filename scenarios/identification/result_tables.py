"""Tables of an identified model, as `hmtb identify` and the station's page show them."""

from collections.abc import Iterable, Mapping, Sequence
from math import ceil, isfinite, isnan, log10
from typing import Any

import numpy as np

from scenarios.files.data_file import joints_of
from scenarios.files.result_table import ResultTable
from scenarios.identification.file_identification import FileIdentification
from scenarios.identification.identification import (
    LASTING,
    FittedModel,
    Identification,
    dependent_inputs,
    deviations,
    drifts,
    without_python_advice,
)
from scenarios.identification.run_agreement import RunAgreement
from sysid import Bandwidth, Estimate, IOData, ResidualTest, StructureChoice
from sysid.models.bandwidth import HALF_POWER, BandwidthClaim
from sysid.models.continuous_estimate import ContinuousEstimate, damp
from sysid.models.estimate import repetition_in_words
from sysid.models.frequency_response import NORMAL_95
from sysid.polynomial.arx import NOT_DECAYED
from sysid.polynomial.data_checks import POORLY_EXCITED
from sysid.polynomial.offset_test import MISSING_OFFSET
from sysid.polynomial.outliers import FAR_OUTLIERS
from sysid.polynomial.response_features import response_features
from sysid.records.arrays import ComplexArray, FloatArray
from sysid.records.errors import Message, reworded
from sysid.records.excited_band import excited_band
from sysid.records.printing import AT_ZERO, poles_table
from sysid.selection.structure_search import ORDERS
from sysid.validation.command_baseline import CommandBaseline
from sysid.validation.joint_nonlinearity import SATURATION
from sysid.validation.model_error import ModelError
from sysid.validation.own_line import has_line
from sysid.validation.slow_response import LEVEL, SlowResponse

LISTED = 24
"""Most parameters that are listed one by one."""

NO_BETTER = 0.98
"""Error in simulation, relative to that of the command itself, from which on a model is no better."""

SUFFICIENT = 50.0
"""Least simulated fit of a model that a verdict calls sufficient, %."""

CLOSE = 0.2
"""Part of gain and bandwidth within which the 99 % intervals of a model that a verdict calls sufficient must lie."""

NORMAL_99 = 2.5758
"""Quantile of the normal distribution, both sides together 1 %."""

SMALL = 0.25
"""Gain, relative to the largest at any frequency, below which nothing depends on it."""

FEW = 10
"""Samples for each parameter below which no interval is a promise: of bj at ten, those of 95 % held in 79 %."""

SLOW_PART = 0.05
"""Least gain of a slow part that the model lacks, relative to the gain of the model, that leaves the verdict open.

A lag with 9 % less gain has 20 % more bandwidth. Of a part that only the weaker test shows it is `CLOSE`.
"""

SAME_SAMPLE = (
    "; input and output of the same sample depend on each other: unless a controller computes the input from that "
    "output, --direct gives a model with a direct term"
)

DRIFT = "; beside its response to the input the output follows a straight line: --trend (arx, armax, oe, bj) fits one"

SPOILT = (
    "; samples far outside the others, which a warning names, spoil fits and tests: if they are wrong, empty their "
    "cells and add --missing"
)

GRID = 50
"""Frequencies, up to the highest that the input excites, at which the largest gain is looked for."""

BEST = 8
"""Most candidates that are listed."""

ROUNDING = 1e-12
"""Means below it are what the subtraction of a mean leaves of zero."""

SMALLEST_DECIMAL, LARGEST_DECIMAL = 1e-2, 1e6
"""Gains between which four decimals show enough digits; beyond them units are very unlike."""


def result_tables(found: FileIdentification) -> tuple[ResultTable, ...]:
    """The model in words, its poles, candidates of a choice, and its parameters."""
    model, choice = found.result.fitted.estimate, found.choice
    rows = [("verdict", verdict(found.result))]
    if choice is not None:
        rows.append(("choice", choice.reason))
    tables = [ResultTable(found.title, ("", ""), (*rows, *model_rows(found.result)))]
    tables += _coupling_tables(found.result.fitted)
    tables += _residual_tables(found.result)
    tables += _pole_tables(model)
    if choice is not None:
        tables.append(_candidate_table(choice))
    if found.result.agreement is not None and not found.result.agreement.test.untested:
        tables.append(_runs_table(found.result.agreement, found.result.fitted.parts[0]))
    # The parameters of a state-space model are coordinates, which mean nothing one by one.
    has_meaning = model.polynomials is not None or isinstance(model, ContinuousEstimate)
    if has_meaning and len(model.parameters) <= LISTED:
        tables.append(_parameter_table(model))
    return tuple(tables)


def _pole_tables(model: Estimate) -> list[ResultTable]:
    """Poles with what they mean in time; of a continuous-time model with intervals, of an impulse response none."""
    if model.method == "impulseest":
        return []
    if isinstance(model, ContinuousEstimate):
        columns = damp(model).table().columns
    else:
        columns = poles_table(model.poles(), model.model.dt).columns
    if not columns[0][1]:
        return []
    headings = tuple(heading for heading, _ in columns)
    cells = tuple(zip(*(cells for _, cells in columns), strict=True))
    return [ResultTable("Poles from input to output", headings, cells)]


def _several_joints(record: IOData) -> tuple[str, ...]:
    """Names of the joints, where a record moves several; empty for one joint, or for other channels."""
    joints = joints_of(record)
    return joints if len(joints) > 1 else ()


def _coupling_tables(fitted: FittedModel) -> list[ResultTable]:
    """Gain and bandwidth of the paths from the command of one joint to the angle of another."""
    joints = _several_joints(fitted.parts[0])
    if not joints:
        return []
    gain, rows = fitted.gain, []
    for i, output in enumerate(joints):
        for j, input in enumerate(joints):
            if i != j:
                bandwidth = _bandwidth_in_words(fitted.claims[i][j])
                rows.append((f"{input} → {output}", _gain_in_words(gain[i, j]), bandwidth))
    title = "Coupling: command of a joint → angle of another"
    return [ResultTable(title, ("", "gain at 0 Hz", "bandwidth"), tuple(rows))]


def _residual_tables(result: Identification) -> list[ResultTable]:
    """Residual tests, a row for each of several outputs: whether they are white, and independent of each input."""
    test, first = result.test, result.fitted.parts[0]
    if test is None or first.ny < 2:
        return []
    of_all = result.test_of_all
    rows = []
    for i, output in enumerate(first.output_names or ()):
        cells = [_test_outcome(test.white[i], test.whiteness_p[i])]
        for j in range(first.nu):
            cell = _test_outcome(test.independent[i, j], test.independence_p[i, j])
            # A test that fails by chance passes on all samples, which tell more.
            if of_all is not None and not test.independent[i, j]:
                cell += f"; of all samples {_test_outcome(of_all.independent[i, j], of_all.independence_p[i, j])}"
            cells.append(cell)
        rows.append((output, *cells))
    headings = [f"independent of {name}" for name in first.input_names or ()]
    return [ResultTable("Residual tests, output by output", ("residuals of", "white", *headings), tuple(rows))]


def _candidate_table(choice: StructureChoice) -> ResultTable:
    best = choice.candidates[0]
    rows = []
    for candidate in choice.candidates[:BEST]:
        above_best = candidate.bic - best.bic
        cells = (f"{candidate.parameters}", f"{candidate.loss:.4g}", f"{above_best:.1f}", candidate.remark)
        rows.append((str(candidate), *cells))
    title = f"Candidates, the best {len(rows)} of {len(choice.candidates)}"
    if any(candidate.bic < best.bic for candidate in choice.candidates[:BEST]):
        title += "; not the least BIC was chosen, for the reason that stands under choice"
    return ResultTable(title, ("", "parameters", "loss", "BIC relative to the chosen", ""), tuple(rows))


def _runs_table(agreement: RunAgreement, record: IOData) -> ResultTable:
    """Gain of every run, and whether the others agree without it."""
    test = agreement.test
    word = "agree" if test.agree else "differ"
    columns, rows = (
        ["", "p without it"],
        [[name, f"{p:.2g}"] for name, p in zip(test.runs, test.p_without, strict=True)],
    )
    for i, j in np.ndindex(test.gain_ratios.shape[1:]):
        path = (
            f", {(record.input_names or ())[j]} → {(record.output_names or ())[i]}"
            if test.gain_ratios[0].size > 1
            else ""
        )
        columns.append(f"gain over that of the model{path}")
        for k, row in enumerate(rows):
            row.append(f"{test.gain_ratios[k, i, j]:.4g} ± {test.gain_deviations[k, i, j]:.2g}")
        if not agreement.agree:
            columns.append(f"gain at 0 Hz of the run alone{path}")
            for k, row in enumerate(rows):
                gain = float(agreement.gains[k, i, j])
                shown = f"{gain:.4g}" if isfinite(gain) else "not known"
                row.append(shown)
    title = f"Runs: they {word} in their response to the input (p = {test.p_value:.2g})"
    return ResultTable(title, tuple(columns), tuple(map(tuple, rows)))


def _parameter_table(model: Estimate) -> ResultTable:
    rows = []
    for name, value, deviation in zip(model.parameter_names, model.parameters, deviations(model), strict=True):
        spread = f"{deviation:.2g}" if isfinite(deviation) else "not known"
        rows.append((name, f"{value:.6g}", spread))
    return ResultTable("Parameters", ("", "value", "standard deviation"), tuple(rows))


_DEPENDENT = "the residuals still depend on the input, as beside nonlinearity, feedback, low orders or another delay"

_OTHER_AMPLITUDE = {
    SATURATION: "a smaller amplitude, at which it matters less",
    "": "another amplitude, at which a linear model would be the same",
}
"""What to repeat a record at, by the kind of nonlinearity; hysteresis matters less at larger amplitudes."""


def _nonlinearity_in_words(result: Identification) -> str:
    """What the residuals show of nonlinearity, and what to do."""
    test, names = result.nonlinearity, result.fitted.parts[0].output_names or ()
    if test is None:
        return ""
    worst = max(result.nonlinear, key=lambda i: float(test.distortion[i]))
    subject = "the output depends" if len(names) < 2 else f"{names[worst]} depends"
    kind = test.kinds[worst]
    likeness = f", as with {kind}" if kind else ""
    advice = _OTHER_AMPLITUDE.get(kind, "a larger amplitude, at which it matters less")
    if not test.varies[worst]:
        advice = f"{advice} (commands of one amplitude do not tell how much)"
    return (
        f"{subject} nonlinearly on the input{likeness} ({_percent(test.distortion[worst])} of it, "
        f"p = {test.p_values[worst]:.2g}): gain and bandwidth are those of this amplitude alone; repeat at {advice}"
    )


def _hidden_nonlinearity(result: Identification) -> str:
    """Nonlinearity that commands of one amplitude hide, in words; empty if there is none."""
    test, names = result.nonlinearity, result.fitted.parts[0].output_names or ()
    if test is None or not any(test.hidden):
        return ""
    i = next(i for i, kind in enumerate(test.hidden) if kind)
    subject = "the record" if len(names) < 2 else names[i]
    return (
        f"a servo with {test.hidden[i]} describes {subject} far better than a linear one, and commands of one "
        "amplitude do not tell it from a linear system of high order; repeat at a larger amplitude, at which it "
        "matters less"
    )


def verdict(result: Identification) -> str:
    """Whether residual tests and simulation accept the model, and how much of the output it simulates.

    Tests alone would accept models of which the noise model does all the work: it follows any output one step ahead.
    Simulated from the input alone, a sufficient model explains the output at least by half.
    """
    words = _judgement(result)
    # What else the data show stands behind what is wrong with the model.
    if not words.startswith("sufficient") and _lacks_line(result):
        words += DRIFT
    if not words.startswith("sufficient") and _message(result.fitted, FAR_OUTLIERS):
        words += SPOILT
    return words + (SAME_SAMPLE if result.same_sample else "")


def advised_options(result: Identification, options: Mapping[str, Any]) -> dict[str, Any]:
    """Options of `hmtb identify` that a verdict advises, beside those given; empty where it advises none of them."""
    words = verdict(result)
    if words.startswith("sufficient"):
        return {}
    # Values as they are and a line exclude each other.
    if DRIFT in words and not options["keep_mean"]:
        method = options["method"] if options["method"] in ORDERS else "oe"
        return {"method": method, "trend": True, "offset": False}
    if SAME_SAMPLE in words and not options["direct"]:
        return {"method": options["method"] if options["method"] in ORDERS else None, "direct": True}
    return {}


def _judgement(result: Identification) -> str:
    """The verdict on what the model describes."""
    fits = ", ".join(f"{value:.1f} %" for value in result.fit.simulation)
    lowest = float(np.min(result.fit.simulation))
    if result.agreement is not None and result.agreement.words:
        # Runs that differ also look nonlinear to the model of all of them.
        return f"not sufficient: {result.agreement.words}; simulated fit {fits}"
    if result.fitted.is_unstable:
        return _verdict_of_unstable(result)
    # "not >=" also catches the fit of a simulation that overflows, which may be NaN.
    if not lowest >= 0.0:
        return f"not sufficient: the simulation is worse than the mean of the output; simulated fit {fits}, below 0 %"
    if result.test is None:
        return f"residuals not tested; simulated fit {fits}"
    is_doubtful = bool(result.nonlinear or result.depends_on_input)
    if is_doubtful and (cut := _message(result.fitted, NOT_DECAYED)):
        # the rest of the response looks like anything
        longer = reworded(cut, cut.advice, {"n": "--orders with a larger n"})
        words = f"not sufficient: {longer}"
    elif is_doubtful and (offset := _message(result.fitted, MISSING_OFFSET)):
        # what an offset leaves looks like anything
        words = f"not sufficient: {without_python_advice(offset)}; --offset, or of an integrator --trend, estimates it"
    elif result.nonlinear:
        words = f"not sufficient: {_nonlinearity_in_words(result)}"
    elif result.depends_on_input:
        words = f"not sufficient: {_DEPENDENT}"
    elif hidden := _hidden_nonlinearity(result):
        words = f"undecided: {hidden}"
    elif result.cautions:
        words = f"undecided: {'; '.join(result.cautions)}"
    elif creep := _slow_part(result):
        words = f"undecided: {creep}"
    elif unexcited := _message(result.fitted, POORLY_EXCITED):
        words = f"undecided: {unexcited}"
    elif left_open := _undetermined(result):
        # no longer record would tell the effects of inputs that move together
        words = f"undecided: {dependent_inputs(result.fitted.parts) or left_open}"
    elif not lowest >= SUFFICIENT:
        words = f"undecided: the residuals do not depend on the input, but the simulated fit is below {SUFFICIENT:g} %"
    elif no_better := _no_better_than_command(result):
        words = f"undecided: {no_better}"
    else:
        least, hidden = _hidden_slow_part(result)
        above = f" above {least:.2g} Hz" if hidden else ""
        return f"sufficient{above}{_residuals_in_words(result, result.test)}; simulated fit {fits}{hidden}"
    return f"{words}; simulated fit {fits}"


def _residuals_in_words(result: Identification, test: ResidualTest) -> str:
    """What the residuals of a sufficient model say of it, behind that word."""
    if not (test.independent | result.by_chance).all():
        # rounding depends on the output, and so on the input
        return " from input to output: the residuals are no larger than the rounding of the output"
    if not test.white.all():
        return " from input to output: the residuals do not depend on the input, but are not white"
    return ": the residuals are white and independent of the input"


def _lacks_line(result: Identification) -> bool:
    """Whether the output drifts along a straight line that the model could not have: tests would name other things."""
    fitted = result.fitted
    if has_line(fitted.estimate) or result.chose_trend or fitted.is_unstable:
        return False
    return drifts(fitted.parts)


def _no_better_than_command(result: Identification) -> str:
    """Output that its command describes as well as the model does, in words; empty if there is none."""
    baseline = result.baseline
    if baseline is None:
        return ""
    for i, (fit, of_command) in enumerate(zip(result.fit.simulation, baseline.fit, strict=True)):
        if 100.0 - fit >= NO_BETTER * (100.0 - of_command):
            return (
                f"the model describes the output no better than the command itself does, {baseline.delays[i]} samples "
                f"late ({of_command:.1f} %): commands that change faster would tell its dynamics"
            )
    return ""


def _slow_part(result: Identification) -> str:
    """A slow part of the response that the model lacks and that would change its gain, in words; empty if none."""
    for path, gain in _with_gains(result):
        least = SLOW_PART if path.p < LEVEL else CLOSE
        if path.is_shown and abs(path.gain) > least * abs(gain):
            return (
                f"the simulation errors follow the input slowly, as by a time constant of about "
                f"{path.time_constant:.2g} s (p = {path.p:.1g}), which would change the gain at 0 Hz by "
                f"up to {path.gain / gain:.0%}; a longer record would tell"
            )
    return ""


def _hidden_slow_part(result: Identification) -> tuple[float, str]:
    """Frequency, Hz, up to which a slow part that these errors hide could matter, and what it is in words.

    A lag of time constant T and gain k changes the response at f by k / (2 pi f T). Zero and empty below `CLOSE`.
    """
    least, words = 0.0, ""
    for path, gain in _with_gains(result):
        # Of a gain of zero any slow part is more than all.
        share = path.possible_gain / abs(gain) if gain else np.inf
        frequency = share / (CLOSE * 2.0 * np.pi * path.longest)
        if share > CLOSE and frequency > least:
            least = float(frequency)
            words = (
                f"; below that frequency the disturbance could hide a slow part of the response (time constant "
                f"{path.longest:.3g} s) of up to {100.0 * share:.0f} % of the gain at 0 Hz; a longer record would tell"
            )
    return least, words


def _with_gains(result: Identification) -> list[tuple[SlowResponse, float]]:
    """What was tested of slow parts of paths without an integrator, with the gains of the model."""
    pairs = []
    for path in result.slow:
        if not result.fitted.integrates[path.output, path.input]:
            pairs.append((path, float(result.fitted.gain[path.output, path.input])))
    return pairs


def _message(fitted: FittedModel, code: str) -> Message:
    """What the estimator warned of under a code; empty if it did not."""
    for message in fitted.estimate.diagnostics.get("warnings", ()):
        if isinstance(message, Message) and message.code == code:
            return message
    return Message("")


def _verdict_of_unstable(result: Identification) -> str:
    """Verdict on an unstable model: its simulation grows whatever it is worth, so it is judged one step ahead."""
    fits = ", ".join(f"{value:.1f} %" for value in result.fit.one_step)
    if result.test is None:
        words = "residuals not tested"
    elif result.depends_on_input:
        words = f"not sufficient: {_DEPENDENT}"
    elif not float(np.min(result.fit.one_step)) >= SUFFICIENT:
        words = f"undecided: the residuals do not depend on the input, but the fit is below {SUFFICIENT:g} %"
    else:
        words = "sufficient one step ahead"
    return f"{words}; the model is unstable, an open-loop simulation of it means nothing; fit one step ahead {fits}"


def _undetermined(result: Identification) -> str:
    """What of gain and bandwidth the record leaves open, in words; empty if nothing.

    The gain is that at the lowest frequency of the record: an integrator has none at 0 Hz. Where it is small beside the
    gain at other excited frequencies, nothing depends on it. The 99 % intervals, widened by as much as other
    structures that fit as well differ, must lie within `CLOSE`.
    """
    fitted, (of_gain, of_bandwidth) = result.fitted, result.disagreement
    first = fitted.parts[0]
    lowest = 1.0 / (max(map(len, fitted.parts)) * first.dt)
    # above the frequencies that an input excites the response is that of the structure, of whatever size
    highest = [max(excited_band(part, input=j)[1] for part in fitted.parts) for j in range(first.nu)]
    frequencies = np.linspace(lowest, max(lowest, *highest), GRID)
    response = fitted.estimate.frequency_response(frequencies)
    if response.covariance is None:
        return ""
    samples, parameters = sum(int(part.known.sum()) for part in fitted.parts), len(fitted.estimate.parameters)
    if samples < FEW * parameters:
        return f"{samples} samples are few for {parameters} parameters, {FEW * parameters} or more would tell"
    is_excited = frequencies[:, None] <= np.maximum(highest, lowest)
    magnitude = np.where(is_excited[:, None, :], np.abs(response.response), 0.0)
    deviation = np.sqrt(np.trace(response.covariance[0], axis1=-2, axis2=-1))
    integrating = fitted.integrates
    unknown = np.isnan(fitted.gain) & ~integrating
    others = "; structures that fit as well differ by {:.0%}"
    for (i, j), value in np.ndenumerate(magnitude[0]):
        path = ""
        if value.size < magnitude[0].size:
            path = f" from {(first.input_names or ())[j]} to {(first.output_names or ())[i]}"
        integrates = bool(integrating[i, j])
        gain_ratio, bandwidth_ratio = (1.0, 1.0) if integrates else (of_gain, of_bandwidth)
        share = NORMAL_99 * deviation[i, j] / max(value, SMALL * magnitude[:, i, j].max())
        if share + gain_ratio - 1.0 > CLOSE:
            differ = others.format(gain_ratio - 1.0) if gain_ratio > 1.0 else ""
            return (
                f"the record leaves the gain{path} open, {value:.3g} at {lowest:.3g} Hz with a standard deviation of "
                f"{deviation[i, j]:.2g}{differ}; a longer record, or more of the input at low frequencies, would tell"
            )
        if unknown[i, j]:
            return (
                f"the record leaves the gain{path} at 0 Hz open: a mode of the model lasts longer than {LASTING:g} "
                "records; a longer record would tell"
            )
        claim = fitted.claims[i][j]
        if claim.refused and not integrates and value >= SMALL * magnitude[:, i].max():
            return f"{claim.warnings[0]}{path}; a record whose input excites these frequencies would tell"
        ratio = (claim.high / claim.low) ** (0.5 * NORMAL_99 / NORMAL_95) if claim.low > 0.0 else 1.0
        if ratio * bandwidth_ratio > 1.0 + CLOSE:
            differ = others.format(bandwidth_ratio - 1.0) if bandwidth_ratio > 1.0 else ""
            return (
                f"the record leaves the bandwidth{path} open, {claim.low:.3g} to {claim.high:.3g} Hz{differ}; a longer "
                "record, or more of the input at these frequencies, would tell"
            )
    return ""


def model_rows(result: Identification) -> list[tuple[str, str]]:
    """Rows of orders, operating point, fits, bandwidths, zeros, criteria and residual tests."""
    fitted, first = result.fitted, result.fitted.parts[0]
    # Records of joints are in rad; what other tables hold, only their owner knows.
    unit = " rad" if joints_of(first) else ""
    return [
        ("orders", ", ".join(f"{name} {value}" for name, value in fitted.orders.items())),
        *_weighting_rows(fitted),
        ("record", f"{sum(map(len, fitted.parts))} samples every {first.dt:g} s"),
        *(("repetition", words) for words in repetition_in_words(fitted.estimate.diagnostics)),
        *_operating_point_rows(fitted, unit),
        *_fit_rows(result, first.output_names or ()),
        *_baseline_rows(result.baseline),
        *_bandwidth_rows(fitted, result.error),
        *_error_rows(fitted, result.error),
        *_response_rows(fitted),
        *_noise_rows(fitted.estimate, unit),
        *_residual_rows(result),
        *_nonlinearity_rows(result),
    ]


def _weighting_rows(fitted: FittedModel) -> list[tuple[str, str]]:
    if fitted.weighting is None:
        return []
    nc, nd = fitted.weighting
    return [("errors", f"weighted by a model C/D of the disturbance, degrees {nc} and {nd}: not in the model")]


def _operating_point_rows(fitted: FittedModel, unit: str) -> list[tuple[str, str]]:
    point, first = fitted.estimate.operating_point, fitted.parts[0]
    if point is None:
        return []
    channels = (*(first.input_names or ()), *(first.output_names or ()))
    levels = np.concatenate(point)
    levels = np.where(np.abs(levels) < ROUNDING, 0.0, levels)
    # an output that integrates rests at any level
    rests = np.concatenate((np.full(first.nu, True), np.isfinite(fitted.gain).all(axis=1)))
    named = (
        f"{name} {level:.4g}{unit}" if is_told else f"{name} none, it integrates"
        for name, level, is_told in zip(channels, levels, rests, strict=True)
    )
    rows = [("operating point", ", ".join(named))]
    slopes = [slope for slope in fitted.estimate.diagnostics.get("slopes", ()) if any(slope)]
    # what the mean of the input leaves of an integrator is no drift
    if slopes and not fitted.integrates.any():
        drifts = ", ".join(f"{slope[0]:.4g}{unit}/s" for slope in slopes)
        rows.append(("line in the output", f"{drifts}, about its mean"))
    return rows


def _baseline_rows(baseline: CommandBaseline | None) -> list[tuple[str, str]]:
    """Fit of the commands themselves, where it is better than that of the mean."""
    if baseline is None or not (baseline.fit > 0.0).any():
        return []
    texts = []
    for fit, delay in zip(baseline.fit.tolist(), baseline.delays, strict=True):
        texts.append(f"{fit:.2f} % ({delay} samples late)")
    return [("fit of the delayed command", ", ".join(texts))]


def _fit_rows(result: Identification, outputs: Sequence[str]) -> list[tuple[str, str]]:
    fit = result.fit
    # A single output needs no name.
    labels = outputs if len(outputs) > 1 else ("",)
    # the fits are of another estimate than the rows about them
    where = " (part held out)" if result.is_estimated_again else ""

    def percents(fits: Iterable[float]) -> str:
        return ", ".join(f"{label} {value:.2f} %".strip() for label, value in zip(labels, fits, strict=True))

    in_simulation = "none: the model is unstable"
    if not result.judged.is_unstable:
        in_simulation = percents(fit.simulation) + where
    rows = [("fit in simulation", in_simulation), ("fit one step ahead", percents(fit.one_step) + where)]
    if fit.steps > 1:
        rows.append((f"fit {fit.steps} steps ahead", percents(fit.ahead) + where))
    return rows


def _bandwidth_rows(fitted: FittedModel, error: ModelError | None) -> list[tuple[str, str]]:
    """Bandwidth and gain at 0 Hz of every path; where noise does not explain the errors, from the strong lines too."""
    first = fitted.parts[0]
    inputs, outputs = first.input_names or (), first.output_names or ()
    rows = []
    # Of several joints their own paths; the coupling has a table of its own.
    for i, joint in enumerate(_several_joints(first)):
        rows += _rows_of_path(fitted, error, i, i, f" of {joint}")
    if rows:
        return rows
    for i, j in np.ndindex(fitted.gain.shape):
        path = f", {inputs[j]} → {outputs[i]}" if fitted.gain.size > 1 else ""
        rows += _rows_of_path(fitted, error, i, j, path)
    return rows


def _rows_of_path(
    fitted: FittedModel, error: ModelError | None, output: int, input: int, path: str
) -> list[tuple[str, str]]:
    """Bandwidths and gain at 0 Hz of one path, whose name ends each heading."""
    claim = fitted.claims[output][input]
    words, from_line = _bandwidth_in_words(claim), []
    if error is not None and error.is_wider[output]:
        if isfinite(claim.hz):
            with_error = ends_in_words(error.bandwidth(), output, input)
            words += f" from the parameters, {with_error} with distortion and order"
        from_line = _bandwidth_from_line(error, fitted, output, input, path)
    elif error is not None and isnan(error.p_values[output]) and isfinite(claim.low):
        words += " from noise alone"
    gain = _gain_in_words(fitted.gain[output, input])
    return [(f"bandwidth (-3 dB){path}", words), *from_line, (f"gain at 0 Hz{path}", gain)]


def _bandwidth_from_line(
    error: ModelError, fitted: FittedModel, output: int, input: int, path: str
) -> list[tuple[str, str]]:
    """The bandwidth below the gain at the lowest strong line, for which no gain at 0 Hz is extrapolated.

    None where the model has fallen by that much on the way to the line: what is reached from there is no bandwidth.
    """
    line = error.strong_line
    at_line = float(error.gain[np.argmin(np.abs(error.frequencies - line)), output, input])
    if at_line < HALF_POWER * abs(float(fitted.gain[output, input])):
        return []
    band = error.bandwidth(line)
    hz = float(band.hz[output, input])
    if not isfinite(hz):
        return []
    low, high = (float(end[output, input]) for end in band.ci95)
    # no bandwidth from the gain at the line lies below the line: there is no lower end but the line itself
    ends = f"up to {high:.3g} Hz" if low <= line < high < np.inf else ends_in_words(band, output, input)
    name = f"-3 dB from the gain at {line:.3g} Hz{path}"
    return [
        (name, f"{hz:.4g} Hz, 95 % interval {ends} with distortion and order; the input is weak below {line:.3g} Hz")
    ]


def ends_in_words(band: Bandwidth, output: int, input: int) -> str:
    """Ends of the interval of a bandwidth with unit; where the record does not tell an end, the other one."""
    low, high = (float(end[output, input]) for end in band.ci95)
    if not isfinite(low):
        return "unknown"
    if not isfinite(high):
        return f"{low:.3g} Hz or more" if low > 0.0 else "unknown"
    return f"{low:.3g} to {high:.3g} Hz" if low > 0.0 else f"up to {high:.3g} Hz"


def _error_rows(fitted: FittedModel, error: ModelError | None) -> list[tuple[str, str]]:
    """Gains and bandwidths with both intervals where noise does not explain the errors of the simulation, and why."""
    if error is None:
        return []
    rows = []
    for i, output in enumerate(error.output_names):
        if isnan(error.p_values[i]):
            rows.append(("errors of the simulation", error.reasons[i]))
        if not error.is_wider[i]:
            continue
        for j, k in _gains_with_errors(error, fitted, i):
            path = f", {error.input_names[j]} → {output}" if error.gain[0].size > 1 else ""
            by_noise = _interval_in_words(error.noise_alone, (k, i, j))
            in_all = _interval_in_words(error.interval, (k, i, j))
            name = f"gain at {error.frequencies[k]:.3g} Hz{path}"
            intervals = f"95 %: {by_noise} by noise alone, {in_all} with distortion and order"
            rows.append((name, f"{_gain_in_words(error.gain[k, i, j])} ({intervals})"))
        rows.append(("errors of the simulation", error.reasons[i]))
    return rows


def _gains_with_errors(error: ModelError, fitted: FittedModel, output: int) -> list[tuple[int, int]]:
    """Indices of the inputs and frequencies whose gains to an output the table shows.

    They are the lowest strong line and the bandwidths of each path to it; of several joints only of the joint's own
    path: nine paths at all bandwidths would be eighty rows.
    """
    inputs = [output] if _several_joints(fitted.parts[0]) else range(len(error.input_names))
    listed = []
    for j in inputs:
        shown = [error.strong_line, fitted.claims[output][j].hz]
        listed += [(j, k) for k in np.flatnonzero(np.isin(error.frequencies, shown)).tolist()]
    return listed


def _interval_in_words(interval: tuple[FloatArray, FloatArray], at: tuple[int, int, int]) -> str:
    """Ends of the interval of a gain."""
    low, high = (float(end[at]) for end in interval)
    if not isfinite(low):
        return "unknown"
    # two digits of the width, and three of the ends at least: rounding must not make an interval empty
    largest, width = max(abs(low), abs(high)), high - low
    digits = 3 if not 0.0 < width < largest else max(3, 2 + ceil(log10(largest / width)))
    return f"{low:.{digits}g} to {high:.{digits}g}"


def _gain_in_words(gain: float) -> str:
    """A gain with four decimals, or with five digits where its units make it very small or large."""
    if np.isnan(gain):
        return "none, it integrates"
    # a gain of exactly zero has no digits to show
    if gain == 0.0 or SMALLEST_DECIMAL <= abs(gain) < LARGEST_DECIMAL:
        return f"{gain:.4f}"
    return f"{gain:.5g}"


def _response_rows(fitted: FittedModel) -> list[tuple[str, str]]:
    """Delay and settling time of every path of an impulse response, which has no other parameters to show."""
    if fitted.estimate.method != "impulseest":
        return []
    first, rows = fitted.parts[0], []
    for features, name in zip(response_features(fitted.estimate), first.input_names or (), strict=True):
        path = f", {name} → {(first.output_names or ())[0]}" if first.nu > 1 else ""
        delay = "no sample differs from zero"
        if features.delay is not None:
            delay = f"{features.delay} samples, {features.delay * first.dt:.4g} s"
        rows.append((f"first response{path}", delay))
        rows.append((f"gain of the response{path}", f"{features.gain:.4g} ± {features.gain_deviation:.2g}"))
        settling = "not within the response"
        if features.settling is not None:
            settling = f"{features.settling * first.dt:.4g} s, to within 2 % of the gain"
        rows.append((f"settling time{path}", settling))
    return rows


def _bandwidth_in_words(claim: BandwidthClaim) -> str:
    if not np.isfinite(claim.hz):
        return "—" if claim.refused else "none below Nyquist"
    interval = f"{claim.low:.4g} to {claim.high:.4g} Hz" if np.isfinite(claim.low) else "not known to this method"
    return f"{claim.hz:.4g} Hz, 95 % interval {interval}"


def _noise_rows(model: Estimate, unit: str) -> list[tuple[str, str]]:
    noise = np.sqrt(np.diag(model.noise_variance))
    square = f"{unit}²" if unit else ""
    return [
        *_zero_rows(model),
        ("standard deviation of the noise", ", ".join(f"{deviation:.4g}{unit}" for deviation in noise)),
        ("final prediction error", f"{model.fpe:.4g}{square}"),
        ("AIC, BIC (normalised, per sample)", f"{model.aic:.5g}, {model.bic:.5g}"),
    ]


def _zero_rows(model: Estimate) -> list[tuple[str, str]]:
    if model.method == "impulseest":
        return []
    if isinstance(model, ContinuousEstimate):
        return [("zeros / (rad/s)", roots_text(model.zeros()))]
    return [("zeros (z plane)", roots_text(model.zeros()))]


def _residual_rows(result: Identification) -> list[tuple[str, str]]:
    test = result.test
    if test is None:
        return [("residual test", f"not computed: {result.untested}")]
    # Several outputs have a table of their own.
    if result.fitted.parts[0].ny > 1:
        return []
    of_all = ""
    if result.test_of_all is not None:
        of_all = f"; of all samples {_test_outcomes(result.test_of_all.independent, result.test_of_all.independence_p)}"
    # The correlations that a figure shows are those of the residuals as they are.
    return [
        ("residuals white", _test_outcomes(test.white, test.whiteness_p)),
        (
            "residuals independent of the input",
            f"{_test_outcomes(test.independent, test.independence_p)}, tested on whitened residuals{of_all}",
        ),
    ]


def _nonlinearity_rows(result: Identification) -> list[tuple[str, str]]:
    """Outcome of the test of nonlinear dependence on the input, of each output."""
    test = result.nonlinearity
    if test is None or not np.isfinite(test.p_values).any():
        return []
    outcomes, names = [], result.fitted.parts[0].output_names or ()
    for i, (p, distortion, kind) in enumerate(zip(test.p_values, test.distortion, test.kinds, strict=True)):
        # A single output needs no name.
        output = f"{names[i]} " if len(names) > 1 else ""
        if i in result.nonlinear:
            likeness = f"like {kind}, " if kind else ""
            outcomes.append(f"{output}yes ({likeness}{_percent(distortion)} of the output, p = {p:.2g})")
        else:
            hidden = f"; yet a servo with {test.hidden[i]} fits far better than a linear one" if test.hidden[i] else ""
            outcomes.append(f"{output}no (p = {p:.2g}, at most {_percent(distortion)} of the output){hidden}")
    return [("residuals nonlinear in the input", ", ".join(outcomes))]


def _percent(share: float) -> str:
    """A share in percent with two digits, above a hundred with all that stand before the point."""
    value = 100.0 * share
    return f"{value:.2g} %" if value < 99.5 else f"{value:.0f} %"


def _test_outcomes(passed: np.ndarray, p_values: np.ndarray) -> str:
    return ", ".join(map(_test_outcome, np.ravel(passed), np.ravel(p_values)))


def _test_outcome(passed: bool, p: float) -> str:
    return f"{'yes' if passed else 'no'} (p = {p:.2g})"


def roots_text(roots: ComplexArray) -> str:
    """Roots in the z plane, of each conjugate pair one, those at zero counted."""
    texts, delays = [], 0
    for root in roots:
        if abs(root) <= AT_ZERO:
            delays += 1
        elif root.imag > AT_ZERO:
            texts.append(f"{root.real:.4f} ± {root.imag:.4f}j")
        elif root.imag > -AT_ZERO:
            texts.append(f"{root.real:.4f}")
    if delays:
        texts.append(f"0 ({delays} times)" if delays > 1 else "0")
    return ", ".join(texts) or "none"
