"""Errors of a simulation, line by line: of the mean period of inputs that repeat, or of bands of whole records."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import scipy

from sysid.models.delta_method import spread
from sysid.models.estimate import Estimate
from sysid.records.arrays import ComplexArray, FloatArray
from sysid.records.data import IOData
from sysid.records.repetition import Repetition
from sysid.validation.misfit_posterior import Lines

STRONG = 0.05  # power of a line, relative to the strongest near it, from which on it tells anything of the response
NEAR = 1.5  # ratio of frequencies within which lines are neighbours
AUDIBLE = 1e-3  # power of a line, relative to the strongest of all, likewise
BAND = 2.0 ** (1 / 6)  # ratio of the ends of a band over which a response hardly changes
NARROW_BAND = 2.0 ** (1 / 12)  # likewise where resonances are to show
POOLED = 3  # bands on either side over which the variance of the noise is averaged
FEWEST_COMMON = 10  # lines of all sequences that tell what they have in common
SWEEP = 0.75  # length of the mean of unit vectors: 0.9 to 1 of sweeps, below 0.6 of random phases
SPARE = 7  # lines of a band beyond those that its response takes: they show the noise
NO_RESPONSE = 1e-12  # of the largest response at any line, below which one is zero but for rounding


@dataclass(frozen=True)
class Spectra:
    """Transforms of inputs and of a simulation error at some frequencies.

    Attributes:
        frequencies: Hz (n,).
        inputs: (n, nu).
        errors: (n,).
    """

    frequencies: FloatArray
    inputs: ComplexArray
    errors: ComplexArray


def lines_of_mean_periods(
    experiments: Sequence[IOData], errors: Sequence[FloatArray], groups: Sequence[Repetition]
) -> Spectra:
    """Strong lines of the mean period of every sequence, from errors of an output of each experiment (N_i,).

    Errors may be NaN; the mean is over those that are known.
    """
    parts = []
    for group in groups:
        dt = experiments[group.starts[0][0]].dt
        inputs = scipy.fft.rfft(group.folded([e.u for e in experiments]).mean(axis=0), axis=0)
        folded = group.folded([error[:, None] for error in errors])[:, :, 0]
        known = np.isfinite(folded)
        mean = np.where(known, folded, 0.0).sum(axis=0) / np.maximum(known.sum(axis=0), 1)
        error = _transform_of_known(mean, np.any(known, axis=0, keepdims=True)[0])
        f = scipy.fft.rfftfreq(group.period, dt)
        # neither 0 Hz nor, of an even period, the Nyquist frequency
        inner = slice(1, (group.period + 1) // 2)
        f, inputs, error = f[inner], inputs[inner], error[inner]
        strong = _strong_lines(f, np.sum(np.abs(inputs) ** 2, axis=1))
        parts.append(Spectra(f[strong], inputs[strong], error[strong]))
    return Spectra(
        np.concatenate([part.frequencies for part in parts]),
        np.concatenate([part.inputs for part in parts]),
        np.concatenate([part.errors for part in parts]),
    )


def _transform_of_known(signal: FloatArray, known: np.ndarray) -> ComplexArray:
    """Transform of a signal (N,) of which samples are known or not; noise from the unknown ones, but no less of it."""
    share = float(np.mean(known))
    if not share:
        return np.zeros(len(signal) // 2 + 1, dtype=complex)
    return np.asarray(scipy.fft.rfft(np.where(known, signal, 0.0)) / share)


@dataclass(frozen=True)
class SequencesCompared:
    """Errors of a simulation under several sequences, compared: too low an order makes them alike, distortion does not.

    Attributes:
        p_common: p-value of the hypothesis that the sequences' errors have no response from the input in common.
        p_alike: p-value of the hypothesis that they differ by no more than noise.
        are_sweeps: Whether in every sequence neighbouring lines have phases of a sweep.
    """

    p_common: float = float("nan")
    p_alike: float = float("nan")
    are_sweeps: bool = False


def compare_sequences(
    experiments: Sequence[IOData], errors: Sequence[FloatArray], groups: Sequence[Repetition]
) -> SequencesCompared:
    """Compare the errors under several sequences, line by line of their mean periods.

    Of every line the share of the errors' power is taken that one response from the input explains in all sequences.
    If they have nothing in common it has a beta distribution of one and one less than the sequences, whatever the power
    of the line; the mean of many is about normal. What the response leaves is compared with the scatter between the
    periods, by an F test.

    Args:
        experiments: The records, with one input.
        errors: Errors of an output of each (N_i,).
        groups: The sequences.

    Returns:
        The p-values; NaN of a single sequence, several inputs, sequences with different periods or few common lines.
    """
    inputs = [experiment.u for experiment in experiments]
    are_sweeps = all(_is_sweep(group.folded(inputs).mean(axis=0)) for group in groups)
    return replace(_p_values_of_sequences(experiments, errors, groups), are_sweeps=are_sweeps)


def _is_sweep(period: FloatArray) -> bool:
    """Whether an input of a period (N, nu) sweeps over its lines: the group delay rises or falls by equal steps.

    Of random phases the second differences have any direction, and their mean is near zero.
    """
    for column in period.T:
        spectrum = scipy.fft.rfft(column - column.mean())
        magnitude = np.abs(spectrum)
        phasors = spectrum / np.maximum(magnitude, np.finfo(float).tiny)
        strong = magnitude**2 > STRONG * magnitude.max(initial=0.0) ** 2
        bends = (phasors[2:] * phasors[:-2] * phasors[1:-1].conj() ** 2)[strong[2:] & strong[1:-1] & strong[:-2]]
        if len(bends) >= FEWEST_COMMON and abs(bends.mean()) > SWEEP:
            return True
    return False


def _p_values_of_sequences(
    experiments: Sequence[IOData], errors: Sequence[FloatArray], groups: Sequence[Repetition]
) -> SequencesCompared:
    """The p-values of `compare_sequences`."""
    if len(groups) < 2 or len({group.period for group in groups}) > 1 or experiments[0].nu > 1:
        return SequencesCompared()
    parts = [lines_of_mean_periods(experiments, errors, [group]) for group in groups]
    together = set(parts[0].frequencies).intersection(*(set(part.frequencies) for part in parts[1:]))
    rows = [np.isin(part.frequencies, sorted(together)) for part in parts]
    u = np.array([part.inputs[row, 0] for part, row in zip(parts, rows, strict=True)])
    e = np.array([part.errors[row] for part, row in zip(parts, rows, strict=True)])
    common = np.abs(np.sum(e * u.conj(), axis=0)) ** 2 / np.sum(np.abs(u) ** 2, axis=0)
    power = np.sum(np.abs(e) ** 2, axis=0)
    shares = common[power > 0.0] / power[power > 0.0]
    if len(shares) < FEWEST_COMMON:
        return SequencesCompared()
    g = len(groups)
    deviation = np.sqrt((g - 1) / (g**2 * (g + 1)) / len(shares))
    p_common = float(scipy.stats.norm.sf((shares.mean() - 1.0 / g) / deviation))
    f = np.array(sorted(together))
    noise, freedom = _noise_of_means(f * experiments[0].dt * groups[0].period, errors, groups)
    if not noise.min(initial=np.inf) > 0.0:
        # without noise nothing is alike by chance
        return SequencesCompared(p_common, 0.0)
    ratio = float(np.mean((power - common) / noise)) / (g - 1)
    return SequencesCompared(p_common, float(scipy.stats.f.sf(ratio, 2.0 * len(f) * (g - 1), freedom)))


def _noise_of_means(
    numbers: FloatArray, errors: Sequence[FloatArray], groups: Sequence[Repetition]
) -> tuple[FloatArray, float]:
    """Variance of the noise at lines of a mean period with these numbers (n,), averaged near, and its freedom."""
    lines = np.round(numbers).astype(int)
    power, freedom = np.zeros(groups[0].period // 2 + 1), 0.0
    for group in groups:
        folded = np.nan_to_num(group.folded([error[:, None] for error in errors])[:, :, 0])
        deviations = np.abs(scipy.fft.rfft(folded - folded.mean(axis=0), axis=1)) ** 2
        power += deviations.sum(axis=0) / (group.count - 1) / group.count
        freedom += 2.0 * (group.count - 1) * len(lines)
    pool = np.ones(2 * POOLED + 1)
    within = slice(POOLED, POOLED + len(power))
    means = np.convolve(power, pool)[within] / np.convolve(np.ones(len(power)), pool)[within]
    return means[lines] / len(groups), freedom


def _strong_lines(f: FloatArray, power: FloatArray) -> np.ndarray:
    """Rows of the lines with enough power."""
    strong = power > AUDIBLE * power.max(initial=0.0)
    first = np.searchsorted(f, f / NEAR)
    last = np.searchsorted(f, f * NEAR, side="right")
    for k in np.flatnonzero(strong):
        strong[k] = power[k] > STRONG * power[first[k] : last[k]].max()
    return np.flatnonzero(strong)


@dataclass(frozen=True)
class OutputLines:
    """Lines in units of an output.

    Attributes:
        frequencies: Hz (n,).
        inputs: Outputs of the paths (n, nu).
        errors: Measured less simulated output (n,).
        sensitivities: Change of the simulated output per parameter direction (n, p).
        size: Root of the sum of the squared gains of the paths (n,).
    """

    frequencies: FloatArray
    inputs: ComplexArray
    errors: ComplexArray
    sensitivities: ComplexArray
    size: FloatArray

    def rows(self, rows: slice | np.ndarray) -> "OutputLines":
        """Some of the lines."""
        return OutputLines(
            self.frequencies[rows], self.inputs[rows], self.errors[rows], self.sensitivities[rows], self.size[rows]
        )

    def relative(self, variances: FloatArray | None, freedom: float) -> Lines:
        """Divide by the size of the model's response; the variances (n,) are those of the noise in the output."""
        size = self.size
        inputs, sensitivities = self.inputs / size[:, None], self.sensitivities / size[:, None]
        relative_variances = None if variances is None else variances / size**2
        return Lines(self.frequencies, inputs, self.errors / size, sensitivities, relative_variances, freedom)


