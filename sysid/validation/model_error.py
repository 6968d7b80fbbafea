"""Error of a model's gain against the best linear system: noise, nonlinear distortion and too low an order together."""

import warnings
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import scipy
from numpy.typing import ArrayLike

from sysid.models.bandwidth import HALF_POWER, crossing_frequency
from sysid.models.estimate import Bandwidth, Estimate, as_estimate
from sysid.models.least_covariance import with_least_covariance
from sysid.models.predict import predict
from sysid.models.repeated_errors import LEVEL, RepeatedErrors, repeated_errors
from sysid.records.arguments import frequency_list, real_number
from sysid.records.arrays import FloatArray, Locked
from sysid.records.data import IOData, as_experiments
from sysid.records.errors import SysidError, SysidWarning
from sysid.records.excited_band import lowest_strong_line
from sysid.records.printing import Part, Table
from sysid.records.repetition import LEAST_SHARE, STILL, Repetition, unrepeated_share
from sysid.validation.alike_inputs import least_frequency_told
from sysid.validation.feedback import feedback
from sysid.validation.misfit_posterior import OCTAVES, Hypotheses, Lines, posterior, width_probabilities
from sysid.validation.parts_of_record import PartsOfRecord, compare_parts
from sysid.validation.simulation_lines import (
    NARROW_BAND,
    SequencesCompared,
    compare_sequences,
    lines_of_bands,
    lines_of_mean_periods,
    lines_of_records,
    relative_lines,
    response_changes,
)

FEWEST = 12  # lines about a frequency that tell noise and distortion from the error of the response
BESIDE_PARAMETERS = 6  # lines beyond the number of parameters
REACH = 8.0  # ratio of frequencies within which lines count all the same
BESIDE = 2.0  # ratio within which lines tell how fast the error changes
UNLIKE = 0.005  # share of the input's power that differs between periods, from which it is told
FEEDBACK = 1e-3  # p-value below which feedback is told
MOST_LINES = 200  # about a frequency: the time grows with their third power
AS_EFFICIENT = (
    "its parameters count as uncertain as those of an efficient one, `pem_ss` started from this model, at best"
)
NO_BOUND = "a bound of it cannot be computed either, so no interval is given; `pem_ss` started from this model has one"
ANCHORS = 24  # frequencies at which the posterior is computed, at most; between them it is interpolated
LOWEST, HIGHEST = 0.025, 0.975  # probabilities at the ends of a 95 % interval
LARGEST_STEP = 1.2  # ratio of neighbouring frequencies between which a gain is interpolated


