"""Another sampling rate, without aliasing."""

from dataclasses import replace

import numpy as np
from scipy.signal import resample_poly

from sysid.records.arguments import whole_number
from sysid.records.arrays import FloatArray
from sysid.records.data import IOData, as_record
from sysid.records.errors import SysidError


def resample(data: IOData, up: int, down: int = 1) -> IOData:
    """Resample to `up / down` times the rate by a zero-phase polyphase filter.

    Inputs and outputs pass the same filter, so that their relation below the lower of the two Nyquist frequencies stays
    what it is. Beyond the ends the record is taken to go on as the straight line through its first and last sample.
    A filtered input is no longer held between samples: `intersample` becomes `bl`. Near the ends, over about
    10 max(up, down) / up of the old samples, the record is less exact.

    Args:
        data: The record.
        up: Numerator of the ratio of rates.
        down: Denominator.

    Returns:
        Record with sampling interval dt * down / up; the initialisation window lasts as long as before.

    Raises:
        SysidError: up or down below 1, missing samples, or fewer than two samples left.
    """
    up, down = whole_number("up", up, 1), whole_number("down", down, 1)
    data = as_record(data)
    if not data.complete:
        raise SysidError("a record with missing samples cannot be resampled: take data.complete_parts() one by one")
    divisor = int(np.gcd(up, down))
    up, down = up // divisor, down // divisor
    if up == down:
        return data
    left = -(-len(data) * up // down)
    if left < 2:
        raise SysidError(f"of {len(data)} samples {left} would be left at {up}/{down} of the rate")

    def changed(channels: FloatArray) -> FloatArray:
        return np.asarray(resample_poly(channels, up, down, axis=0, padtype="line"), dtype=np.float64)

    return replace(
        data,
        u=changed(data.u),
        y=changed(data.y),
        dt=data.dt * down / up,
        window=min(-(-data.window * up // down), left - 1),
        intersample="bl",
    )
