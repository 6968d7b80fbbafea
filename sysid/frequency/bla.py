"""Best linear approximation from periodic data: response, noise, nonlinear distortion, and test against a model."""

import warnings
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import scipy
from numpy.typing import ArrayLike, NDArray

from sysid.frequency.unclaimed_errors import scatter_messages
from sysid.models.frequency_response import FrequencyResponse
from sysid.records.arguments import real_number, whole_number
from sysid.records.arrays import ComplexArray, FloatArray, Locked, rectangular
from sysid.records.data import IOData, as_experiments
from sysid.records.errors import SysidError, SysidWarning, warn_each
from sysid.records.printing import Part, numbers
from sysid.records.singular_values import singular_values

SAME_PERIODS = 1e-3  # difference of periods, relative to the standard deviation, that counts as rounding


@dataclass(frozen=True, eq=False, repr=False)
class BestLinearApproximation(Locked):
    """Mean response of a system over inputs of one spectrum, and the deviations of single realisations from it.

    Attributes:
        response: The mean response; its covariance is that of noise and distortion together with several realisations,
            else that of the noise.
        noise_variance: Variance of the mean response by noise, from the scatter over periods (nf, ny, nu).
        total_variance: Variance of the mean response by noise and distortion, from the scatter over realisations
            (nf, ny, nu); NaN with a single realisation.
        distortion_variance: Variance of the response in one realisation by nonlinear distortion (nf, ny, nu): R times
            total less noise, not below zero; NaN with a single realisation.
        distortion_p: p-value per line of "no distortion", an F test of total against noise variance (nf, ny, nu);
            uniform for a linear system; NaN with a single realisation.
        lines: Frequencies of the response in multiples of 1 / (period dt) (nf,).
        realisations: R.
        periods: P, per record.
    """

    response: FrequencyResponse
    noise_variance: FloatArray
    total_variance: FloatArray
    distortion_variance: FloatArray
    distortion_p: FloatArray
    lines: NDArray[np.int_]
    realisations: int
    periods: tuple[int, ...]

    def _parts(self) -> list[Part]:
        """Realisations and periods, nonlinear distortion and the mean response, for the printed text."""
        heading = f"{self.realisations} realisation(s) of {min(self.periods)} or more periods"
        distortion = (
            "deviations are those of noise alone: distortion repeats with the input, and shows between sequences"
        )
        if self.realisations > 1:
            distortion = f"nonlinear distortion / %: {', '.join(numbers(self.distortion_percent))}"
        return [heading, distortion, *self.response._parts()[1:]]

    @property
    def distortion_percent(self) -> FloatArray:
        """Nonlinear distortion of each output in percent of its linear part, root mean squares (ny,).

        Both mean squares are plain sums over the lines: the input is taken to have equal power at every line.
        """
        excess = self.realisations * (self.total_variance - self.noise_variance)
        linear = np.abs(self.response.response) ** 2 - self.total_variance
        ratio = np.maximum(excess.sum(axis=(0, 2)), 0.0) / linear.sum(axis=(0, 2))
        return np.asarray(100.0 * np.sqrt(ratio))