@dataclass(frozen=True, eq=False, repr=False)
class ModelError(Locked):
    """Gain of a model, with intervals for the gain of the best linear system at the amplitude of the record.

    Attributes:
        frequencies: Hz (nf,).
        gain: Of the model (nf, ny, nu).
        noise_alone: Ends of the 95 % interval from the covariance of the parameters, as if errors were independent of
            the input (nf, ny, nu) each; NaN where the covariance is not known.
        interval: Ends of the 95 % interval with nonlinear distortion and too low an order (nf, ny, nu) each; it holds
            that of the parameters. NaN where the input has too few lines to tell.
        p_values: Of the hypothesis that noise explains the errors of the simulation, per output (ny,); NaN where the
            input has too few lines to test it.
        line_counts: Lines of the input that tell the errors apart, and how many are needed, per output.
        repeated: The periods of the input and what of the simulation errors repeats with them, per output; None where
            the input does not repeat.
        sequences: Errors under several sequences, compared: whether they are alike, as too low an order makes them, or
            differ, as distortion does, per output.
        parts: Gains of the parts of records without repetition, compared; None of records that repeat.
        least_told: Frequency, Hz, below which errors of two paths look alike, as one input copies another a little
            later; 0 without such inputs. Where noise does not explain the errors, intervals below it are NaN.
        p_feedback: Least p-value of "the inputs do not depend on past outputs", where noise explains the errors; NaN
            where it is not tested.
        strong_line: Lowest frequency at which every input is strong, Hz: below it a model extrapolates.
        covariance_is_known: Whether the estimator gives a covariance of the parameters; otherwise they count as if it
            were efficient.
        bound_is_known: Whether the parameters have a covariance, the estimator's or that of an efficient one; without
            it the interval is NaN.
        input_names: One name per input.
        output_names: One name per output.
    """

    frequencies: FloatArray
    gain: FloatArray
    noise_alone: tuple[FloatArray, FloatArray]
    interval: tuple[FloatArray, FloatArray]
    p_values: FloatArray
    line_counts: tuple[tuple[int, int], ...]
    repeated: tuple[RepeatedErrors | None, ...]
    sequences: tuple[SequencesCompared, ...]
    parts: PartsOfRecord | None
    least_told: float
    p_feedback: float
    strong_line: float
    covariance_is_known: bool
    bound_is_known: bool
    input_names: tuple[str, ...]
    output_names: tuple[str, ...]

    @property
    def is_wider(self) -> np.ndarray:
        """Whether errors beyond noise were found, which make the interval wider, per output (ny,)."""
        return np.asarray((self.p_values < LEVEL) | self._changes.any(axis=1))

    @property
    def _changes(self) -> np.ndarray:
        """Whether the gain of a path changes from part to part of the records (ny, nu)."""
        return np.zeros(self.gain.shape[1:], dtype=bool) if self.parts is None else self.parts.half_widths > 0.0

    @property
    def reasons(self) -> tuple[str, ...]:
        """Why the intervals are wider than noise alone makes them, and which experiment would tell more, per output."""
        texts = []
        for i in range(len(self.output_names)):
            text = self._reason(i)
            if self.parts is not None and self._changes[i].any() and np.isfinite(self.interval[0][:, i]).any():
                # what the errors of the whole record do not show, its parts do
                joined = ", but" if self.p_values[i] >= LEVEL else ";"
                text += (
                    f"{joined} the gain differs between the {self.parts.count} parts of the records "
                    f"(p = {self.parts.p_value:.2g}), as that of a nonlinearity does under a changing power, of a "
                    "plant that changes, or of a model that is too simple: the interval counts their scatter, and more "
                    "or longer records narrow it"
                )
            if self.p_values[i] < LEVEL and self.least_told > 0.0:
                text += (
                    f"; one input plays the sequence of another one a little later: below {self.least_told:.3g} Hz "
                    "the record does not tell which path has the error; sequences of their own would"
                )
            if not self.covariance_is_known:
                text += "; the estimator gives no covariance: "
                text += AS_EFFICIENT if self.bound_is_known else NO_BOUND
            texts.append(text + self._unlike_inputs(i))
        return tuple(texts)

    def bandwidth(self, reference: float | None = None) -> Bandwidth:
        """First frequency at which each gain is 3.01 dB below that at a reference (ny, nu), Hz, between `frequencies`.

        At the lowest strong line as reference no gain at 0 Hz is extrapolated. The interval is where a gain within
        `interval` may cross: from the frequency at which the lower end has fallen by that much from the upper end at
        the reference, to that at which the upper end has from the lower one. It holds more often than each of them. Its
        lower end is the reference where the interval there is wider than the fall. NaN where a crossing lies above the
        last frequency, or the input has too few lines to tell.

        Args:
            reference: One of `frequencies`, Hz; the lowest by default.

        Raises:
            SysidError: The reference is none of the frequencies; neighbours above it, up to the crossings, are further
                apart than a fifth.
        """
        order = np.argsort(self.frequencies, kind="stable")
        f = self.frequencies[order]
        at = f[0] if reference is None else real_number("reference", reference, "be at least 0", lambda hz: hz >= 0.0)
        if not np.any(f == at):
            raise SysidError(
                f"reference: expected one of the {len(f)} frequencies, {f[0]:g} to {f[-1]:g} Hz, got {at:g}"
            )
        rows = order[np.searchsorted(f, at) :]
        f = self.frequencies[rows]
        low, high = (end[rows] for end in self.interval)
        gain = self.gain[rows]
        hz, first, last = np.full((3, *gain.shape[1:]), np.nan)
        for i, j in np.ndindex(hz.shape):
            path = slice(None), i, j
            hz[i, j] = _crossing(f, gain[path], gain[0, i, j])
            first[i, j] = _crossing(f, low[path], high[0, i, j])
            last[i, j] = _crossing(f, high[path], low[0, i, j])
        _check_steps(f, np.stack((hz, last)))
        return Bandwidth(hz, (first, last), float(at))

    def _reason(self, output: int) -> str:
        name, p_value = self.output_names[output], self.p_values[output]
        repeated = self.repeated[output]
        lines, needed = self.line_counts[output]
        if not np.isfinite(p_value) or (p_value < LEVEL and lines < needed):
            more = "a longer record" if repeated is None else "a sequence with a longer period, or several sequences"
            return (
                f"{name}: noise, distortion and too low an order cannot be told from each other: the input has {lines} "
                f"lines for it, {needed} are needed; {more} would have them"
            )
        if p_value >= LEVEL:
            text = f"{name}: noise alone may make the errors of the simulation (p = {p_value:.2g})"
            if self.p_feedback < FEEDBACK:
                text += (
                    f", but the input depends on past outputs (p = {self.p_feedback:.2g}): under feedback they do not "
                    "show whether noise moved the model, as it moves `oe` and `okid`; `armax` or `bj` with a right "
                    "model of the noise are not moved"
                )
            return text
        if repeated is None or not repeated.is_significant:
            return (
                f"{name}: noise does not explain the errors of the simulation (p = {p_value:.2g}): the order is too "
                "low, the model of the noise is wrong, or a disturbance depends on the input"
            )
        of_all = ""
        if len(repeated.groups) > 1:
            of_all = f" of {len(repeated.groups)} sequences"
        periods = sum(group.count for group in repeated.groups)
        text = (
            f"{name}: {100.0 * repeated.share:.0f} % of the simulation errors' power is the same in all {periods} "
            f"periods{of_all}, so it is no noise: "
        )
        return text + self._told_by_sequences(output) + self._hidden_by_sweeps(output)

    def _unlike_inputs(self, output: int) -> str:
        """Say that the recorded input differs between its periods, as noise of its measurement makes it."""
        repeated = self.repeated[output]
        differing = 0.0 if repeated is None else 1.0 - min(group.share for group in repeated.groups)
        if differing < UNLIKE:
            return ""
        return (
            f"; {100.0 * differing:.2g} % of the input's power differs from period to period: if that is noise of its "
            f"measurement, gains from the true input are up to {100.0 * differing / (1.0 - differing):.2g} % larger, "
            "which no interval counts"
        )

    def _told_by_sequences(self, output: int) -> str:
        """Say whether the sequences show distortion, too low an order, or both."""
        compared = self.sequences[output]
        parts = []
        if compared.p_common < LEVEL:
            parts.append(f"the order is too low, as errors are alike in all sequences (p = {compared.p_common:.2g})")
        if compared.p_alike < LEVEL:
            also = "also " if parts else ""
            parts.append(
                f"nonlinear distortion, as errors {also}differ from sequence to sequence (p = {compared.p_alike:.2g})"
            )
        if parts:
            return ", and ".join(parts)
        text = "nonlinear distortion, or too low an order"
        if np.isfinite(compared.p_common):
            return f"{text}; the sequences do not tell which"
        repeated = self.repeated[output]
        if repeated is not None and len(repeated.groups) == 1:
            text += "; a second sequence, best a random-phase multisine of the same band and strength, tells them apart"
        return text

    def _hidden_by_sweeps(self, output: int) -> str:
        """Say that distortion under sweeps changes too smoothly from line to line to be seen."""
        if not self.sequences[output].are_sweeps:
            return ""
        return (
            "; the input sweeps over its frequencies: distortion that changes as smoothly does not show, and the "
            "interval may be too narrow; random-phase multisines would show it"
        )

    def _parts(self) -> list[Part]:
        """Reasons, then a table of gains and intervals, for the printed text."""
        parts: list[Part] = ["Gain of the best linear system, 95 % intervals", *self.reasons]
        for i, j in np.ndindex(self.gain.shape[1:]):
            columns = {
                "f / Hz": self.frequencies,
                "gain": self.gain[:, i, j],
                "noise alone, from": self.noise_alone[0][:, i, j],
                "to": self.noise_alone[1][:, i, j],
                "with distortion and order, from": self.interval[0][:, i, j],
                "to ": self.interval[1][:, i, j],
            }
            parts.append(f"{self.input_names[j]} to {self.output_names[i]}")
            parts.append(Table([(name, [f"{value:.4g}" for value in values]) for name, values in columns.items()]))
        return parts


