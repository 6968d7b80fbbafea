"""Bandwidths of responses and models: gain crossing, half-power bandwidth, and whether a record supports it."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import scipy

from sysid.models.continuous_estimate import sampled_poles
from sysid.models.estimate import Bandwidth, Estimate
from sysid.models.frequency_response import FrequencyResponse
from sysid.models.state_space import StateSpace
from sysid.records.arrays import FloatArray
from sysid.records.data import IOData
from sysid.records.excited_band import excited_band, hann_power, hann_window, lowest_strong_line, not_leakage

HALF_POWER = float(np.sqrt(0.5))  # gain 0.707: half the power of a response of gain one


def gain_crossing(response: FrequencyResponse, level: float) -> float:
    """First frequency in Hz at which the gain of a path falls below a level, interpolated on logarithmic axes.

    NaN if the gain never falls below the level, or lies below it from the first line on.
    """
    return crossing_frequency(response.frequencies, response.magnitude[:, 0, 0], level)


def crossing_frequency(f: FloatArray, gain: FloatArray, level: float) -> float:
    """First frequency in Hz at which a gain (nf,) at frequencies above 0 Hz (nf,) falls below a level.

    Interpolated on logarithmic axes. NaN if it never does, or lies below the level from the first frequency on.
    """
    below = np.flatnonzero(gain < level)
    if not len(below) or below[0] == 0:
        return float("nan")
    around = [int(below[0]) - 1, int(below[0])]
    # minus signs, since the gain falls and numpy interpolates over rising values only
    log_frequency = np.interp(-np.log(level), -np.log(gain[around]), np.log(f[around]))
    return float(np.exp(log_frequency))


def half_power_hz(model: StateSpace) -> float:
    """First frequency in Hz at which a path's gain falls to 0.707, whatever its gain at 0 Hz; NaN as `gain_crossing`.

    An input with power on both sides of this frequency measures it. The bandwidth, 3.01 dB below the gain at 0 Hz, is
    an extrapolation unless the input has power near 0 Hz.
    """
    f = np.geomspace(0.005, 0.5 / model.dt, 4000)
    return gain_crossing(FrequencyResponse(f, model.frequency_response(f), model.dt, "model"), HALF_POWER)


DEGREE = 4  # degree in squared frequency of the polynomial fitted to 1 / |G|^2
REACH = 2.0  # highest frequency of the fit, in multiples of the crossing frequency
NEIGHBOURS = 4  # lines on either side over which the variance is averaged


def response_bandwidth(response: FrequencyResponse) -> Bandwidth:
    """Half-power bandwidth and 95 % interval of each path (ny, nu), relative to the gain extrapolated to 0 Hz.

    Near and below its bandwidth the squared gain of a servo is mainly that of a few poles, so 1 / |G|^2 is a polynomial
    in squared frequency. It is fitted by weighted least squares to the lines up to twice the crossing, each corrected
    for the bias that noise gives to a squared modulus; its value at 0 Hz and its crossing of twice that value give the
    bandwidth, their covariance its interval, to first order and on a logarithmic scale. The variances of neighbouring
    lines, which are about equal, are averaged. The interval does not cover the error of the polynomial itself: 1e-4 of
    the bandwidth for a servo of a few poles, up to 5e-3 where neighbours of a joint answer between the lines. NaN where
    the response has no more lines in reach than the polynomial has coefficients, or never falls to half power.
    """
    _, ny, nu = response.response.shape
    hz, low, high = np.full((3, ny, nu), np.nan)
    for i, j in np.ndindex(ny, nu):
        hz[i, j], low[i, j], high[i, j] = _path_bandwidth(response, i, j)
    return Bandwidth(hz, (low, high))


def _path_bandwidth(response: FrequencyResponse, output: int, input: int) -> tuple[float, float, float]:
    """Bandwidth of one path and the ends of its 95 % interval, Hz; NaN where the lines do not determine it."""
    unknown = (np.nan, np.nan, np.nan)
    f, g = response.frequencies, response.response[:, output, input]
    if response.covariance is None or not np.isfinite(g).all():
        return unknown
    variance = _smooth(np.trace(response.covariance[:, output, input], axis1=1, axis2=2))
    # noise adds its variance to the expected squared modulus
    power = np.abs(g) ** 2 - variance
    # a median, so that a single noisy line does not decide how far the fit reaches
    below = np.flatnonzero(power < 0.5 * np.median(power[:3]))
    if not len(below) or (power[: below[0] + 1] <= 0.0).any():
        return unknown
    lines = np.flatnonzero(f <= REACH * f[below[0]])
    lines = lines[power[lines] > 0.0]
    if len(lines) < DEGREE + 2:
        return unknown
    # frequencies relative to the last line keep the powers of the basis at most one
    scale = f[lines[-1]]
    coefficients, covariance = _fit_inverse_power(f[lines] / scale, power[lines], variance[lines])
    crossing = _half_power_crossing(coefficients, covariance)
    if crossing is None:
        return unknown
    squared_frequency, deviation = crossing
    hz = float(scale * np.sqrt(squared_frequency))
    # the variance of every line is a mean over itself and its neighbours on either side
    freedom = (2 * NEIGHBOURS + 1) * response.degrees_of_freedom if response.degrees_of_freedom else np.inf
    reach = deviation * scipy.stats.t.ppf(0.975, freedom)
    return hz, float(hz * np.exp(-reach)), float(hz * np.exp(reach))


def _fit_inverse_power(f: FloatArray, power: FloatArray, variance: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Coefficients of the polynomial p(f^2) = 1 / |G|^2 by weighted least squares, lowest first, and covariance."""
    target = 1.0 / power
    # 1 / |G|^2 has the standard deviation 2 sd(|G|) / |G|^3, where the variance of |G| is half that of G.
    deviation = 2.0 * np.sqrt(0.5 * variance) / power**1.5
    basis = np.vander(f**2, DEGREE + 1, increasing=True) / deviation[:, None]
    inverse = np.linalg.pinv(basis)
    return inverse @ (target / deviation), inverse @ inverse.T


