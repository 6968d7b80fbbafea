"""What may be said of a bandwidth: a number, or that the record does not tell it."""

from dataclasses import dataclass

import numpy as np

from sysid import Bandwidth, Estimate, IOData

WIDEST = 100.0
"""An interval whose ends differ by more than this factor says nothing."""

INTEGRATES = 1e-6
"""A pole this close to one integrates: there is no gain at 0 Hz to fall from."""

LINE = 1e-3
"""A line excites if it holds this part of the strongest line's power; below it are noise and leakage."""

FLOOR = 1e-2
"""A floor of many weak lines excites too if it holds this part of the power together."""

SCATTER = 0.03
"""Single lines of a random floor fall to this part of its middle and still belong to it."""

RESOLVED = 2
"""Lines of the record next to 0 Hz that the window cannot tell from it."""


@dataclass(frozen=True)
class Claim:
    """A bandwidth as far as it can be claimed.

    Attributes:
        hz: Bandwidth, Hz; NaN where there is none, or none that can be claimed.
        low: Lower end of the 95 % interval, Hz; NaN likewise.
        high: Upper end, Hz; NaN likewise.
        refused: Whether the model has one that the record does not bear.
        warnings: What speaks against it, in words.
    """

    hz: float
    low: float
    high: float
    refused: bool
    warnings: tuple[str, ...]


def claim(found: Estimate, record: IOData, *, output: int = 0, input: int = 0, band: Bandwidth | None = None) -> Claim:
    """Weigh the bandwidth of a model, from one input to one output, against its record.

    Args:
        found: The estimate.
        record: What it was estimated from, as it was used.
        output: Which output.
        input: Which input.
        band: Its bandwidths where they are known already.

    Returns:
        The bandwidth, or NaN with the reason.
    """
    band = found.bandwidth() if band is None else band
    hz, low, high = (float(part[output, input]) for part in (band.hz, *band.ci95))
    lowest = lowest_excited(record, input=input)
    poles = found.poles()
    against: list[str] = []
    if len(poles) and np.abs(poles - 1.0).min() < INTEGRATES:
        against.append("the model has a pole at one: it integrates, so it has no gain at 0 Hz and no bandwidth")
    elif np.isfinite(hz):
        if np.isfinite(low) and not high <= WIDEST * low:
            against.append(
                f"the bandwidth cannot be told: its 95 % interval, {low:.2g} to {high:.2g} Hz, spans more than a "
                f"factor of {WIDEST:g}"
            )
        shortest = 1.0 / (len(record.scored) * record.dt)
        if hz < shortest:
            against.append(
                f"the bandwidth cannot be told: the model claims {hz:.2g} Hz, and the record of "
                f"{len(record.scored) * record.dt:.3g} s holds no whole period of anything below {shortest:.2g} Hz"
            )
        if lowest > hz:
            against.append(
                f"the bandwidth cannot be told: the model claims {hz:.2g} Hz, and the input excites nothing below "
                f"{lowest:.2g} Hz"
            )
    remarks = list(against)
    if lowest > 0:
        remarks.append(
            f"nothing below {lowest:.2g} Hz is excited; the gain at 0 Hz, and with it the bandwidth, is extrapolated"
        )
    if len(poles) and np.abs(poles).max() > 1.0 + INTEGRATES:
        remarks.append(f"the model is unstable: a pole has modulus {np.abs(poles).max():.4g}")
    if against:
        hz = low = high = float("nan")
    return Claim(hz, low, high, bool(against), tuple(remarks))


def lowest_excited(record: IOData, *, input: int = 0) -> float:
    """Lowest frequency at which the input has power to speak of, Hz.

    That is the first line of the windowed record that stands out, by itself or as part of a broad floor. From it one
    climbs to the top of its peak, since the window spreads every line over its neighbours.

    Args:
        record: The record; 0 Hz counts if its mean was left in.
        input: Which input.

    Returns:
        The frequency; 0 if the input reaches down to 0 Hz as far as the length of the record tells.
    """
    u = record.scored.u[:, input]
    n = len(u)
    window = 0.5 - 0.5 * np.cos(2.0 * np.pi * np.arange(n) / n)
    # A record cut in the middle of a period has a mean under the window even after its own was removed.
    u = u - (window @ u / window.sum() - u.mean())
    power = np.abs(np.fft.rfft(window * u)) ** 2
    level = LINE * power.max()
    middle = float(np.median(power))
    if middle * len(power) >= FLOOR * power.sum():
        level = min(level, SCATTER * middle)
    line = int(np.argmax(power >= level))
    if line < RESOLVED:
        return 0.0
    while line + 1 < len(power) and power[line + 1] > power[line]:
        line += 1
    return line / (n * record.dt)