def model_error(estimate: Estimate, data: IOData | Sequence[IOData], f_hz: ArrayLike) -> ModelError:
    """Intervals for the gain of the best linear system, where a model is of too low an order or friction distorts.

    The errors of the simulation are compared line by line with what noise explains: with the scatter between the
    periods of an input that repeats, else with their scatter between neighbouring lines. Where noise explains them, the
    interval is that of the parameters. Where it does not, the relative error of the response is estimated together with
    the rough part of the errors, which is noise and distortion [Goodwin1992]; the interval holds the posterior of the
    true gain with 95 %, the model's gain, and what noise alone makes.

    The best linear system is the one that is nearest to the true one, in mean square, under inputs of the spectrum and
    amplitude of this record [Pintelon2012, ch. 3]; at other amplitudes it is another one. Distortion that changes
    smoothly from line to line, as under a slow sweep, cannot be seen in one sequence. Nor does the simulation show what
    feedback does to a model (`reasons` say where there is some), and at the peak of a lightly damped resonance, or at
    the dip of an antiresonance, that the model lacks the interval falls short. Noise in the measurement of the input
    lowers the gain from the recorded input, which is the one that is estimated.

    Args:
        estimate: A stable model. Parameters without a covariance (`n4sid`, `pbsid`) count as uncertain as those of an
            efficient estimator would be, which they are at best: [Ljung1999, ch. 9] at the estimate.
        data: The records of its fit, as they were given to the estimator.
        f_hz: Frequencies, Hz (nf,).

    Returns:
        Gains and both intervals (nf, ny, nu), in units of output over input, and why they differ. Without a covariance
        of the parameters `noise_alone` is NaN.

    Raises:
        SysidError: A model that is not stable, channels that do not fit it, frequencies that are none, not finite,
            below 0 Hz or above Nyquist.

    Warns:
        SysidWarning: The model was estimated from other records.
    """
    estimate = as_estimate(estimate)
    f = frequency_list(f_hz)
    nyquist = 0.5 / estimate.model.dt
    if not len(f) or f.min() < 0.0 or f.max() > nyquist:
        got = f"{f.min():g} to {f.max():g}" if len(f) else "none"
        raise SysidError(f"frequencies: expected some of 0 Hz to Nyquist, {nyquist:g}, got {got}")
    experiments = as_experiments(data, missing=True)
    if not estimate.model.is_stable():
        raise SysidError("model_error simulates the model: expected a stable one")
    errors = simulation_errors(estimate, experiments)
    _warn_of_other_records(estimate, experiments)
    scored = [e.scored for e in experiments]
    ny = estimate.model.ny
    gain = np.abs(estimate.realise(estimate.parameters).frequency_response(f))
    noise_alone = _interval_of_parameters(as_if_errors_were_independent(estimate), f)
    covariance_is_known = bool(np.isfinite(estimate.covariance).all())
    estimate = with_least_covariance(estimate, scored)
    outputs = [_errors_of_output(estimate, scored, [error[:, i] for error in errors], i) for i in range(ny)]
    low, high = _interval(estimate, gain, outputs, f)
    least_told = least_frequency_told(scored) if any(output.p_value < LEVEL for output in outputs) else 0.0
    for i, output in enumerate(outputs):
        if output.p_value < LEVEL:
            low[f < least_told, i] = high[f < least_told, i] = np.nan
    parts = None
    if all(output.repeated is None for output in outputs):
        parts = compare_parts(estimate, scored)
        if parts.differ:
            low, high = _with_scatter(gain, low, high, parts.half_widths)
    return ModelError(
        frequencies=f,
        gain=gain,
        noise_alone=noise_alone,
        interval=(low, high),
        p_values=np.array([output.p_value for output in outputs]),
        line_counts=tuple((len(output.lines), lines_needed(output.lines)) for output in outputs),
        repeated=tuple(output.repeated for output in outputs),
        sequences=tuple(output.sequences for output in outputs),
        parts=parts,
        least_told=least_told,
        p_feedback=_p_of_feedback(scored) if any(output.p_value >= LEVEL for output in outputs) else float("nan"),
        strong_line=lowest_strong_line(scored),
        covariance_is_known=covariance_is_known,
        bound_is_known=bool(np.isfinite(estimate.covariance).all()),
        input_names=estimate.data.input_names,
        output_names=estimate.data.output_names,
    )


