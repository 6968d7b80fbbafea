"""Means and trends of channels, and their subtraction."""

import numpy as np

from sysid.records.arrays import FloatArray
from sysid.records.errors import SysidError

ROUNDING = 1e-13  # remainder of a channel, relative to it, that counts as rounding and not as signal


def difference(channels: FloatArray, removed: FloatArray) -> FloatArray:
    """Subtract the trend; a channel that only rounding remains of becomes exactly zero."""
    rest = channels - removed
    size = np.maximum(np.nanmax(np.abs(channels), axis=0), np.abs(removed).max(axis=0))
    rounding = np.nanmax(np.abs(rest), axis=0) <= ROUNDING * size
    rest[:, rounding] = np.where(np.isnan(rest[:, rounding]), np.nan, 0.0)
    return rest


def trend(basis: FloatArray, channels: FloatArray, window: int) -> FloatArray:
    """Polynomial trend (N, channels), fitted to the known samples after the window; basis (N, k)."""
    out = np.empty(channels.shape)
    for j, channel in enumerate(channels.T):
        used = np.isfinite(channel)
        used[:window] = False
        if used.sum() < basis.shape[1]:
            raise SysidError(f"{int(used.sum())} known samples are too few for a trend of order {basis.shape[1] - 1}")
        q, triangle = np.linalg.qr(basis[used])
        out[:, j] = basis @ np.linalg.solve(triangle, q.T @ channel[used])
    return out
