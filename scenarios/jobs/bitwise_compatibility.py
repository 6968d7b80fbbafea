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
    worker, submitter = dict(bit_fingerprint()), dict(expected)
    # A hash tells nothing to a reader: the difference of rounding gets words of its own.
    rounds_alike = worker.pop(ROUNDING) == submitter.pop(ROUNDING, "")
    causes = differences(submitter, worker, ("here", "there"))
    if not rounds_alike:
        causes.append("its processor rounds differently")
    return causes


def _rounding() -> str:
    """Hash of fixed numbers after every kind of operation whose last bits depend on the processor."""
    grid = np.linspace(-3.0, 3.0, 4099)
    matrix = np.cos(np.outer(np.arange(1.0, 61.0), np.linspace(0.1, 1.9, 60)))
    # The Lyapunov equation below needs a spectral radius below one.
    stable = 0.9 * matrix / np.linalg.norm(matrix, 2)
    elementary = [function(grid) for function in (np.sin, np.cos, np.exp, np.tanh, np.arctan)]
    elementary.append(np.log(np.abs(grid) + 1.0))
    # Long sums: vector units add in another order.
    sums = np.array([grid.sum(), grid @ np.sin(grid)])
    square = matrix @ matrix.T
    solution = np.linalg.solve(square + np.eye(60), matrix)
    eigenvalues = np.linalg.eigvals(matrix)
    covariance = solve_discrete_lyapunov(stable, np.eye(60))
    spectrum = np.fft.rfft(grid)
    results = (*elementary, sums, square, solution, eigenvalues, covariance, spectrum)
    bits = np.concatenate([np.ravel(result).view(float) for result in results])
    return array_hash(bits) + platform.machine()
