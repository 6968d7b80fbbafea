"""Whether another process makes the same bits as this one: the same software, and arithmetic that rounds alike."""

import platform
from collections.abc import Mapping
from functools import cache

import numpy as np
from scipy.linalg import solve_discrete_lyapunov

from scenarios.files.hashes import array_hash
from scenarios.files.provenance import fingerprint, versions

ARITHMETIC = "arithmetic"
"""Key of the hash of numbers whose last bits follow the processor."""

SOURCE = "source"
"""Key of the hash of our own source."""


@cache
def kinship() -> Mapping[str, str]:
    """What the bits of a data set depend on beside its spec, by name: versions, our source, rounding.

    Numerical libraries choose their instructions by processor, and sums then round differently. Whether they do is
    found by trying: elementary functions, products, factorisations and transforms of fixed numbers are hashed.
    """
    return {**versions(), SOURCE: fingerprint(), ARITHMETIC: _rounding()}


def strangeness(here: Mapping[str, str], there: Mapping[str, str]) -> tuple[str, ...]:
    """In what another process differs, in words; nothing where it makes the same bits.

    Args:
        here: Of this process; see `kinship`.
        there: Of the other.
    """
    found = []
    for name in sorted({*here, *there}):
        ours, theirs = here.get(name, "none"), there.get(name, "none")
        if ours == theirs:
            continue
        if name == ARITHMETIC:
            found.append("its processor rounds differently")
        elif name == SOURCE:
            found.append(f"source of this software {theirs[:12]} there, {ours[:12]} here")
        else:
            found.append(f"{name} {theirs} there, {ours} here")
    return tuple(found)


def _rounding() -> str:
    grid = np.linspace(-3.0, 3.0, 4099)
    matrix = np.cos(np.outer(np.arange(1.0, 61.0), np.linspace(0.1, 1.9, 60)))
    stable = 0.9 * matrix / np.linalg.norm(matrix, 2)
    parts = (
        *(function(grid) for function in (np.sin, np.cos, np.exp, np.tanh, np.arctan)),
        np.log(np.abs(grid) + 1.0),
        np.array([grid.sum(), grid @ np.sin(grid)]),
        matrix @ matrix.T,
        np.linalg.solve(matrix @ matrix.T + np.eye(60), matrix),
        np.linalg.eigvals(matrix),
        solve_discrete_lyapunov(stable, np.eye(60)),
        np.fft.rfft(grid),
    )
    return array_hash(np.concatenate([np.ravel(part).view(float) for part in parts])) + platform.machine()