def _warn_of_other_records(estimate: Estimate, experiments: Sequence[IOData]) -> None:
    if estimate.data.hashes and not any(estimate.data.include(experiment) for experiment in experiments):
        warnings.warn(
            "the record is none that the model was estimated from: the intervals of its parameters and the errors of "
            "the simulation are of different records",
            SysidWarning,
            stacklevel=3,
        )


@dataclass(frozen=True)
class _OutputErrors:
    """What the simulation errors of one output tell; see `ModelError`.

    Attributes:
        lines: The errors line by line.
        p_value: Of the hypothesis that noise explains them.
        repeated: What of them repeats with the input.
        sequences: What several sequences tell.
    """

    lines: Lines
    p_value: float
    repeated: RepeatedErrors | None
    sequences: SequencesCompared


def _errors_of_output(
    estimate: Estimate, experiments: Sequence[IOData], errors: Sequence[FloatArray], output: int
) -> _OutputErrors:
    """Compare the errors of an output of each experiment (N_i,) with what noise explains."""
    repeated = repeated_errors(experiments, [error[:, None] for error in errors])
    if repeated is not None and not _every_input_repeats(experiments, repeated.groups):
        # what the path from another input leaves would seem to be noise
        repeated = None
    if repeated is not None and repeated.is_significant:
        spectra = lines_of_mean_periods(experiments, errors, repeated.groups)
        compared = compare_sequences(experiments, errors, repeated.groups)
        return _OutputErrors(relative_lines(spectra, estimate, output), repeated.p_value, repeated, compared)
    # bands show errors that are small at every single line of a period
    of_records = lines_of_records(experiments, errors, estimate, output)
    bands = lines_of_bands(of_records)
    p_value = _p_value_of_bands(bands)
    if p_value < LEVEL:
        bands = lines_of_bands(of_records, NARROW_BAND)
    return _OutputErrors(bands, p_value, repeated, SequencesCompared())


