"""Hash of the samples of a record, by which a model recognises the data that it was estimated from."""

import hashlib

import numpy as np

from sysid.records.arrays import FloatArray
from sysid.records.data import IOData

LEVELS = 10007.123
"""Steps in which the range of a channel is rounded: coarse enough for rounding of subtracted means to change nothing.

A whole number of them, and steps that begin at a level of the signal, would put samples of binary signals on edges.
"""

EDGE = 0.381966
"""Part of a step by which edges are shifted."""

LOST = -32768
"""Stands for a missing sample."""


def record_hash(record: IOData, samples: int | None = None) -> str:
    """Hash of the first samples of a record, of all if None, that constants on its channels do not change.

    So the record with its means and the one without are the same, as are other units and channels in another sequence.
    """
    inputs = sorted(_channel_hash(channel) for channel in record.u[:samples].T)
    outputs = sorted(_channel_hash(channel) for channel in record.y[:samples].T)
    text = f"{len(record.y[:samples])}:{record.dt:.6g}:{','.join(inputs)}:{','.join(outputs)}"
    return hashlib.sha256(text.encode("ascii")).hexdigest()


def _channel_hash(values: FloatArray) -> str:
    present = np.isfinite(values)
    complete = bool(present.all())
    levels = np.full(len(values), LOST, dtype="<i2")
    if present.any():
        samples = values.copy() if complete else values[present]
        spread = float(np.ptp(samples))
        # of a constant, whatever its value, nothing tells it from another one
        if spread > 0.0:
            samples -= samples.mean()
            samples /= spread
            samples *= LEVELS
            samples += EDGE
            np.floor(samples, out=samples)
            levels[... if complete else present] = samples
    return hashlib.sha256(levels.tobytes()).hexdigest()
