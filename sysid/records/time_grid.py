"""Samples with stamps put on a uniform grid of time: jitter, gaps, channels of several rates."""

import warnings
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from sysid.records.arrays import FloatArray
from sysid.records.channels import listed
from sysid.records.data import IOData
from sysid.records.errors import SysidError, SysidWarning

GAP = 2.5  # intervals between two samples of an output from which a record is cut; shorter losses are interpolated
LOST = 1.5  # intervals between two samples from which one between them was lost
ON_GRID = 0.01  # part of an interval by which steps or stamps may deviate and count as uniform

MOST_IRREGULAR = 0.05
"""Largest share of the steps of an output, gaps apart, outside 0.5 to 1.5 intervals that is resampled."""

EXACT = 1e-9  # spread of steps, relative to them, that rounding of the stamps explains

MOST_SAMPLES, MOST_ADDED = 10**7, 10
"""Samples of any grid, at most, or multiples of the stamps: a single false stamp can claim all memory."""


class Signal(NamedTuple):
    """Channels that were sampled together.

    Attributes:
        times: Increasing stamps (n,), s.
        values: Samples (n, k).
        names: One name per channel.
        units: One unit per channel.
    """

    times: FloatArray
    values: FloatArray
    names: tuple[str, ...]
    units: tuple[str, ...]