def _p_of_feedback(experiments: Sequence[IOData]) -> float:
    """Least p-value of no feedback to any input; NaN where it cannot be tested."""
    try:
        p_values = feedback(experiments).p_values
    except SysidError:
        # outputs are missing, or the records are too short
        return float("nan")
    known = p_values[np.isfinite(p_values)]
    return float(known.min()) if len(known) else float("nan")


def _every_input_repeats(experiments: Sequence[IOData], groups: Sequence[Repetition]) -> bool:
    """Whether each input that moves repeats with the sequences, not only most of their power."""
    for group in groups:
        folded = group.folded([experiment.u for experiment in experiments])
        for column in folded.reshape(-1, folded.shape[2]).T:
            moves = column.std() > STILL * np.abs(column).max()
            if moves and unrepeated_share(column[:, None], group.period) > 1.0 - LEAST_SHARE:
                return False
    return True


def _interval(
    estimate: Estimate, gain: FloatArray, outputs: Sequence[_OutputErrors], f: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Ends of the interval of gains (nf, ny, nu) with distortion and order, NaN where lines are too few to tell."""
    low, high = _interval_of_parameters(estimate, f)
    for i, output in enumerate(outputs):
        if np.isnan(output.p_value):
            # nothing is said in place of the intervals of the parameters, which noise alone would make
            low[:, i] = high[:, i] = np.nan
        if not output.p_value < LEVEL:
            continue
        with_error = _log_intervals(output.lines, estimate, i, f)
        for j in range(estimate.model.nu):
            below, above = gain[:, i, j] * np.exp(with_error[:, j].T)
            # the interval holds that of the parameters, whatever the lines say of its error; NaN where that is unknown
            low[:, i, j] = np.minimum(np.minimum(below, gain[:, i, j]), low[:, i, j])
            high[:, i, j] = np.maximum(np.maximum(above, gain[:, i, j]), high[:, i, j])
            unknown = ~np.isfinite(below)
            low[unknown, i, j] = high[unknown, i, j] = np.nan
    return low, high


def as_if_errors_were_independent(estimate: Estimate) -> Estimate:
    """The estimate with the covariance that it has where errors that repeat with the input count every time."""
    covariance = estimate.diagnostics.get("covariance_of_independent_errors")
    return estimate if covariance is None else replace(estimate, covariance=covariance)


def _interval_of_parameters(estimate: Estimate, f: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Ends of the 95 % interval of the gain (nf, ny, nu) each; NaN where the covariance is not known."""
    response = estimate.frequency_response(f)
    if response.covariance is None:
        unknown = np.full(response.response.shape, np.nan)
        return unknown, unknown.copy()
    low, high = response.magnitude_ci95()
    return low.copy(), high.copy()


def _with_scatter(
    gain: FloatArray, low: FloatArray, high: FloatArray, half_widths: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Widen the intervals of gains (nf, ny, nu) by an independent relative error of each path (ny, nu)."""
    below = gain - np.hypot(gain - low, half_widths * gain)
    return np.maximum(below, 0.0), gain + np.hypot(high - gain, half_widths * gain)


def simulation_errors(estimate: Estimate, experiments: Sequence[IOData]) -> list[FloatArray]:
    """Measured less simulated outputs behind the initialisation windows (N_i, ny); NaN where an output is missing."""
    errors = []
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", SysidWarning)
        for experiment in experiments:
            error = experiment.y - predict(estimate, experiment, steps=None)
            errors.append(error[experiment.window :])
    return errors


def _p_value_of_bands(lines: Lines) -> float:
    """p-value of the hypothesis that noise explains the errors of all bands, and how far the parameters are off.

    Two tests, of which the smaller p-value counts twice. What no change of the parameters explains: its sum of squares
    over the variances, real and imaginary part of every line, is about chi-square. And what a change would explain: the
    parameters that fit the simulation best differ from the estimated ones [Hausman1978], by no more than the variance
    of the one and that of the other make together. An estimator whose model of the noise is wrong, as `arx` has it
    beside friction, is seen by the second one alone.
    """
    variances = np.ones(len(lines)) if lines.variances is None else lines.variances
    root = np.sqrt(np.concatenate((variances, variances)) / 2.0)
    errors = np.concatenate((lines.errors.real, lines.errors.imag)) / root
    changes = np.concatenate((lines.sensitivities.real, lines.sensitivities.imag)) / root[:, None]
    lengths = np.maximum(np.linalg.norm(changes, axis=0), 1e-300)
    left, values, _ = np.linalg.svd(changes / lengths, full_matrices=False)
    explained = left[:, values > 1e-6 * values.max(initial=0.0)]
    count = explained.shape[1]
    freedom = len(errors) - count
    if freedom < FEWEST:
        return float("nan")
    along = explained.T @ errors
    remainder = errors - explained @ along
    # variances of bands have few degrees of freedom: a ratio of sums of squares
    p_value = float(scipy.stats.f.sf(float(remainder @ remainder) / freedom, freedom, lines.freedom))
    if not count:
        return p_value
    # in units of the noise: of the best parameters one, of the estimated ones what their directions move the lines by
    moved = explained.T @ changes
    difference = np.eye(count) + moved @ moved.T
    squares = float(along @ np.linalg.solve(difference, along))
    p_of_parameters = float(scipy.stats.f.sf(squares / count, count, lines.freedom))
    return min(1.0, 2.0 * min(p_value, p_of_parameters))


def _log_intervals(lines: Lines, estimate: Estimate, output: int, f: FloatArray) -> FloatArray:
    """Ends of the interval of the logarithm of true gain over the model's (nf, nu, 2); NaN where lines are too few."""
    nu = estimate.model.nu
    if len(lines) < lines_needed(lines):
        return np.full((len(f), nu, 2), np.nan)
    anchors = _anchors(f, lines.frequencies)
    g = estimate.realise(estimate.parameters).frequency_response(anchors)[:, output]
    changes = response_changes(estimate, anchors, output) / g[:, :, None]
    ends = np.empty((len(anchors), nu, 2))
    for k, frequency in enumerate(anchors):
        widths = width_probabilities(_lines_about(lines, float(frequency), BESIDE), float(frequency))
        hypotheses = posterior_at(lines, float(frequency), changes[k], widths)
        for j in range(nu):
            ends[k, j] = [hypotheses.log_gain_quantile(j, probability) for probability in (LOWEST, HIGHEST)]
    logarithm = np.log(np.maximum(f, anchors[0]))
    interpolated = np.empty((len(f), nu, 2))
    for j, end in np.ndindex(nu, 2):
        interpolated[:, j, end] = np.interp(logarithm, np.log(anchors), ends[:, j, end])
    return interpolated


def lines_needed(lines: Lines) -> int:
    """Number of lines about a frequency that tell noise and distortion from the error of the response."""
    return max(FEWEST, lines.sensitivities.shape[1] + BESIDE_PARAMETERS)


def posterior_at(
    lines: Lines, frequency: float, changes: np.ndarray, widths: Sequence[tuple[float, float]] = ((OCTAVES, 1.0),)
) -> Hypotheses:
    """Posterior of the relative error at a frequency in Hz from the lines about it.

    Args:
        lines: As many as `lines_needed` or more.
        frequency: Hz, above 0.
        changes: Relative change of the response of each path per parameter direction there (nu, p).
        widths: Octaves over which the error of the response may change, and their probabilities.
    """
    return posterior(_lines_about(lines, frequency, REACH), frequency, changes, widths)


def _lines_about(lines: Lines, frequency: float, reach: float) -> Lines:
    """Lines within a ratio of a frequency; no fewer than are needed, and at most `MOST_LINES`."""
    distance = np.abs(np.log(lines.frequencies / frequency))
    nearest = np.argsort(distance, kind="stable")
    chosen = distance <= np.log(reach)
    chosen[nearest[: lines_needed(lines)]] = True
    chosen[nearest[max(MOST_LINES, lines_needed(lines)) :]] = False
    return lines.chosen(np.flatnonzero(chosen))


def _anchors(f: FloatArray, of_lines: FloatArray) -> FloatArray:
    """Frequencies at which the posterior is computed, rising: those asked for where they are few."""
    # the error at 0 Hz is that far below the lowest line, where lines tell nothing any more
    slowest = of_lines.min() / REACH
    asked = np.unique(np.maximum(f, slowest))
    if len(asked) <= ANCHORS:
        return asked
    return np.geomspace(asked[0], asked[-1], ANCHORS)


def _check_steps(f: FloatArray, crossings: FloatArray) -> None:
    """Check that rising frequencies are close enough for gains between them, up to the last crossing.

    Raises:
        SysidError: They are not.
    """
    known = crossings[np.isfinite(crossings)]
    needed = f[f > 0.0]
    if len(known) == crossings.size:
        needed = needed[: np.searchsorted(needed, known.max()) + 1]
    steps = needed[1:] / needed[:-1]
    if len(steps) and steps.max() > LARGEST_STEP:
        k = int(np.argmax(steps))
        raise SysidError(
            f"bandwidth: expected frequencies in steps of a fifth or less, as numpy.geomspace(0.5, 10.0, 60) gives "
            f"them, got {needed[k]:g} and {needed[k + 1]:g} Hz beside each other"
        )


def _crossing(f: FloatArray, gain: FloatArray, reference: float) -> float:
    """First frequency in Hz at which a gain (nf,) has fallen by 3.01 dB from a reference, on logarithmic axes."""
    level = HALF_POWER * reference
    if gain[0] < level:
        return float(f[0])
    # 0 Hz has no logarithm: a crossing below the next frequency is there
    positive = f > 0.0
    f, gain = f[positive], gain[positive]
    return float(f[0]) if gain[0] < level else crossing_frequency(f, gain, level)
