"""Gains at 0 Hz as they are shown: none of a path that integrates, zero of one with a zero at 0 Hz."""

import numpy as np

from sysid.models.estimate import Estimate
from sysid.models.frequency_response import FrequencyResponse
from sysid.models.state_space import StateSpace
from sysid.records.arrays import FloatArray

SLOWEST = 1e-6
"""Frequency, relative to Nyquist, with whose gain that at 0 Hz is compared."""

INTEGRATES = 1e3
"""Gain at 0 Hz, relative to that at `SLOWEST`, from which on a path integrates: rounding gives it a finite gain."""

VANISHING = 1e-9
"""Gain at 0 Hz, relative to that at `SLOWEST`, below which it is rounding of zero."""

UNSEEN = 10.0
"""Gain at 0 Hz, relative to that of one period in the record, from which on an integrator causes it."""


def gain_at_zero(model: Estimate | StateSpace, dt: float) -> FloatArray:
    """Gain at 0 Hz (ny, nu), NaN for paths that integrate, whatever the units of the channels; interval dt, s."""
    gain = np.asarray(model.dc_gain())
    # a size relative to the response itself: gains of unlike units may be of any size
    slow = _magnitude(model, SLOWEST * 0.5 / dt)
    with np.errstate(invalid="ignore"):
        # rounding leaves the pole of an integrator beside one, and its gain finite
        integrates = ~np.isfinite(gain) | ((np.abs(gain) >= INTEGRATES * slow) & (gain != 0.0))
    # a zero at 0 Hz leaves rounding
    vanishes = np.abs(gain) < VANISHING * slow
    return np.where(integrates, np.nan, np.where(vanishes, 0.0, gain))


def gain_told_by(model: Estimate | StateSpace, dt: float, samples: int) -> FloatArray:
    """`gain_at_zero`, and NaN too for paths with a mode so slow that it is an integrator for a record of this length.

    An estimate of an integrator has its pole beside one, and a gain at 0 Hz that is finite and means nothing.
    """
    gain = gain_at_zero(model, dt)
    of_one_period = _magnitude(model, 1.0 / (samples * dt))
    return np.where(np.abs(gain) >= UNSEEN * of_one_period, np.nan, gain)


def _magnitude(model: Estimate | StateSpace, frequency: float) -> FloatArray:
    """Modulus of the response at one frequency, Hz (ny, nu)."""
    response = model.frequency_response(np.array([frequency]))
    return np.abs(response.response[0] if isinstance(response, FrequencyResponse) else response[0])