def experiments(
    inputs: Sequence[Signal],
    outputs: Sequence[Signal],
    dt: float | None,
    *,
    missing: bool,
    cut: bool,
    name: str,
    resolution: float = 0.0,
    nominal: bool = False,
    remarks: Sequence[str] = (),
) -> tuple[IOData, ...]:
    """Put signals on one uniform grid: one record, or one for each stretch between gaps.

    Where all signals have the same stamps, and steps deviate by at most 1 % or the resolution of the stamps, samples
    are taken as they are. Otherwise the grid begins at a sample of the slowest output; samples within 1 % of an
    interval of its instants are moved there, outputs are interpolated linearly between samples, and inputs, which hold
    until their next sample, have their mean over each interval: it moves an integrator as the held input does. A
    `SysidWarning` says what was done, after the remarks on how the stamps were read.

    The interval dt of the grid, s, is by default that of the slowest output. With `missing`, outputs may be NaN;
    with `cut` the record is cut at gaps, which are refused otherwise: nobody knows the inputs in them. The stem of
    `name`, a file, is that of the records. The resolution of the stamps is in s. A `nominal` interval is that of
    samples whose stamps only jitter, if none was lost.

    Raises:
        SysidError: Outputs without a constant rate, signals without time in common, gaps, channels that no
            `IOData` takes.
    """
    signals = (*inputs, *outputs)
    if short := [signal for signal in signals if len(signal.times) < 2]:
        raise SysidError(f"{name}: {listed(short[0].names)} has {len(short[0].times)} sample(s), expected at least 2")
    periods = [period(signal.times, listed(signal.names), name) for signal in outputs]
    slowest, step = outputs[int(np.argmax(periods))], dt or max(periods)
    first, last = max(signal.times[0] for signal in signals), min(signal.times[-1] for signal in outputs)
    if not last > first:
        spans = (f"{listed(s.names)} from {s.times[0]:.9g} to {s.times[-1]:.9g} s" for s in signals)
        raise SysidError(f"{name}: no time in common: {'; '.join(spans)}; expected stamps of one clock")
    gaps = sorted(
        (float(signal.times[k]), float(signal.times[k + 1]))
        for signal, own in zip(outputs, periods, strict=True)
        for k in np.flatnonzero(np.diff(signal.times) > GAP * own)
        if signal.times[k + 1] > first and signal.times[k] < last
    )
    longest, after = max(((stop - start, start) for start, stop in gaps), default=(0.0, 0.0))
    lost = f"{len(gaps)} gap(s) above {GAP:g} intervals, the longest of {longest:.6g} s after {after:.6g} s"
    if gaps and not cut:
        raise SysidError(f"{name}: not uniform: {lost}; expected none (read_experiments cuts there)")
    same = all(np.array_equal(signal.times, slowest.times) for signal in signals)
    starts, stops = [first, *(stop for _, stop in gaps)], [*(start for start, _ in gaps), last]
    parts, interpolated, uneven, dropped = [], 0, False, 0
    for start, stop in zip(np.maximum.accumulate(starts), stops, strict=True):
        part = slice(*np.searchsorted(slowest.times, [start, np.nextafter(stop, np.inf)]))
        own = slowest.times[part]
        as_is = same and _uniform(own, step, resolution, nominal)
        count = len(own) if as_is or not len(own) else int((stop - own[0]) / step + ON_GRID) + 1
        if count <= max(sum(len(s.names) for s in side) for side in (inputs, outputs)):
            dropped += len(own)
            continue
        if count > max(MOST_SAMPLES, MOST_ADDED * len(own)):
            where = f"the longest step is {np.diff(own).max():.6g} s" if len(own) > 1 else "one sample"
            raise SysidError(
                f"{name}: {count} samples every {step:.6g} s from {len(own)} stamps ({where}); expected at most "
                f"{max(MOST_SAMPLES, MOST_ADDED * len(own))} (a longer interval)"
            )
        if as_is:
            uneven |= bool(np.abs(np.diff(own) - step).max() > ON_GRID * step)
            u, y = ([signal.values[part] for signal in side] for side in (inputs, outputs))
        else:
            grid = own[0] + step * np.arange(count)
            held, sampled = ([_between(signal, start, stop) for signal in side] for side in (inputs, outputs))
            placed = [_interpolated(signal, grid) for signal in sampled]
            u, y = [_held_means(signal, grid) for signal in held], [values for values, _ in placed]
            interpolated += int(np.any([between for _, between in placed], axis=0).sum())
        parts.append(_record(inputs, u, outputs, y, step, float(own[0]), missing, name))
    texts = list(remarks)
    if gaps:
        texts.append(
            f"{lost}: cut there into {len(parts)} experiment(s)"
            + (f", {dropped} sample(s) between gaps left out" if dropped else "")
        )
    if not parts:
        raise SysidError(f"{name}: {'; '.join(texts)}; expected a stretch with more samples than channels")
    if uneven:
        texts.append(f"samples are taken as uniform, every {step:.6g} s, though {_steps_text(slowest.times)}")
    if interpolated or not same:
        clocks = [slowest] if same else {id(signal.times): signal for signal in signals}.values()
        steps = (f"{'' if same else f'{listed(s.names)}: '}{_steps_text(s.times)}" for s in clocks)
        texts.append(f"resampled every {step:.6g} s, as {'; '.join(steps)}")
        texts.append(f"{interpolated} of {sum(map(len, parts))} samples of the outputs are interpolated linearly")
        texts += ["inputs are means of their held values"] if inputs else []
    if texts:
        warnings.warn(f"{name}: {'; '.join(texts)}", SysidWarning, stacklevel=6)
    return tuple(parts)


def _steps_text(times: FloatArray) -> str:
    steps = np.diff(times)
    middle = float(np.median(steps))
    text = f"{len(times)} stamps are {steps.min():.6g} to {steps.max():.6g} s apart (median {middle:.6g} s"
    long = int((steps > LOST * middle).sum())
    return text + (f", {long} above {LOST * middle:.6g} s)" if long else ")")


def _record(
    inputs: Sequence[Signal],
    u: Sequence[FloatArray],
    outputs: Sequence[Signal],
    y: Sequence[FloatArray],
    step: float,
    start: float,
    missing: bool,
    name: str,
) -> IOData:
    labels: dict[str, Any] = {
        f"{kind}_{what}": tuple(text for signal in side for text in getattr(signal, what))
        for kind, side in (("input", inputs), ("output", outputs))
        for what in ("names", "units")
    }
    held = np.hstack(u) if u else np.empty((len(y[0]), 0))
    try:
        return IOData(held, np.hstack(y), step, start=start, missing=missing, name=Path(name).stem, **labels)
    except SysidError as error:
        raise SysidError(f"{name}: {error}") from error


