"""Input design: the input within limits that minimises the predicted variance of a quantity."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import scipy
from numpy.typing import ArrayLike

from sysid.design.information import Information, Quantity, pilot_of, transform_length
from sysid.design.multisine import crest_factor, low_crest_turns, sum_of_sines
from sysid.design.spectrum import optimal_spectrum
from sysid.models.estimate import Estimate
from sysid.models.polynomials import Polynomials
from sysid.models.state_space import StateSpace
from sysid.records.arguments import real_number, truth_value, whole_number
from sysid.records.arrays import FloatArray, Locked, real_array
from sysid.records.data import LARGEST
from sysid.records.errors import SysidError

STARTS = 8  # number of first signals, all with the optimal spectrum: one with a low peak, the others with random phases
STEPS = 60  # most linear programmes of each search
WEAK = 1e-3  # least share of the power of a spectral line that the first signals contain
SETTLED = 1e-4  # relative improvement, and distance in amplitudes, below which a search ends


def bandwidth_hz(model: StateSpace) -> float:
    """Half-power bandwidth of the first output, Hz: the quantity that is designed for by default."""
    return float(model.bandwidth()[0, 0])


@dataclass(frozen=True, eq=False, repr=False)
class InputDesign(Locked):
    """An input within limits, and what it is predicted to tell.

    Attributes:
        u: The input (N, 1).
        dt: Sampling interval, s.
        amplitude: Limit of |u|.
        rate: Limit of the changes of u per s.
        value: Quantity of the model, the mean over several models.
        deviation: Predicted standard deviation of its best estimate, over several models the root of the mean variance.
        bound: No input of that amplitude goes below.
        comparison: Deviation that another input gives; None without one.
        frequencies: Of the optimal spectrum (nf,), Hz.
        spectrum: Sum of squares of an input with that spectrum, at each frequency (nf,).
    """

    u: FloatArray
    dt: float
    amplitude: float
    rate: float
    value: float
    deviation: float
    bound: float
    comparison: float | None
    frequencies: FloatArray
    spectrum: FloatArray

    @property
    def crest_factor(self) -> float:
        """Largest absolute value over the root mean square."""
        return float(crest_factor(self.u)[0])

    def __str__(self) -> str:
        """A few lines: limits, predicted standard deviation, bound, comparison, where the power lies."""
        limits = f"|u| <= {self.amplitude:.4g}"
        if self.rate < np.inf:
            limits += f", changes <= {self.rate:.4g} per s"
        lines = [
            f"Input of {len(self.u)} samples every {self.dt:g} s, {limits}, crest factor {self.crest_factor:.3f}",
            f"  predicted standard deviation {self.deviation:.4g} of {self.value:.4g}",
            f"  no input of this amplitude has less than {self.bound:.4g}",
        ]
        if self.comparison is not None:
            ratio = (self.comparison / self.deviation) ** 2
            lines.append(f"  the input to compare with has {self.comparison:.4g}: {ratio:.3g} times the variance")
        power = np.cumsum(np.abs(np.fft.rfft(self.u[:, 0])) ** 2)
        quartiles = np.searchsorted(power, np.array([0.25, 0.5, 0.75]) * power[-1])
        hz = quartiles / (len(self.u) * self.dt)
        lines.append("  a quarter, half, three quarters of its power up to {:.3g}, {:.3g}, {:.3g} Hz".format(*hz))
        return "\n".join(lines)


def design_input(
    model: Estimate | Polynomials | Sequence[Estimate | Polynomials],
    samples: int,
    *,
    amplitude: float,
    rate: float = np.inf,
    quantity: Quantity = bandwidth_hz,
    comparison: ArrayLike | None = None,
    dt: float | None = None,
    variance: float | None = None,
    offset: bool = True,
    seed: int = 0,
) -> InputDesign:
    """Find the input within limits that minimises the predicted variance of a quantity, such as the bandwidth.

    First the optimal spectrum. Signals of that spectrum are then changed sample by sample to raise the information of
    the record itself: each step solves a linear programme, since limits of amplitude and rate are linear, and the best
    of several searches is taken. The variance is that of an efficient estimate, by the delta method, with offset and
    initial state estimated too [Ljung1999, sec. 9.4 and 13.3; Jansson2005]. An input that only its amplitude limits
    becomes binary by itself.

    Args:
        model: An estimate from a first record; or polynomials, with `dt` and `variance`. For several, all with the same
            sampling interval, the mean of the variances is minimised: an input for an uncertain system.
        samples: Length N of the record.
        amplitude: Limit of |u|.
        rate: Limit of the changes of u per s; the record begins at u = 0.
        quantity: Function from a model to a number, or to several, whose variances are added.
        comparison: An input (N,), from rest, to compare with.
        dt: Sampling interval of polynomials, s.
        variance: Of the innovation of polynomials.
        offset: Whether the offset of the output is unknown, as where means are removed.
        seed: Draws the phases of first signals.

    Returns:
        The input with its predicted standard deviation, the bound and the comparison.

    Raises:
        SysidError: Limits that are not positive or out of range, a model with several inputs, without covariance or
            unstable, models of different sampling intervals, a quantity that is not finite, a comparison of another
            length, out of range or that does not determine the parameters.
    """
    n = whole_number("samples", samples, 2, 10**6)
    # as of recorded signals: sums of squares must stay finite
    smallest = 1.0 / LARGEST
    sizes = f"be a number > 0, from {smallest:g} to {LARGEST:g}"
    amplitude = real_number("amplitude", amplitude, sizes, lambda v: smallest <= v <= LARGEST)
    rate = real_number("rate", rate, f"be a number > 0, {smallest:g} or more", lambda v: v >= smallest)
    rng = np.random.default_rng(whole_number("seed", seed, 0))
    alternatives = list(model) if isinstance(model, Sequence) else [model]
    pilots = [pilot_of(pilot, n, dt=dt, variance=variance, size=amplitude) for pilot in alternatives]
    intervals = sorted({pilot.model.dt for pilot in pilots})
    if len(intervals) != 1:
        raise SysidError(f"models with the sampling intervals {intervals} s: expected one or more models of one")
    if not callable(quantity):
        raise SysidError(f"quantity must be a function of a model, got {type(quantity).__name__}")
    size, interval = transform_length(pilots, n), intervals[0]
    offset = truth_value("offset", offset)
    models = [Information.of(pilot, n, size, quantity, offset=offset) for pilot in pilots]
    compared = None
    if comparison is not None:
        compared_criterion, _ = _mean_criterion(models, _signal(comparison, n))
        compared = float(np.sqrt(compared_criterion))
    # no input within the amplitude has more energy
    spectrum, bound = optimal_spectrum(models, n * amplitude**2)
    step = rate * interval / amplitude
    searches = [_search(models, amplitude, step, start) for start in _starts(spectrum, n, step, rng)]
    best, criterion = min(searches, key=lambda signal_and_criterion: signal_and_criterion[1])
    frequencies = np.fft.rfftfreq(size, interval)
    return InputDesign(
        u=amplitude * best[:, None],
        dt=interval,
        amplitude=amplitude,
        rate=rate,
        value=float(np.mean([np.mean(quantity(pilot.model)) for pilot in pilots])),
        deviation=float(np.sqrt(criterion)),
        bound=float(np.sqrt(max(bound, 0.0))),
        comparison=compared,
        frequencies=np.asarray(frequencies, dtype=np.float64),
        spectrum=spectrum,
    )


def _signal(u: ArrayLike, n: int) -> FloatArray:
    """Check the input to compare with (n,)."""
    signal = real_array("comparison", u)
    if signal.shape not in ((n,), (n, 1)):
        raise SysidError(f"comparison: expected shape ({n},) or ({n}, 1), got {signal.shape}")
    if np.abs(signal).max() > LARGEST:
        raise SysidError(f"comparison: largest value {np.abs(signal).max():g} given, expected {LARGEST:g} at most")
    return signal.ravel()


def _starts(spectrum: FloatArray, n: int, step: float, rng: np.random.Generator) -> list[FloatArray]:
    """Signals (n,) of a spectrum within -1 to 1, and of changes up to `step`."""
    lines = np.arange(1, max(2, (n + 1) // 2))
    # the spectrum has the finer lines of the padded transform: each goes to the nearest multiple of 1/n
    nearest = np.round(np.arange(len(spectrum)) * n / (2 * len(spectrum))).astype(int)
    shares = np.bincount(np.clip(nearest, 1, lines[-1]), spectrum, len(lines) + 1)[1:] / spectrum.sum()
    lines, heights = lines[shares > WEAK], np.sqrt(shares[shares > WEAK])
    phases = [low_crest_turns(n, lines, heights), *rng.random((STARTS - 1, len(lines)))]
    starts = []
    for turns in phases:
        signal = sum_of_sines(n, lines, turns, heights)
        largest_change = np.abs(np.diff(signal, prepend=0.0)).max()
        starts.append(signal / max(np.abs(signal).max(), largest_change / step))
    return starts


def _mean_criterion(models: Sequence[Information], u: FloatArray) -> tuple[float, FloatArray]:
    """Mean criterion of a record (n,) over the models, and its derivatives by the samples (n,)."""
    values, slopes = zip(*(model.of_signal(u) for model in models), strict=True)
    return float(np.mean(values)), np.asarray(np.mean(slopes, axis=0))


def _search(models: Sequence[Information], amplitude: float, step: float, x: FloatArray) -> tuple[FloatArray, float]:
    """Follow the linearised criterion of amplitude x within a region that grows with success, to a vertex of limits."""
    value, slope = _mean_criterion(models, amplitude * x)
    radius = 1.0
    for _ in range(STEPS):
        trial = _lowest(slope, np.maximum(x - radius, -1.0), np.minimum(x + radius, 1.0), step)
        trial_value, trial_slope = _mean_criterion(models, amplitude * trial)
        if trial_value < value:
            gain = value - trial_value
            # from one limit to the other is 2
            radius = min(2.0, 2.0 * radius)
            x, value, slope = trial, trial_value, trial_slope
            if gain < SETTLED * abs(value):
                break
        else:
            radius *= 0.3
            if radius < SETTLED:
                break
    return x, value


def _lowest(slope: FloatArray, low: FloatArray, high: FloatArray, step: float) -> FloatArray:
    """Minimise slope @ x within limits of each sample (n,) and of the changes between samples, from x = 0 on."""
    # changes from one limit to the other are allowed: the samples are independent
    if step >= 2.0:
        return np.where(slope > 0.0, low, high)
    low[0], high[0] = max(low[0], -step), min(high[0], step)
    n = len(slope)
    changes = scipy.sparse.diags_array([-1.0, 1.0], offsets=[0, 1], shape=(n - 1, n))
    rows, bounds = scipy.sparse.vstack((changes, -changes)), np.column_stack((low, high))
    # scaled, because the solver's tolerances are absolute
    result = scipy.optimize.linprog(slope / np.abs(slope).max(), rows, np.full(2 * n - 2, step), bounds=bounds)
    if result.x is None:
        raise SysidError(f"the linear programme of the limits failed: {result.message}")
    return np.asarray(np.clip(result.x, low, high))