def _half_power_crossing(coefficients: FloatArray, covariance: FloatArray) -> tuple[float, float] | None:
    """Squared frequency x at which p = 1 / |G|^2 doubles, p(x) = 2 p(0), and the deviation of ln(frequency).

    None if the polynomial is not positive at 0 Hz or reaches twice that value only beyond the fitted lines, x > 1.
    """
    at_dc = np.eye(DEGREE + 1)[0]
    excess = np.polynomial.Polynomial(coefficients - 2.0 * coefficients[0] * at_dc)
    roots = excess.roots()
    # complex roots are no crossings; a real one may be computed with an imaginary part of rounding
    real = roots[(np.abs(roots.imag) < 1e-9) & (roots.real > 0.0)].real
    if coefficients[0] <= 0.0 or not len(real) or real.min() > 1.0:
        return None
    x = real.min()
    # Of p(x) = 2 p(0): dx = -(d p(x) - 2 d p(0)) / p'(x), and the frequency goes with the root of x.
    gradient = -(x ** np.arange(DEGREE + 1) - 2.0 * at_dc) / excess.deriv()(x)
    return x, 0.5 * np.sqrt(gradient @ covariance @ gradient) / x


def _smooth(variance: FloatArray) -> FloatArray:
    """Mean over neighbouring lines, over fewer at the ends."""
    window = np.ones(2 * NEIGHBOURS + 1)
    centred = slice(NEIGHBOURS, NEIGHBOURS + len(variance))
    sums = np.convolve(variance, window)[centred]
    counts = np.convolve(np.ones(len(variance)), window)[centred]
    return np.asarray(sums / counts)


WIDEST = 100.0  # ratio of the ends of a 95 % interval beyond which the bandwidth counts as undetermined
INTEGRATES = 1e-6  # distance from z = 1 below which a pole integrates: there is no gain at 0 Hz to compare with
DETECTED = 16.0  # power of a response above a frequency, in variances of the disturbance per line: four deviations
EXTRAPOLATED = 1.2  # bandwidth, relative to the highest excited frequency, from which on it is said to be extrapolated
BEYOND_LINES = 1.5  # likewise, relative to the highest strong line of the input, up to which the response is smooth
ROUNDING = 1e-12  # power of a line, relative to the strongest, that may be rounding of the record


@dataclass(frozen=True)
class BandwidthClaim:
    """Bandwidth of a model, withheld where the record cannot support it.

    Attributes:
        hz: Bandwidth, Hz; NaN where there is none, or none that the record supports.
        low: Lower end of the 95 % interval, Hz; NaN likewise.
        high: Upper end, Hz; NaN likewise.
        refused: Whether the model has a bandwidth that the record does not support.
        warnings: Reasons against the bandwidth, in words.
    """

    hz: float
    low: float
    high: float
    refused: bool
    warnings: tuple[str, ...]


