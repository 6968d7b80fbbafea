"""Signals beside a data set, such as references and instruments."""

from collections.abc import Sequence

from numpy.typing import ArrayLike

from sysid.records.arrays import FloatArray, real_array
from sysid.records.data import IOData
from sysid.records.errors import SysidError


def external_signals(
    name: str, data: IOData | Sequence[IOData], signals: ArrayLike | Sequence[ArrayLike]
) -> list[FloatArray]:
    """Signals beside a data set (N, k): one array for a record, a sequence with one array each for several.

    Raises:
        SysidError: Another number or length of arrays.
    """
    experiments = [data] if isinstance(data, IOData) else list(data)
    several: object = [signals] if isinstance(data, IOData) else signals
    if not isinstance(several, Sequence) or len(several) != len(experiments):
        raise SysidError(f"{name}: expected a sequence of {len(experiments)} arrays, one per experiment")
    arrays = []
    for signal in several:
        array = real_array(name, signal)
        arrays.append(array[:, None] if array.ndim == 1 else array)
    for array, e in zip(arrays, experiments, strict=True):
        if array.ndim != 2 or array.shape != (len(e), arrays[0].shape[1]):
            raise SysidError(f"{name}: expected {len(e)} samples, time first, got shape {array.shape}")
    return arrays
