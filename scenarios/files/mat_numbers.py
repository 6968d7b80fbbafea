"""Matrices of .mat files that come from strangers."""

import zlib
from collections.abc import Sequence
from math import prod
from pathlib import Path

import numpy as np

from scenarios.files.errors import ScenarioError

MOST_NUMBERS = 2**27
"""No matrix has more numbers: a small file can claim to unpack to any size."""


def read_mat_numbers(path: Path, names: Sequence[str]) -> dict[str, np.ndarray]:
    """Read those of some matrices that are in a file; of what else is in it nothing.

    Args:
        path: The file, version 7 or older.
        names: Of the matrices.

    Raises:
        ScenarioError: It is no such file, or damaged, or has matrices of an absurd size.
    """
    from scipy.io import loadmat, whosmat
    from scipy.io.matlab import MatReadError

    try:
        for name, shape, _ in whosmat(path):
            if name in names and prod(shape) > MOST_NUMBERS:
                raise ScenarioError(f"{path}: {name} of shape {shape} given, expected at most {MOST_NUMBERS} numbers")
        found = loadmat(path, variable_names=list(names))
    except ScenarioError:
        raise
    # What the reader raises on bytes that are no such file follows no rule.
    except (OSError, ArithmeticError, LookupError, MemoryError, MatReadError, NotImplementedError, TypeError) as error:
        raise ScenarioError(f"cannot read {path}: {error}; expected a file of save(..., '-v7')") from error
    except (ValueError, AttributeError, zlib.error) as error:
        raise ScenarioError(f"cannot read {path}: {error}; expected a file of save(..., '-v7')") from error
    return {name: np.asarray(found[name]) for name in names if name in found}
