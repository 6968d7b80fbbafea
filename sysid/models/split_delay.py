"""Whole samples of delay, apart from the dynamics."""

from dataclasses import replace

import numpy as np

from sysid.models.estimate import Estimate
from sysid.models.simulate import as_model
from sysid.models.state_space import StateSpace

SILENT = 1e-12  # a pulse response below this part of its largest value has not begun


def split_delay(model: StateSpace | Estimate) -> tuple[StateSpace, tuple[int, ...]]:
    """Take the delays out of the path from u to y, so that `d2c` finds the dynamics that are left.

    An input that acts on every output only from lag k on is brought forward by k - 1 samples: the one sample that a
    held input takes anyway stays.

    Args:
        model: A model or estimate; its noise model has no part in this.

    Returns:
        The model of the path whose inputs act one sample later at most, and by how many samples each input is really
        later than there (nu,).

    Raises:
        SysidError: Neither a model nor an estimate.
    """
    path = as_model(model).input_path()
    pulses = np.abs(path.markov(path.order + 1)).max(axis=1)
    B, D, delays = path.B.copy(), path.D.copy(), []
    for j in range(path.nu):
        begun = np.flatnonzero(pulses[:, j] > SILENT * pulses[:, j].max())
        delay = max(int(begun[0]) - 1, 0) if len(begun) else 0
        B[:, j] = np.linalg.matrix_power(path.A, delay) @ B[:, j]
        delays.append(delay)
    return replace(path, B=B, D=D).input_path(), tuple(delays)