def bla(
    data: IOData | Sequence[IOData], period: int, *, lines: ArrayLike | None = None, audible: float = 1e-4
) -> BestLinearApproximation:
    """Best linear approximation by the robust method [Pintelon2012, sec. 4.3].

    R realisations of a periodic random-phase input, P steady periods of each. With one input every record is a
    realisation: G_r = Y_r / U_r from means over its periods; the scatter of Y_p - G_r U_p over periods is noise, that
    of G_r over realisations is noise and nonlinear distortion. With nu inputs every nu consecutive records
    make one realisation, and their input spectra must be linearly independent (orthogonal phases are best):
    G_r = Y_r U_r^-1. Put the transient into the initialisation window; the last whole periods after it are used.

    Args:
        data: The records, nu for each realisation.
        period: Length of a period in samples.
        lines: Multiples of 1 / (period dt) to estimate at (nf,); by default those the input excites, without 0 and
            the Nyquist frequency.
        audible: Least power of an excited line, relative to the strongest one.

    Returns:
        The mean response with the variances of noise and distortion.

    Raises:
        SysidError: Fewer than two whole periods in a record, a number of records that nu does not divide, a line
            without power, inputs that are not independent.

    Warns:
        SysidWarning: Periods of an input that differ; of a single realisation with one input, a response that scatters
            from line to line by more than the noise, as distortion makes it.
    """
    experiments = tuple(e.scored for e in as_experiments(data))
    first = experiments[0]
    nu = first.nu
    period = whole_number("period", period, 4)
    audible = real_number("audible", audible, "lie between 0 and 1", lambda ratio: 0.0 < ratio < 1.0)
    counts = _period_counts(experiments, int(period))
    if len(experiments) % nu:
        raise SysidError(f"with {nu} inputs a realisation takes {nu} records, got {len(experiments)} records in all")
    spectra = [_spectra(e, int(period), count) for e, count in zip(experiments, counts, strict=True)]
    _warn_unless_periodic(experiments, period, counts)
    power = np.sum([np.abs(u.mean(axis=0)) ** 2 for u, _ in spectra], axis=(0, 2))
    used = _excited_lines(lines, power, int(period), audible)

    responses, noise_variances = [], []
    for k in range(0, len(experiments), nu):
        records = [(u[:, used], y[:, used]) for u, y in spectra[k : k + nu]]
        response, noise_variance = _realisation_response(records, used, k // nu)
        responses.append(response)
        noise_variances.append(noise_variance)
    r = len(responses)
    # real and imaginary part of every line, from the scatter of its periods round their mean
    freedom = sum(2 * (count - 1) for count in counts)
    mean = np.mean(responses, axis=0)
    noise = np.sum(noise_variances, axis=0) / r**2
    total, p_value = _scatter_of_realisations(responses, noise, freedom)
    if r == 1 and nu == 1:
        warn_each(scatter_messages(used / (period * first.dt), mean, noise, power[used], float(freedom)))
    variance_of_mean = total if r > 1 else noise
    return BestLinearApproximation(
        response=FrequencyResponse(
            frequencies=used / (period * first.dt),
            response=mean,
            dt=first.dt,
            method="bla",
            covariance=0.5 * variance_of_mean[:, :, :, None, None] * np.eye(2),
            degrees_of_freedom=2.0 * (r - 1) if r > 1 else float(freedom),
            input_names=first.input_names or (),
            output_names=first.output_names or (),
        ),
        noise_variance=noise,
        total_variance=total,
        distortion_variance=r * np.maximum(total - noise, 0.0),
        distortion_p=p_value,
        lines=used,
        realisations=r,
        periods=tuple(counts),
    )


def _scatter_of_realisations(
    responses: Sequence[ComplexArray], noise: FloatArray, freedom: int
) -> tuple[FloatArray, FloatArray]:
    """Variance of the mean over realisations (nf, ny, nu), and p-value of "no distortion"; NaN of a single one.

    Args:
        responses: Of each realisation (nf, ny, nu).
        noise: Variance of their mean by noise (nf, ny, nu).
        freedom: Degrees of freedom of that variance.
    """
    r = len(responses)
    if r == 1:
        return np.full(noise.shape, np.nan), np.full(noise.shape, np.nan)
    scatter = np.array(responses) - np.mean(responses, axis=0)
    total = np.sum(np.abs(scatter) ** 2, axis=0) / (r * (r - 1))
    # without noise any scatter over realisations is distortion
    ratio = np.divide(total, noise, out=np.where(total > 0.0, np.inf, 1.0), where=noise > 0.0)
    return total, np.asarray(scipy.stats.f.sf(ratio, 2 * (r - 1), freedom))


def _period_counts(experiments: Sequence[IOData], period: int) -> list[int]:
    """Count the whole periods of each record; raises `SysidError` below two, which have no scatter."""
    counts = [len(e) // period for e in experiments]
    if min(counts) < 2:
        shortest = int(np.argmin(counts))
        raise SysidError(
            f"experiment {shortest} has {len(experiments[shortest])} samples behind its initialisation window, "
            f"fewer than two periods of {period}"
        )
    return counts


def _realisation_response(
    records: Sequence[tuple[ComplexArray, ComplexArray]], lines: NDArray[np.int_], realisation: int
) -> tuple[ComplexArray, FloatArray]:
    """Return the response G = Y U^-1 of a realisation and its variance by noise, both (nf, ny, nu).

    Args:
        records: Spectra of inputs (periods, nf, nu) and outputs (periods, nf, ny) of as many records as inputs.
        lines: Numbers of the lines, for the message.
        realisation: Number of the realisation, likewise.

    Raises:
        SysidError: Inputs that are linearly dependent over the records.
    """
    inputs = np.stack([u.mean(axis=0) for u, _ in records], axis=2)
    outputs = np.stack([y.mean(axis=0) for _, y in records], axis=2)
    values = singular_values(inputs)
    # beyond this condition the inverse would amplify noise a million times
    if (values[:, -1] <= 1e-6 * values[:, 0]).any():
        worst = int(np.argmin(values[:, -1] / np.maximum(values[:, 0], np.finfo(float).tiny)))
        raise SysidError(
            f"realisation {realisation}: the {len(records)} inputs are linearly dependent over its records at line "
            f"{lines[worst]}; expected independent ones, e.g. with orthogonal phases"
        )
    inverse = np.linalg.inv(inputs)
    g = outputs @ inverse
    variance = np.zeros(g.shape)
    for j, (u, y) in enumerate(records):
        errors = y - np.einsum("fij,pfj->pfi", g, u)
        errors = errors - errors.mean(axis=0)
        p = len(errors)
        of_mean = np.sum(np.abs(errors) ** 2, axis=0) / (p * (p - 1))
        variance += of_mean[:, :, None] * np.abs(inverse[:, [j], :]) ** 2
    return g, variance


def _warn_unless_periodic(experiments: Sequence[IOData], period: int, counts: Sequence[int]) -> None:
    """Warn if an input does not repeat from period to period."""
    largest, label = 0.0, ""
    for k, (e, count) in enumerate(zip(experiments, counts, strict=True)):
        periods = e.u[len(e) - count * period :].reshape(count, period, -1)
        spread = np.sqrt(np.mean((periods - periods.mean(axis=0)) ** 2, axis=(0, 1)))
        size = np.maximum(periods.std(axis=(0, 1)), np.finfo(float).tiny)
        difference = spread / size
        j = int(np.argmax(difference))
        if difference[j] > largest:
            largest, label = float(difference[j]), f"input {(e.input_names or ())[j]} of experiment {k}"
    if largest > SAME_PERIODS:
        warnings.warn(
            f"{label} is not periodic with {period} samples: its periods differ by {100.0 * largest:.3g} % of its "
            "standard deviation; where the input was not measured, the period is wrong",
            SysidWarning,
            stacklevel=3,
        )


def _spectra(e: IOData, period: int, count: int) -> tuple[ComplexArray, ComplexArray]:
    """Fourier transforms of the last `count` periods of input (count, lines, nu) and output (count, lines, ny)."""
    # the last ones, as a transient has died out by then
    begin = len(e) - count * period
    u = e.u[begin:].reshape(count, period, -1)
    y = e.y[begin:].reshape(count, period, -1)
    return scipy.fft.rfft(u, axis=1), scipy.fft.rfft(y, axis=1)


def _excited_lines(lines: ArrayLike | None, power: FloatArray, period: int, audible: float) -> NDArray[np.int_]:
    """Return the lines to estimate at: the requested ones if the input has power there, else all well excited ones.

    Args:
        lines: Requested lines; None: those with more power than `audible` times that of the strongest line.
        power: Power of the inputs by line.
        period: Length of a period in samples.
        audible: Least power of an excited line, relative to the strongest one.

    Raises:
        SysidError: A requested line out of range or without power, or a constant input.
    """
    # neither 0 Hz nor, of an even period, the Nyquist frequency
    last = (period - 1) // 2
    if lines is None:
        inner = power[1 : last + 1]
        if inner.max(initial=0.0) <= 0.0:
            raise SysidError("the input is constant over a period: nothing is excited")
        return np.asarray(1 + np.flatnonzero(inner > audible * inner.max()))
    lines = np.atleast_1d(rectangular("lines", lines))
    if lines.dtype.kind not in "iu" or lines.ndim != 1 or lines.size == 0 or lines.min() < 1 or lines.max() > last:
        raise SysidError(f"lines must be whole numbers from 1 to {last}, got {lines.tolist()!r}")
    # amplitudes of 1e-10 of the strongest are rounding of the transform
    silent = lines[power[lines] <= 1e-20 * power.max()]
    if len(silent):
        raise SysidError(f"the input has no power at the line(s) {', '.join(map(str, silent[:5]))}")
    return lines.astype(int)


@dataclass(frozen=True, eq=False)
class ResponseAgreement:
    """Comparison of a best linear approximation with the response of a model at the same lines.

    Attributes:
        frequencies: Hz (nf,).
        expected: Response of the model (nf, ny, nu).
        ratio: Approximation divided by expected response (nf, ny, nu).
        p: p-value of each line, uniform where model and approximation agree (nf, ny, nu).
        p_all: p-value over all lines (ny, nu).
    """

    frequencies: FloatArray
    expected: ComplexArray
    ratio: ComplexArray
    p: FloatArray
    p_all: FloatArray


def response_agreement(approximation: BestLinearApproximation, expected: ComplexArray) -> ResponseAgreement:
    """Test a best linear approximation against an exactly known response.

    At a line whose mean response G over R realisations has the estimated variance v, |G - G0|^2 / v has the F
    distribution with 2 and 2 (R - 1) degrees of freedom [Pintelon2012, sec. 4.3]: v is that of noise and distortion
    together, and G is normal. The lines are independent, so that -2 sum log p has the chi-square distribution with two
    degrees of freedom per line.

    Args:
        approximation: Approximation from several realisations.
        expected: The response at its lines (nf, ny, nu).

    Returns:
        Ratio of both responses, and p-values.

    Raises:
        SysidError: Shapes differ, or there is a single realisation.
    """
    p, over_all = agreement_p(approximation, expected)
    response = approximation.response
    return ResponseAgreement(response.frequencies, expected, response.response / expected, p, over_all)


def agreement_p(approximation: BestLinearApproximation, expected: ComplexArray) -> tuple[FloatArray, FloatArray]:
    """Return the p-values of `response_agreement`, of each line (nf, ny, nu) and over all lines (ny, nu).

    Raises:
        SysidError: Shapes differ, or there is a single realisation.
    """
    response = approximation.response.response
    if expected.shape != response.shape:
        raise SysidError(f"expected a response of shape {response.shape}, got {expected.shape}")
    if approximation.realisations < 2:
        raise SysidError("expected at least two realisations for the variance of the response, got one")
    statistic = np.abs(response - expected) ** 2 / approximation.total_variance
    p = scipy.stats.f.sf(statistic, 2, 2 * (approximation.realisations - 1))
    # Fisher's sum; a p-value that underflows must not make it infinite
    log_p = np.log(np.maximum(p, np.finfo(float).tiny))
    over_all = scipy.stats.chi2.sf(-2.0 * log_p.sum(axis=0), 2 * len(p))
    return p, over_all