def _joined(parts: Sequence[OutputLines]) -> OutputLines:
    """Lines one after the other."""
    return OutputLines(
        np.concatenate([part.frequencies for part in parts]),
        np.concatenate([part.inputs for part in parts]),
        np.concatenate([part.errors for part in parts]),
        np.concatenate([part.sensitivities for part in parts]),
        np.concatenate([part.size for part in parts]),
    )


def _reduced(lines: OutputLines) -> tuple[OutputLines, float]:
    """As many lines as inputs, with all that a constant error of the response explains, and the squares of the rest."""
    q, _ = np.linalg.qr(lines.inputs)
    onto = q.conj().T
    kept = onto @ lines.errors
    rest = lines.errors - q @ kept
    middle = np.full(len(kept), np.exp(np.mean(np.log(lines.frequencies))))
    size = np.full(len(kept), np.exp(np.mean(np.log(lines.size))))
    band = OutputLines(middle, onto @ lines.inputs, kept, onto @ lines.sensitivities, size)
    return band, float(np.sum(np.abs(rest) ** 2))


def _output_lines(spectra: Spectra, estimate: Estimate, output: int) -> OutputLines:
    """Pass the lines of the inputs through the model."""
    f = spectra.frequencies
    g = estimate.realise(estimate.parameters).frequency_response(f)[:, output]
    changes = response_changes(estimate, f, output) * spectra.inputs[:, :, None]
    size = np.sqrt(np.sum(np.abs(g) ** 2, axis=1))
    # an error relative to a response of zero has no size
    largest = float(size.max(initial=0.0))
    size = np.maximum(size, NO_RESPONSE * largest if largest > 0.0 else 1.0)
    return OutputLines(f, spectra.inputs * g, spectra.errors, changes.sum(axis=1), size)


