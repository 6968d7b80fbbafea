"""Errors of a simulation, line by line: of the mean period of inputs that repeat, or of bands of whole records."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import scipy

from sysid.models.delta_method import spread
from sysid.models.estimate import Estimate
from sysid.records.arrays import ComplexArray, FloatArray
from sysid.records.data import IOData
from sysid.records.repetition import Repetition, repetitions
from sysid.validation.misfit_posterior import Lines

STRONG = 0.05  # power of a line, relative to the strongest near it, from which on it tells anything of the response
NEAR = 1.5  # ratio of frequencies within which lines are neighbours
AUDIBLE = 1e-3  # power of a line, relative to the strongest of all, likewise
BAND = 2.0 ** (1 / 6)  # ratio of the ends of a band over which a response hardly changes
POOLED = 3  # bands on either side over which the variance of the noise is averaged
SPARE = 7  # lines of a band beyond those that its response takes: they show the noise


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
    """Strong lines of the mean period of every sequence, from errors of an output of each experiment (N_i,)."""
    parts = []
    for group in groups:
        dt = experiments[group.starts[0][0]].dt
        inputs = scipy.fft.rfft(group.folded([e.u for e in experiments]).mean(axis=0), axis=0)
        error = scipy.fft.rfft(group.folded([error[:, None] for error in errors]).mean(axis=0)[:, 0])
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


def _strong_lines(f: FloatArray, power: FloatArray) -> np.ndarray:
    """Rows of the lines with enough power."""
    strong = power > AUDIBLE * power.max(initial=0.0)
    first = np.searchsorted(f, f / NEAR)
    last = np.searchsorted(f, f * NEAR, side="right")
    for k in np.flatnonzero(strong):
        strong[k] = power[k] > STRONG * power[first[k] : last[k]].max()
    return np.flatnonzero(strong)


@dataclass(frozen=True)
class _OutputLines:
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


def _output_lines(spectra: Spectra, estimate: Estimate, output: int) -> _OutputLines:
    """Pass the lines of the inputs through the model."""
    f = spectra.frequencies
    g = estimate.realise(estimate.parameters).frequency_response(f)[:, output]
    changes = response_changes(estimate, f, output) * spectra.inputs[:, :, None]
    size = np.sqrt(np.sum(np.abs(g) ** 2, axis=1))
    return _OutputLines(f, spectra.inputs * g, spectra.errors, changes.sum(axis=1), size)


def lowest_strong_line(experiments: Sequence[IOData]) -> float:
    """Lowest frequency at which every input has a fair share of the power of its strongest line, Hz."""
    lowest = 0.0
    groups = repetitions(experiments)
    for j in range(experiments[0].nu):
        of_input = []
        if groups:
            for group in groups:
                mean = group.folded([e.u[:, [j]] for e in experiments]).mean(axis=0)[:, 0]
                power = np.abs(scipy.fft.rfft(mean)) ** 2
                of_input.append(_first_strong(power) / (group.period * experiments[0].dt))
        else:
            for e in experiments:
                power = np.abs(scipy.fft.rfft(e.u[:, j])) ** 2
                # single lines of a random input may be weak by chance
                power[1:] = scipy.ndimage.uniform_filter1d(power[1:], SPARE, mode="nearest")
                of_input.append(_first_strong(power) / (len(e) * e.dt))
        lowest = max(lowest, min(of_input))
    return lowest


def _first_strong(power: FloatArray) -> int:
    """Number of the first line, without that at 0 Hz, of at least `STRONG` of the power of the strongest (n,)."""
    return 1 + int(np.argmax(power[1:] >= STRONG * power[1:].max(initial=0.0)))


def relative_lines(spectra: Spectra, estimate: Estimate, output: int) -> Lines:
    """Divide errors at lines by the size of the model's response to one output."""
    lines = _output_lines(spectra, estimate, output)
    size = lines.size
    inputs, sensitivities = lines.inputs / size[:, None], lines.sensitivities / size[:, None]
    return Lines(lines.frequencies, inputs, lines.errors / size, sensitivities, None, 0.0)


def lines_of_bands(
    experiments: Sequence[IOData], errors: Sequence[FloatArray], estimate: Estimate, output: int
) -> Lines:
    """Errors over bands of whole records, each band reduced to as many lines as there are inputs.

    In a band the relative error of the response is about constant; what it does not explain shows the variance of noise
    and distortion, which the phases of a long record make as rough.

    Args:
        experiments: The records.
        errors: Errors of an output of each (N_i,).
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
            scipy.fft.rfft(error)[inner] / np.sqrt(n),
        )
        records.append(_output_lines(spectra, estimate, output))
    f = np.concatenate([lines.frequencies for lines in records])
    order = np.argsort(f, kind="stable")
    f = f[order]
    inputs = np.concatenate([lines.inputs for lines in records])[order]
    of_output = np.concatenate([lines.errors for lines in records])[order]
    sensitivities = np.concatenate([lines.sensitivities for lines in records])[order]
    size = np.concatenate([lines.size for lines in records])[order]
    reduced: list[tuple[FloatArray, ComplexArray, ComplexArray, ComplexArray, FloatArray]] = []
    squares: list[float] = []
    spares: list[int] = []
    for first, end in _bands(f, inputs.shape[1]):
        rows = slice(first, end)
        q, _ = np.linalg.qr(inputs[rows])
        onto = q.conj().T
        kept = onto @ of_output[rows]
        rest = of_output[rows] - q @ kept
        squares.append(float(np.sum(np.abs(rest) ** 2)))
        spares.append(len(rest) - len(kept))
        middle = np.full(len(kept), np.exp(np.mean(np.log(f[rows]))))
        of_model = np.full(len(kept), np.exp(np.mean(np.log(size[rows]))))
        reduced.append((middle, onto @ inputs[rows], kept, onto @ sensitivities[rows], of_model))
    if not reduced:
        # a record too short for a single band
        none = np.zeros(0)
        return Lines(none, inputs[:0], of_output[:0], sensitivities[:0], none, 0.0)
    columns = [np.concatenate(column) for column in zip(*reduced, strict=True)]
    # the variance of a band alone, from few lines, would make its lines stand out too often
    pool = np.ones(2 * POOLED + 1)
    within = slice(POOLED, POOLED + len(reduced))
    variances = np.convolve(squares, pool)[within] / np.convolve(spares, pool)[within]
    per_line = np.repeat(variances, [len(kept) for _, _, kept, _, _ in reduced])
    size = columns[4]
    lines = Lines(
        columns[0],
        columns[1] / size[:, None],
        columns[2] / size,
        columns[3] / size[:, None],
        per_line / size**2,
        2.0 * float(sum(spares)),
    )
    power = np.sum(np.abs(columns[1]) ** 2, axis=1)
    return lines.chosen(np.flatnonzero(power > AUDIBLE * power.max(initial=0.0)))


def _bands(f: FloatArray, nu: int) -> list[tuple[int, int]]:
    """First and end row of each band of rising frequencies (n,)."""
    bands = []
    first = 0
    while len(f) - first >= nu + SPARE:
        end = max(int(np.searchsorted(f, f[first] * BAND)), first + nu + SPARE)
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