def period(times: FloatArray, what: str, name: str) -> float:
    """Mean step between stamps (n,) without losses, s, or the round interval or rate that jitter hides."""
    steps = np.diff(times)
    middle = float(np.median(steps))
    regular = (steps > 0.5 * middle) & (steps < LOST * middle)
    irregular = int((~regular & (steps <= GAP * middle)).sum())
    if irregular > MOST_IRREGULAR * len(steps):
        raise SysidError(
            f"{name}: {what} is not uniform: steps from {steps.min():.6g} to {steps.max():.6g} s, {irregular} of "
            f"{len(steps)} outside 0.5 to 1.5 times their median {middle:.6g} s; expected at most "
            f"{MOST_IRREGULAR:.0%}, which can be resampled"
        )
    mean = float(steps[regular].mean())
    # Jitter of the first and last stamp of every stretch without losses changes the mean by this much.
    uncertain = EXACT * mean + float(np.ptp(steps[regular])) * (2 + np.count_nonzero(~regular)) / len(steps)
    rounded = (float(f"{mean:.3g}"), 1.0 / float(f"{1.0 / mean:.3g}"))
    nearest = min(rounded, key=lambda value: abs(value - mean))
    return nearest if abs(nearest - mean) <= uncertain else mean


def _uniform(times: FloatArray, step: float, resolution: float, nominal: bool) -> bool:
    """Whether stamps (n,) are uniform, or only their jitter or their resolution makes them uneven."""
    largest = float(np.abs(np.diff(times) - step).max(initial=0.0))
    if largest <= ON_GRID * step or nominal:
        return largest < 0.5 * step
    off = np.ptp(times - step * np.arange(len(times)))
    return resolution <= 0.5 * step and largest <= 1.01 * resolution and bool(off <= 1.5 * resolution)


def _between(signal: Signal, start: float, stop: float) -> Signal:
    """Samples from the last before `start` to the first after `stop`."""
    first, last = np.searchsorted(signal.times, [start, stop])
    part = slice(max(first - 1, 0), last + 2)
    return signal._replace(times=signal.times[part], values=signal.values[part])


def _snapped(times: FloatArray, grid: FloatArray) -> FloatArray:
    """Stamps, those close to an instant of the grid moved there."""
    step = grid[1] - grid[0]
    nearest = np.rint((times - grid[0]) / step)
    inside = (nearest >= 0) & (nearest < len(grid))
    instants = grid[np.where(inside, nearest, 0.0).astype(int)]
    return np.where(inside & (np.abs(times - instants) <= ON_GRID * step), instants, times)


def _interpolated(signal: Signal, grid: FloatArray) -> tuple[FloatArray, NDArray[np.bool_]]:
    """Samples on the grid (N, k), and the mask (N,) of those that are interpolated."""
    times = _snapped(signal.times, grid)
    left = np.clip(np.searchsorted(times, grid, side="right") - 1, 0, len(times) - 2)
    steps = times[left + 1] - times[left]
    weight = ((grid - times[left]) / steps).clip(0.0, 1.0)[:, None]
    low, high = signal.values[left], signal.values[left + 1]
    values = np.where(weight == 0.0, low, np.where(weight == 1.0, high, low + weight * (high - low)))
    return values, (weight[:, 0] > 0.0) & (weight[:, 0] < 1.0)


def _held_means(signal: Signal, grid: FloatArray) -> FloatArray:
    """Means of held inputs over the intervals that begin on the grid (N, k); after the last sample it is held on."""
    edges = np.append(grid, 2.0 * grid[-1] - grid[-2])
    times = _snapped(signal.times, edges)
    # Only its deviation from a first value is integrated, so that a large offset costs no digits.
    offset = signal.values[0]
    end = max(edges[-1], times[-1] + 1.0)
    widths = np.diff(np.append(times, end))[:, None]
    integral = np.vstack((np.zeros_like(offset), np.cumsum((signal.values - offset) * widths, axis=0)))
    nodes = np.append(times, end)
    at_edges = np.column_stack([np.interp(edges, nodes, column) for column in integral.T])
    return offset + np.diff(at_edges, axis=0) / np.diff(edges)[:, None]