def bandwidth_claim(
    estimate: Estimate,
    record: IOData,
    *,
    output: int = 0,
    input: int = 0,
    band: Bandwidth | None = None,
    judged: Sequence[IOData] = (),
) -> BandwidthClaim:
    """Check the bandwidth of a path of a model against the record of its fit, after all pre-processing.

    `band` are the bandwidths of the estimate, if already computed. Withheld ones are NaN. `judged` are records that
    judge the model: frequencies that the input excites in them are none to which it is extrapolated untested.
    """
    band = estimate.bandwidth() if band is None else band
    hz, low, high = band.path(output, input)
    lowest, _ = excited_band(record, input=input)
    poles = sampled_poles(estimate)
    objections: list[str] = []
    remarks: list[str] = []
    if len(poles) and np.abs(poles - 1.0).min() < INTEGRATES:
        objections.append("the model has a pole at one: it integrates, so it has no gain at 0 Hz and no bandwidth")
    elif np.isfinite(hz):
        objections += _bandwidth_objections((hz, low, high), record, lowest) or _below_strong_lines(
            estimate, record, hz
        )
        highest = _highest_excited(estimate, (record, *judged), output, input, hz)
        of_lines = _highest_line((record, *judged), input)
        if hz > max(highest, BEYOND_LINES * of_lines):
            objections.append(
                f"the bandwidth is not determined: it is {hz:.2g} Hz in the model, extrapolated to {hz / highest:.2g} "
                f"times the highest frequency that the input excites, {highest:.2g} Hz"
            )
        elif hz > EXTRAPOLATED * highest:
            remarks.append(
                f"the bandwidth is extrapolated: it is {hz / highest:.2g} times the highest frequency that the input "
                f"excites, {highest:.2g} Hz; its interval holds if the response is smooth between them"
            )
    elif estimate.model.is_stable() and float(estimate.dc_gain()[output, input]) != 0.0:
        nyquist = 0.5 / record.dt
        highest = _highest_excited(estimate, (record, *judged), output, input, nyquist)
        if EXTRAPOLATED * highest < nyquist:
            objections.append(
                f"the bandwidth is not determined: the model has none, but the input excites nothing above "
                f"{highest:.2g} Hz"
            )
    warnings = objections + remarks
    if lowest > 0:
        warnings.append(
            f"nothing below {lowest:.2g} Hz is excited; the gain at 0 Hz, and with it the bandwidth, is extrapolated"
        )
    if len(poles) and np.abs(poles).max() > 1.0 + INTEGRATES:
        warnings.append(f"the model is unstable: a pole has modulus {np.abs(poles).max():.4g}")
    if objections:
        hz = low = high = float("nan")
    return BandwidthClaim(hz, low, high, bool(objections), tuple(warnings))


def _bandwidth_objections(bandwidth: tuple[float, float, float], record: IOData, lowest: float) -> list[str]:
    """Reasons why a record, excited from the frequency `lowest` on, does not support a bandwidth and interval (Hz)."""
    hz, low, high = bandwidth
    objections: list[str] = []
    # `not <=` counts an upper end that is NaN as too wide
    if np.isfinite(low) and not high <= WIDEST * low:
        objections.append(
            f"the bandwidth is not determined: its 95 % interval, {low:.2g} to {high:.2g} Hz, spans more than a "
            f"factor of {WIDEST:g}"
        )
    duration = len(record.scored) * record.dt
    # a time constant of a third of the record has its bandwidth there: what is slower may be a disturbance
    shortest = 0.5 / duration
    if hz < shortest:
        objections.append(
            f"the bandwidth is not determined: it is {hz:.2g} Hz in the model, but the record of "
            f"{duration:.3g} s holds no half period of frequencies below {shortest:.2g} Hz"
        )
    if lowest > hz:
        objections.append(
            f"the bandwidth is not determined: it is {hz:.2g} Hz in the model, but the input excites nothing below "
            f"{lowest:.2g} Hz"
        )
    return objections


def _below_strong_lines(estimate: Estimate, record: IOData, hz: float) -> list[str]:
    """The objection to a bandwidth below the strong lines of an input, with which errors of the model repeat.

    Such a model is not exact, as with friction or too low an order: it follows strong lines, at others it is free.
    """
    if "covariance_of_independent_errors" not in estimate.diagnostics:
        return []
    line = lowest_strong_line([record.scored])
    if hz >= line:
        return []
    return [
        f"the bandwidth is not determined: it is {hz:.2g} Hz in the model, below the lowest strong line of the input, "
        f"{line:.2g} Hz, and errors that repeat with the input show that the model is not exact there"
    ]


def _highest_excited(estimate: Estimate, records: Sequence[IOData], output: int, input: int, enough: float) -> float:
    """Highest frequency that an input excites in some record, Hz, looked for no further once it is `enough`.

    Lines too weak to stand out count as far as the response to them exceeds the disturbance.
    """
    highest = max(_highest_line(records, input), *(1.0 / (len(record) * record.dt) for record in records))
    for record in records:
        if highest < enough:
            highest = max(highest, _highest_detected(estimate, record, output, input))
    return highest


def _highest_line(records: Sequence[IOData], input: int) -> float:
    """Highest frequency at which the spectrum of an input stands out in some record, Hz."""
    return max(excited_band(record, input=input)[1] for record in records)


def _highest_detected(estimate: Estimate, record: IOData, output: int, input: int) -> float:
    """Highest frequency from which on upwards the response of a path exceeds the disturbance, Hz; 0 if none.

    The powers of the lines, each in expected powers of the disturbance, are added up from the Nyquist frequency down.
    """
    model, u = estimate.model, record.scored.u[:, input]
    variance = np.atleast_2d(estimate.noise_variance)
    if not np.isfinite(variance).all() or not model.is_stable():
        return 0.0
    f = np.fft.rfftfreq(len(u), record.dt)
    power = hann_power(u)
    response = np.abs(model.frequency_response(f)[:, output, input]) ** 2 * power
    shaping = model.noise_response(f)[:, output]
    disturbance = np.einsum("ki,ij,kj->k", shaping, variance, shaping.conj()).real * np.sum(hann_window(len(u)) ** 2)
    # without noise, rounding would stand out
    relative = response / np.maximum(disturbance, ROUNDING * response.max()) * not_leakage(power)
    detected = np.flatnonzero(np.cumsum(relative[::-1])[::-1] >= DETECTED)
    return float(f[detected[-1]]) if len(detected) else 0.0
