"""Other beginnings for a state-space search: where a record is short, the criterion has several minima."""

import warnings
from collections.abc import Callable, Iterator, Sequence
from functools import partial

import numpy as np

from sysid.models.estimate import Estimate
from sysid.models.state_space import StateSpace
from sysid.records.data import IOData
from sysid.records.errors import SysidError, SysidWarning
from sysid.subspace.n4sid import n4sid
from sysid.subspace.okid import okid

HORIZONS = (8, 12, 16, 20)  # block rows beside the least that allow the order
OBSERVERS = (5, 10)  # samples of past for OKID


def other_starts(experiments: Sequence[IOData], order: int) -> Iterator[tuple[str, StateSpace]]:
    """Models by subspaces of several horizons and by OKID; what the data do not allow is left out.

    Args:
        experiments: The data set, nothing missing.
        order: Number of states.

    Yields:
        What it is, and the model.
    """
    ny = experiments[0].ny
    for rows in sorted({order // ny + 2, *HORIZONS}):
        yield from _tried(
            f"n4sid ({rows} block rows)",
            order,
            partial(n4sid, experiments, order, block_rows=rows, stable=True),
        )
    for past in OBSERVERS:
        if past * ny >= order:
            yield from _tried(f"okid (p = {past})", order, partial(okid, experiments, order, p=past))


def _tried(name: str, order: int, make: Callable[[], Estimate]) -> Iterator[tuple[str, StateSpace]]:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", SysidWarning)
        try:
            model = make().model
        except (SysidError, np.linalg.LinAlgError):
            return
    if model.order == order:
        yield name, model
