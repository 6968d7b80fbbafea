"""Check that another process computes the same bits: the same software, and arithmetic that rounds alike."""

import platform
from collections.abc import Mapping
from functools import cache

import numpy as np
from scipy.linalg import solve_discrete_lyapunov

from hmtb_twin.files.hashes import array_hash
from scenarios.files.provenance import fingerprint, versions
from scenarios.jobs.journal import differences

ROUNDING = "rounding"
"""Key of the hash of numbers whose last bits follow the processor."""


@cache
def bit_fingerprint() -> Mapping[str, str]:
    """Causes of different bits at equal settings, by name: versions, our source, rounding.

    Numerical libraries choose their instructions by processor, and sums then round differently. Elementary functions,
    products, factorisations and transforms of fixed numbers are hashed to find out.
    """
    return {**versions(), "source": fingerprint(), ROUNDING: _rounding()}


def bit_differences(expected: Mapping[str, str]) -> list[str]:
    """Describe why this process would compute other bits than the one that submits its work; empty if it would not.

    Args:
        expected: Fingerprint of the process that submits, which is "here" in the texts; see `bit_fingerprint`.
    """
    there, here = dict(bit_fingerprint()), dict(expected)
    rounds_alike = there.pop(ROUNDING) == here.pop(ROUNDING, "")
    return [
        *differences(here, there, ("here", "there")),
        *([] if rounds_alike else ["its processor rounds differently"]),
    ]


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
