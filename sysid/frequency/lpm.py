"""Frequency response by local polynomials, free of leakage."""

import warnings
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import scipy
from numpy.typing import ArrayLike

from sysid.frequency.spectra import checked_frequencies
from sysid.models.frequency_response import FrequencyResponse, complex_covariance
from sysid.polynomial.data_checks import check_excitation
from sysid.records.arguments import whole_number
from sysid.records.arrays import ComplexArray, FloatArray
from sysid.records.data import IOData, as_experiments
from sysid.records.errors import SysidError, SysidWarning, warn_each
from sysid.records.repetition import LEAST_SHARE, repetitions, unrepeated_share

LARGEST_GRID = 400  # frequencies estimated at if none are given, at most
SPARE = 6  # equations beyond the unknowns, by default: they show the variance of the noise
ADDED = 2  # degree of the denominators that show whether polynomials suffice
BESIDE = (-1.5, -1.0, 0.0, 1.0, 1.5)  # half widths of a window beside a frequency at which that is tested
MOST_TESTED = 40  # frequencies at which that is tested, at most
SIGNIFICANT = 0.01  # p-value, of all frequencies together
DEPENDENT = (
    1e-8  # singular value of the scaled regressors, relative to the largest, of a response that is not determined
)


def lpm(
    data: IOData | Sequence[IOData],
    frequencies: ArrayLike | None = None,
    *,
    degree: int = 2,
    denominator: int = 0,
    half_width: int | None = None,
    period: int | None = None,
) -> FrequencyResponse:
    """Frequency response and noise by local polynomials of response and transient [Pintelon2012, ch. 7].

    About a frequency, response and leakage are both smooth: with r the distance in lines,

        Y(k + r) = sum_s g_s r^s U(k + r) + sum_s t_s r^s + V(k + r),  s = 0..degree,

    is solved by least squares over 2 half_width + 1 lines. The transient terms take up what a record that starts in
    motion, or stops in it, adds to its transform, which `etfe` counts as response. With a `denominator` both are
    rational functions with a common one, 1 + sum_s d_s r^s, to first order in the noise [McKelvey2012]: a lightly
    damped resonance is then seen with few lines. Several experiments share the response and have transients of their
    own; they may have any lengths. Initialisation windows are omitted; there is no need to detrend.

    Args:
        data: One experiment, or several; any numbers of inputs and outputs. Several inputs that are active together
            must not be alike over the lines of a window.
        frequencies: Hz, above 0 and up to Nyquist (nf,); by default lines of the record, at most 400.
        degree: Of the polynomials.
        denominator: Degree of the denominators; 0 for polynomials.
        half_width: Lines on either side; by default as few as leave 6 equations to show the noise. Of a band that
            reaches past an end of the spectrum, lines on the other side take the place.
        period: Samples after which the input repeats: the lines are then those of the mean over its whole periods, the
            last ones of a record. Nonlinear distortion, which repeats with the input, scatters from line to line and
            counts as noise. By default the period is found from the inputs, where all experiments have the same and it
            has lines enough; 0 takes the records as a whole.

    Returns:
        Response with covariance and noise spectrum (two-sided, unit^2/Hz); NaN where the input does not determine it.

    Raises:
        SysidError: Constant input, missing outputs, too few lines for the unknowns, a period that does not fit in.

    Warns:
        SysidWarning: No frequency at which the inputs determine the response; a given period with which the inputs do
            not repeat; a response that changes faster than polynomials follow, as beside a lightly damped resonance.
    """
    experiments = tuple(e.scored for e in as_experiments(data))
    first = experiments[0]
    degree = int(whole_number("degree", degree, 0, 10))
    denominator = int(whole_number("denominator", denominator, 0, 10))
    if half_width is not None:
        half_width = int(whole_number("half_width", half_width, 1))
    warn_each(check_excitation(experiments, [0] * first.nu))
    if period is None:
        period = _found_period(experiments, degree, denominator, half_width)
    elif period != 0:
        period = int(whole_number("period", period, 4))
        warn_each(_unlike_periods(experiments, period))
    # the mean over periods has the noise of one, divided by their number
    periods = float(np.mean([len(e) // period for e in experiments])) if period else 1.0
    if period:
        experiments = tuple(_mean_period(e, period, k) for k, e in enumerate(experiments))
    local = _LocalFit(tuple(_Lines.of(e) for e in experiments), degree, denominator)
    width = local.default_half_width() if half_width is None else half_width
    local.check(width)
    shortest = min(map(len, experiments))
    if frequencies is None:
        f = _default_frequencies(shortest, first.dt)
    else:
        f = checked_frequencies(frequencies, first.dt, zero=False)
    response, variance, noise = local.solve_all(f, width)
    warn_each(_fast_changes(local, f, width))
    if not np.isfinite(response).any():
        warnings.warn(
            f"the inputs do not determine the response at any of the {len(f)} frequencies: they have no power there, "
            "or are alike; the response is NaN",
            SysidWarning,
            stacklevel=2,
        )
    covariance = complex_covariance(variance, f, first.dt)
    covariance[~np.isfinite(variance)] = np.nan
    return FrequencyResponse(
        frequencies=f,
        response=response,
        dt=first.dt,
        method="lpm",
        covariance=covariance,
        noise_spectrum=np.asarray(periods * first.dt * noise, dtype=complex),
        degrees_of_freedom=2.0 * local.spare(width),
        resolution=np.full(len(f), (2 * width + 1) / (shortest * first.dt)),
        input_names=first.input_names or (),
        output_names=first.output_names or (),
    )


def _found_period(experiments: Sequence[IOData], degree: int, denominator: int, half_width: int | None) -> int:
    """Period that all experiments share, if its lines suffice; 0 without one."""
    groups = repetitions(experiments)
    repeating = {k for group in groups for k, _ in group.starts}
    if len({group.period for group in groups}) != 1 or len(repeating) < len(experiments):
        return 0
    period = groups[0].period
    # runs of one waveform, each played once, are no periods of a record
    if any(len(experiment) < 2 * period for experiment in experiments):
        return 0
    means = tuple(_Lines.of(_mean_period(e, period, k)) for k, e in enumerate(experiments))
    local = _LocalFit(means, degree, denominator)
    try:
        local.check(local.default_half_width() if half_width is None else half_width)
    except SysidError:
        return 0
    return period


def _unlike_periods(experiments: Sequence[IOData], period: int) -> list[str]:
    """Warn of experiments whose inputs differ from one period to the next by most of their power."""
    texts = []
    for k, experiment in enumerate(experiments):
        count = len(experiment) // period
        if count < 2:
            continue
        share = unrepeated_share(experiment.u, period)
        if share > 1.0 - LEAST_SHARE:
            differing = share * (count - 1) / count
            texts.append(
                f"the inputs of experiment {k} do not repeat after {period} samples: {100.0 * differing:.0f} % of "
                "their power differs between the periods, and the mean over them is no response"
            )
    return texts


def _mean_period(experiment: IOData, period: int, k: int) -> IOData:
    """Mean over the last whole periods of an experiment, number k."""
    count = len(experiment) // period
    if not count:
        raise SysidError(
            f"experiment {k} has {len(experiment)} samples behind its initialisation window, fewer than a period of "
            f"{period}"
        )
    rows = len(experiment) - count * period
    u = experiment.u[rows:].reshape(count, period, -1).mean(axis=0)
    y = experiment.y[rows:].reshape(count, period, -1).mean(axis=0)
    return IOData(u, y, experiment.dt, input_names=experiment.input_names, output_names=experiment.output_names)


def _default_frequencies(samples: int, dt: float) -> FloatArray:
    """Lines of a record, all of a short one, else equally far apart on a logarithmic scale."""
    lines = np.arange(1, (samples + 1) // 2)
    if len(lines) > LARGEST_GRID:
        lines = np.unique(np.round(np.geomspace(1, lines[-1], LARGEST_GRID)).astype(int))
    return np.asarray(lines / (samples * dt))


@dataclass(frozen=True)
class _Lines:
    """Transforms of one experiment, of unit power per sample, without 0 Hz.

    Attributes:
        frequencies: Hz (n,).
        inputs: (n, nu).
        outputs: (n, ny).
    """

    frequencies: FloatArray
    inputs: ComplexArray
    outputs: ComplexArray

    @classmethod
    def of(cls, experiment: IOData) -> "_Lines":
        """Transform an experiment."""
        n = len(experiment)
        inner = slice(1, (n + 1) // 2)
        root = np.sqrt(n)
        return cls(
            scipy.fft.rfftfreq(n, experiment.dt)[inner],
            scipy.fft.rfft(experiment.u, axis=0)[inner] / root,
            scipy.fft.rfft(experiment.y, axis=0)[inner] / root,
        )


@dataclass(frozen=True)
class _LocalFit:
    """Least squares over the lines about a frequency.

    Attributes:
        records: The lines of each experiment.
        degree: Of the polynomials of response and transients.
        denominator: Degree of the denominator.
    """

    records: tuple[_Lines, ...]
    degree: int
    denominator: int

    @property
    def unknowns(self) -> int:
        """Unknowns of an output."""
        nu = self.records[0].inputs.shape[1]
        return (self.degree + 1) * (nu + len(self.records)) + self.denominator

    def spare(self, width: int) -> int:
        """Equations of an output beyond its unknowns."""
        return len(self.records) * (2 * width + 1) - self.unknowns

    def default_half_width(self) -> int:
        """Fewest lines on either side that leave `SPARE` equations, and as many as there are outputs."""
        ny = self.records[0].outputs.shape[1]
        width = 1
        while self.spare(width) < SPARE + ny - 1:
            width += 1
        return width

    def check(self, width: int) -> None:
        """Refuse a width with too few equations, or with more lines than an experiment has."""
        ny = self.records[0].outputs.shape[1]
        if self.spare(width) < ny:
            raise SysidError(
                f"half_width = {width} gives {len(self.records) * (2 * width + 1)} equations for {self.unknowns} "
                f"unknowns per output, expected {self.unknowns + ny} at least: use a larger one, or a lower degree"
            )
        fewest = min(len(record.frequencies) for record in self.records)
        if 2 * width + 1 > fewest:
            raise SysidError(
                f"half_width = {width} takes {2 * width + 1} lines, the shortest experiment has {fewest}: use more "
                "samples, a lower degree or a longer period"
            )

    def solve_all(self, f: FloatArray, width: int) -> tuple[ComplexArray, FloatArray, ComplexArray]:
        """Response (nf, ny, nu), its variance, and covariance of the noise (nf, ny, ny); NaN where it is not known."""
        ny, nu = self.records[0].outputs.shape[1], self.records[0].inputs.shape[1]
        response = np.full((len(f), ny, nu), np.nan, dtype=complex)
        variance = np.full((len(f), ny, nu), np.nan)
        noise = np.full((len(f), ny, ny), np.nan, dtype=complex)
        for k, frequency in enumerate(f):
            fit = self.solve(float(frequency), width)
            if fit is not None:
                response[k], variance[k], noise[k] = fit
        return response, variance, noise

    def solve(self, frequency: float, width: int) -> tuple[ComplexArray, FloatArray, ComplexArray] | None:
        """Response (ny, nu), its variance (ny, nu) and the covariance of the noise (ny, ny) at a frequency.

        None where the inputs do not determine the response.
        """
        phi, y, distances = self._regression(frequency, width)
        nu, ny = self.records[0].inputs.shape[1], self.records[0].outputs.shape[1]
        count = self.degree + 1
        response = np.empty((ny, nu), dtype=complex)
        gram_diagonal = np.empty((ny, nu))
        errors = np.empty_like(y)
        # the constant terms of the polynomials of the response
        places = np.arange(nu) * count
        for i in range(ny):
            columns = phi
            if self.denominator:
                columns = np.hstack((phi, _of_denominator(y[:, i], distances, self.denominator)))
            lengths = np.linalg.norm(columns, axis=0)
            if (lengths[places] == 0.0).any():
                return None
            lengths[lengths == 0.0] = 1.0
            left, values, right = np.linalg.svd(columns / lengths, full_matrices=False)
            kept = values > DEPENDENT * values[0]
            inverse = right[kept].conj().T / values[kept] / lengths[:, None]
            # a combination of inputs that has no effect leaves the response open
            if not kept.all() and np.abs(right[~kept][:, places]).max() > np.sqrt(DEPENDENT):
                return None
            theta = inverse @ (left[:, kept].conj().T @ y[:, i])
            errors[:, i] = y[:, i] - columns @ theta
            response[i] = theta[places]
            gram_diagonal[i] = np.sum(np.abs(inverse[places]) ** 2, axis=1)
        noise = errors.T @ errors.conj() / self.spare(width)
        return response, gram_diagonal * noise.diagonal().real[:, None], noise

    def _regression(self, frequency: float, width: int) -> tuple[ComplexArray, ComplexArray, FloatArray]:
        """Regressors (n, p) of response and transients, outputs (n, ny) and scaled distances (n,) of lines near."""
        powers = np.arange(self.degree + 1)
        count = self.degree + 1
        # the polynomial of the response, which all experiments share, needs one scale of frequency
        reach = max(float(record.frequencies[width] - record.frequencies[0]) for record in self.records)
        regressors, outputs, distances = [], [], []
        for k, record in enumerate(self.records):
            rows = _window(record.frequencies, frequency, width)
            r = (record.frequencies[rows] - frequency) / reach
            terms = r[:, None] ** powers
            of_response = record.inputs[rows][:, :, None] * terms[:, None, :]
            of_transients = np.zeros((len(r), len(self.records), count))
            of_transients[:, k] = terms
            regressors.append(np.hstack((of_response.reshape(len(r), -1), of_transients.reshape(len(r), -1))))
            outputs.append(record.outputs[rows])
            distances.append(r)
        return np.vstack(regressors), np.vstack(outputs), np.concatenate(distances)

    def p_of_polynomials(self, frequency: float, width: int) -> float:
        """Least p-value of an output of the hypothesis that polynomials suffice, and denominators explain nothing."""
        phi, y, distances = self._regression(frequency, width)
        basis = _orthonormal_basis(phi)
        least = 1.0
        for i in range(y.shape[1]):
            # the output without noise, which would explain itself
            fitted = basis @ (basis.conj().T @ y[:, i])
            whole = np.hstack((phi, _of_denominator(fitted, distances, ADDED)))
            rational = _orthonormal_basis(whole)
            freedom, added = len(y) - rational.shape[1], rational.shape[1] - basis.shape[1]
            if freedom < ADDED or added < 1:
                continue
            left = _squares_left(basis, y[:, i])
            explained = left - _squares_left(rational, y[:, i])
            ratio = explained / added / max((left - explained) / freedom, np.finfo(float).tiny)
            # complex equations and unknowns count twice
            least = min(least, float(scipy.stats.f.sf(ratio, 2 * added, 2 * freedom)) * y.shape[1])
        return least


def _of_denominator(y: ComplexArray, distances: FloatArray, degree: int) -> ComplexArray:
    """Regressors (n, degree) of a common denominator: Y = N U + T - (D - 1) Y."""
    return np.asarray(-y[:, None] * distances[:, None] ** np.arange(1, degree + 1))


def _orthonormal_basis(columns: ComplexArray) -> ComplexArray:
    """Orthonormal basis (n, r) of what columns (n, p) span beyond rounding."""
    lengths = np.linalg.norm(columns, axis=0)
    left, values, _ = np.linalg.svd(columns / np.where(lengths > 0.0, lengths, 1.0), full_matrices=False)
    return np.asarray(left[:, values > DEPENDENT * max(values[0], np.finfo(float).tiny)])


def _squares_left(basis: ComplexArray, y: ComplexArray) -> float:
    """Sum of squares of a signal (n,) beyond what a basis (n, r) explains."""
    return float(np.sum(np.abs(y - basis @ (basis.conj().T @ y)) ** 2))


def _fast_changes(local: _LocalFit, f: FloatArray, width: int) -> list[str]:
    """Warn of frequencies at which the response changes faster than the polynomials can follow."""
    if local.denominator:
        return []
    asked = f if len(f) <= MOST_TESTED else f[np.linspace(0, len(f) - 1, MOST_TESTED).astype(int)]
    lines = local.records[0].frequencies
    # a window that has the resonance at its end shows more of it than one about it
    apart = width * float(lines[1] - lines[0]) * np.array(BESIDE)
    centres = np.unique(np.clip(asked[:, None] + apart, lines[0], lines[-1]))
    p_values = np.array([local.p_of_polynomials(float(centre), width) for centre in centres])
    least = p_values < SIGNIFICANT / len(centres)
    near = np.abs(asked[:, None] - centres) <= 1.01 * apart.max()
    fast = asked[(near & least).any(axis=1)]
    if not len(fast):
        return []
    where = f"at {fast[0]:.3g} Hz" if len(fast) == 1 else f"from {fast[0]:.3g} to {fast[-1]:.3g} Hz"
    return [
        f"the response changes faster {where} than polynomials over {2 * width + 1} lines follow, as beside a lightly "
        "damped resonance: its values there may be wrong by more than their deviations say; denominator=2 follows it, "
        "and a longer record or period has closer lines"
    ]


def _window(f: FloatArray, frequency: float, width: int) -> slice:
    """The 2 width + 1 lines about a frequency; at an end of the spectrum those next to it."""
    nearest = int(np.clip(np.round((frequency - f[0]) / (f[1] - f[0])), 0, len(f) - 1))
    first = min(max(nearest - width, 0), len(f) - 2 * width - 1)
    return slice(first, first + 2 * width + 1)
