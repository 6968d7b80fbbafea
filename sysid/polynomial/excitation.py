"""How much an input excites, and what that forbids."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from sysid.polynomial.hankel_moments import hankel_moments
from sysid.records.arguments import real_number, whole_number
from sysid.records.arrays import FloatArray, real_array
from sysid.records.data import ROUNDING, IOData
from sysid.records.errors import SysidError


def order_of_excitation(u: ArrayLike, *, max_order: int = 50, tolerance: float = 1e-6) -> int:
    """Order of persistent excitation: the largest n with a nonsingular n x n covariance matrix [Ljung1999, def. 13.1].

    A sinusoid has order 2, a constant 1, a sum of m sinusoids 2m; white noise has no limit.

    Args:
        u: One input (N,) or (N, 1).
        max_order: Where to stop looking; a return value of `max_order` means "at least".
        tolerance: Singular values of the matrix of lagged inputs below it, relative to the largest, count as zero.

    Returns:
        The order, 0 for an input that is zero, at most `max_order`.

    Raises:
        SysidError: Several channels, or max_order not between 1 and N/2.
    """
    if isinstance(u, IOData):
        raise SysidError("expected one input as an array (N,), got an IOData record: take data.u[:, 0]")
    signal = real_array("u", u)
    signal = signal[:, 0] if signal.ndim == 2 and signal.shape[1] == 1 else signal
    if signal.ndim != 1:
        raise SysidError(f"order_of_excitation looks at one input at a time, got shape {np.shape(u)}")
    if len(signal) < 2:
        raise SysidError(f"too few samples: {len(signal)} given, at least 2 are needed")
    max_order = whole_number("max_order", max_order, 1, len(signal) // 2)
    tolerance = real_number("tolerance", tolerance, "lie between 0 and 1", lambda part: 0.0 < part < 1.0)
    return _rank([signal], max_order, tolerance)


def _rank(signals: Sequence[FloatArray], order: int, tolerance: float) -> int:
    return _gram_rank(hankel_moments([signal[:, None] for signal in signals], order), tolerance)


def _gram_rank(gram: FloatArray, tolerance: float) -> int:
    # eigenvalues are squares of singular values; rounding of the Gram matrix sets the floor
    values = np.linalg.eigvalsh(gram)
    floor = max(tolerance**2, len(gram) * np.finfo(float).eps)
    return int((values > floor * values[-1]).sum()) if values[-1] > 0.0 else 0


def check_excitation(experiments: Sequence[IOData], needed: Sequence[int]) -> list[str]:
    """Refuse constant inputs; describe inputs that excite less than the model needs, or depend on each other.

    Args:
        experiments: The data set.
        needed: Order of excitation wanted of each input.

    Returns:
        One text per weak input, and one where inputs depend on each other.

    Raises:
        SysidError: An input is constant in every experiment.
    """
    nu, names = experiments[0].nu, experiments[0].input_names or ()
    shortest = min(len(e) for e in experiments)
    for j, name in enumerate(names):
        signals = [e.u[:, j] for e in experiments]
        if all(np.ptp(s) <= ROUNDING * np.abs(s).max() for s in signals):
            value = ", ".join(f"{s[0]:g}" for s in signals)
            raise SysidError(
                f"input {name} is constant ({value}): nothing can be identified from it; expected a varying input"
            )
    # as many rows as columns at least
    lags = min(max((*needed, 1)), shortest // (nu + 1))
    joint = _joint_gram(experiments, lags) if nu > 1 and lags >= 1 else None
    texts, alone = [], 0
    for j, name in enumerate(names):
        own = None if joint is None else joint[j::nu, j::nu]
        order = min(needed[j], shortest // 2)
        if own is not None and order == lags:
            found = _gram_rank(own, 1e-6)
            alone += found
        else:
            found = _rank([e.u[:, j] for e in experiments], order, 1e-6) if order >= 1 else needed[j]
            alone += 0 if own is None else _gram_rank(own, 1e-6)
        if found < needed[j]:
            texts.append(
                f"input {name} is persistently exciting of order {found} only, the model needs {needed[j]}: "
                "some parameters rest on noise"
            )
    together = alone if joint is None else _gram_rank(joint, 1e-6)
    if together < alone:
        what = "the inputs" if lags == 1 else f"{lags} lags of the inputs"
        texts.append(
            f"{what} {', '.join(names)} have rank {together} together and {alone} on their own: they depend on each "
            "other, and the data do not tell their effects apart"
        )
    return texts


def _joint_gram(experiments: Sequence[IOData], lags: int) -> FloatArray:
    """Gram matrix of the lags of all inputs, each of unit size, (lags nu, lags nu), inputs side by side."""
    sizes = np.sqrt(np.mean(np.concatenate([e.u for e in experiments]) ** 2, axis=0))
    return hankel_moments([e.u / sizes for e in experiments], lags)