def relative_lines(spectra: Spectra, estimate: Estimate, output: int) -> Lines:
    """Divide errors at lines by the size of the model's response to one output."""
    return _output_lines(spectra, estimate, output).relative(None, 0.0)


def lines_of_records(
    experiments: Sequence[IOData], errors: Sequence[FloatArray], estimate: Estimate, output: int
) -> OutputLines:
    """Errors at all lines of whole records, of rising frequency.

    Args:
        experiments: The records.
        errors: Errors of an output of each (N_i,); NaN where they are not known.
        estimate: The model.
        output: Number of the output.
    """
    records = []
    for experiment, error in zip(experiments, errors, strict=True):
        n = len(experiment)
        inner = slice(1, (n + 1) // 2)
        spectra = Spectra(
            scipy.fft.rfftfreq(n, experiment.dt)[inner],
            # of unit power per sample, whatever the length of the record
            scipy.fft.rfft(experiment.u, axis=0)[inner] / np.sqrt(n),
            _transform_of_known(error, np.isfinite(error))[inner] / np.sqrt(n),
        )
        records.append(_output_lines(spectra, estimate, output))
    together = _joined(records)
    return together.rows(np.argsort(together.frequencies, kind="stable"))


def lines_of_bands(together: OutputLines, width: float = BAND) -> Lines:
    """Errors over bands of whole records, each band reduced to as many lines as there are inputs.

    In a band the relative error of the response is about constant; what it does not explain shows the variance of noise
    and distortion, which the phases of a long record make as rough.

    Args:
        together: All lines, of rising frequency.
        width: Ratio of the ends of a band.
    """
    reduced: list[OutputLines] = []
    squares: list[float] = []
    spares: list[int] = []
    for first, end in _bands(together.frequencies, together.inputs.shape[1], width):
        band, of_noise = _reduced(together.rows(slice(first, end)))
        reduced.append(band)
        squares.append(of_noise)
        spares.append(end - first - len(band.errors))
    if not reduced:
        # a record too short for a single band
        return together.rows(slice(0, 0)).relative(np.zeros(0), 0.0)
    # the variance of a band alone, from few lines, would make its lines stand out too often
    pool = np.ones(2 * POOLED + 1)
    within = slice(POOLED, POOLED + len(reduced))
    variances = np.convolve(squares, pool)[within] / np.convolve(spares, pool)[within]
    per_line = np.repeat(variances, [len(band.errors) for band in reduced])
    lines = _joined(reduced)
    power = np.sum(np.abs(lines.inputs) ** 2, axis=1)
    strong = np.flatnonzero(power > AUDIBLE * power.max(initial=0.0))
    return lines.relative(per_line, 2.0 * float(sum(spares))).chosen(strong)


def _bands(f: FloatArray, nu: int, width: float) -> list[tuple[int, int]]:
    """First and end row of each band of rising frequencies (n,)."""
    bands = []
    first = 0
    while len(f) - first >= nu + SPARE:
        end = max(int(np.searchsorted(f, f[first] * width)), first + nu + SPARE)
        # a last band that is too short joins the one before it
        if len(f) - end < nu + SPARE:
            end = len(f)
        bands.append((first, end))
        first = end
    return bands


def response_changes(estimate: Estimate, f: FloatArray, output: int) -> ComplexArray:
    """Change of the response to one output per standard direction of the parameters (nf, nu, p); p = 0 if unknown."""
    nu = estimate.model.nu
    if not np.isfinite(estimate.covariance).all():
        return np.zeros((len(f), nu, 0), dtype=complex)

    def response(theta: FloatArray) -> FloatArray:
        g = estimate.realise(theta).frequency_response(f)[:, output]
        return np.stack((g.real, g.imag))

    moves = spread(response, estimate.parameters, estimate.covariance)
    return np.moveaxis(moves[:, 0] + 1j * moves[:, 1], 0, -1)
