"""Filtering and resampling of records: inputs and outputs pass the same filter, so their relation stays."""

import math
from dataclasses import replace

import numpy as np
import scipy
from numpy.typing import ArrayLike

from sysid.records.arguments import real_number, whole_number
from sysid.records.arrays import FloatArray, real_array
from sysid.records.data import IOData, as_record
from sysid.records.errors import SysidError


def prefilter(data: IOData, numerator: ArrayLike, denominator: ArrayLike = 1.0) -> IOData:
    """Pass every channel through the causal filter numerator(q) / denominator(q) [Ljung1999, sec. 14.4].

    The filter starts in the steady state of each channel's first sample. Its transient acts on inputs and outputs as an
    unknown initial state does; lengthen the window with `replace` to exclude it.

    Args:
        data: The record.
        numerator: Coefficients of falling powers q^0, q^-1, ..., as of `scipy.signal.butter`.
        denominator: Likewise, the first not zero.

    Returns:
        The filtered record.

    Raises:
        SysidError: No coefficients, a filter that is not stable, missing samples.
    """
    data = as_record(data)
    b = np.atleast_1d(real_array("numerator", numerator))
    a = np.atleast_1d(real_array("denominator", denominator))
    if b.ndim != 1 or a.ndim != 1 or b.size == 0 or a.size == 0 or a[0] == 0.0:
        raise SysidError(f"expected two rows of coefficients, the denominator's first not zero, got {b} and {a}")
    radius = float(np.abs(np.roots(a)).max(initial=0.0))
    if radius >= 1.0:
        raise SysidError(f"the filter is not stable: largest pole modulus {radius:.6g}")
    _refuse_gaps(data)

    def filtered(channels: FloatArray) -> FloatArray:
        if max(len(a), len(b)) == 1 or not channels.size:
            return channels * b[0] / a[0]
        start = scipy.signal.lfilter_zi(b, a)[:, None] * channels[0]
        return np.asarray(scipy.signal.lfilter(b, a, channels, axis=0, zi=start)[0], dtype=np.float64)

    return replace(data, u=filtered(data.u), y=filtered(data.y))


def keep_band(data: IOData, low_hz: float = 0.0, high_hz: float = np.inf) -> IOData:
    """Keep the frequencies low_hz..high_hz of every channel, by the Fourier transform of the whole record.

    Zero phase and sharp edges; the record is taken as periodic, so that its ends ring where they do not meet.

    Args:
        data: The record.
        low_hz: Lower edge in Hz, itself kept; 0 keeps the mean.
        high_hz: Upper edge in Hz, itself kept.

    Returns:
        The filtered record.

    Raises:
        SysidError: Not a record, edges that are no frequencies, no frequency of the record within them, missing
            samples.
    """
    data = as_record(data)
    low_hz = real_number("low_hz", low_hz, "be a frequency >= 0 Hz", lambda f: f >= 0.0)
    high_hz = real_number("high_hz", high_hz, "be a frequency >= 0 Hz", lambda f: f >= 0.0)
    f = scipy.fft.rfftfreq(len(data), data.dt)
    in_band = (f >= low_hz) & (f <= high_hz)
    if not in_band.any():
        step = f[1] if len(f) > 1 else 0.0
        raise SysidError(
            f"no frequency of the record lies in {low_hz} to {high_hz} Hz; they are 0 to {f[-1]:.6g} Hz in steps of "
            f"{step:.6g} Hz"
        )
    _refuse_gaps(data)

    def limited(channels: FloatArray) -> FloatArray:
        return np.asarray(
            scipy.fft.irfft(scipy.fft.rfft(channels, axis=0) * in_band[:, None], len(channels), axis=0),
            dtype=np.float64,
        )

    return replace(data, u=limited(data.u), y=limited(data.y))


def _refuse_gaps(data: IOData, operation: str = "filtered") -> None:
    if not data.complete:
        raise SysidError(f"a record with missing samples cannot be {operation}: take data.complete_parts() one by one")


LARGEST_FACTOR = 10**7  # of a change of rate: the filter has twenty times as many coefficients


def resample(data: IOData, up: int, down: int = 1) -> IOData:
    """Resample to `up / down` times the rate by a zero-phase polyphase filter.

    Inputs and outputs pass the same filter, so that their relation below the lower of the two Nyquist frequencies is
    unchanged. Beyond its ends the record is continued by the straight line through its first and last sample.
    A filtered input is no longer held between samples: `intersample` becomes `bl`. Near the ends, over about
    10 max(up, down) / up of the old samples, the record is less exact.

    Args:
        data: The record.
        up: Numerator of the ratio of rates.
        down: Denominator.

    Returns:
        Record with sampling interval dt * down / up; the initialisation window lasts as long as before.

    Raises:
        SysidError: up or down below 1, missing samples, or fewer than two resulting samples.
    """
    up, down = whole_number("up", up, 1, LARGEST_FACTOR), whole_number("down", down, 1, LARGEST_FACTOR)
    data = as_record(data)
    _refuse_gaps(data, "resampled")
    divisor = math.gcd(up, down)
    up, down = up // divisor, down // divisor
    if up == down:
        return data
    samples = -(-len(data) * up // down)
    if samples < 2:
        raise SysidError(f"of {len(data)} samples only {samples} would remain at {up}/{down} of the rate")

    def resampled(channels: FloatArray) -> FloatArray:
        return np.asarray(scipy.signal.resample_poly(channels, up, down, axis=0, padtype="line"), dtype=np.float64)

    return replace(
        data,
        u=resampled(data.u),
        y=resampled(data.y),
        dt=data.dt * down / up,
        window=min(-(-data.window * up // down), samples - 1),
        intersample="bl",
    )
