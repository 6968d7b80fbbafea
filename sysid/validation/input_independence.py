"""Independence of several inputs: whether a record can separate their effects on an output.

Inputs that are nearly multiples of each other, as where one signal drives several actuators, leave their effects mixed.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import ArrayLike

from sysid.polynomial.data_checks import order_of_excitation
from sysid.records.arguments import whole_number
from sysid.records.arrays import FloatArray, real_array
from sysid.records.channels import default_names
from sysid.records.errors import SysidError
from sysid.records.singular_values import svd

LIMIT = 30.0
"""Condition index from which regressors count as too dependent [Belsley1980, sec. 3.2].

Responses to the weakest combination of inputs then have 30 / sqrt(3) = 17 times the standard deviation that independent
inputs of the same size would leave: the record would have to be 300 times as long.
"""

NUMERICAL_RANK = 1e-6  # singular values below it, relative to the largest, count as zero


@dataclass(frozen=True)
class InputIndependence:
    """Measures of how independently several inputs move.

    Attributes:
        names: The inputs.
        lags: Number of compared samples of each input, the present one included.
        condition: Condition index between the inputs: ratio of the extreme singular values of the lagged inputs, those
            of each input made orthonormal first, so that the spectrum of a single input does not count; 1 is best.
        covariance_condition: Condition number of the block-Toeplitz covariance matrix of the inputs, each of unit
            variance, the spectrum of each included.
        orders: Order of persistent excitation of each input, at most `lags`.
    """

    names: tuple[str, ...]
    lags: int
    condition: float
    covariance_condition: float
    orders: tuple[int, ...]

    @property
    def full(self) -> bool:
        """Whether a model of every response to every input can be identified."""
        return self.block_diagonal and self.condition <= LIMIT

    @property
    def block_diagonal(self) -> bool:
        """Whether a model of each response to one input alone can be identified."""
        return min(self.orders) >= self.lags


def input_independence(u: ArrayLike, names: Sequence[str] = (), *, lags: int = 8) -> InputIndependence | None:
    """Measure how independently several inputs move.

    Args:
        u: Inputs (N, nu).
        names: Names of the inputs; `u1, u2, ...` by default.
        lags: Compared samples of each input: as many as a model has past samples.

    Returns:
        The measures; None for a single input, for one that is constant, and for fewer than `2 lags nu` rows of lags.

    Raises:
        SysidError: Inputs that are no matrix, another number of names, or no lag.
    """
    signals, lags = real_array("u", u), whole_number("lags", lags, 1)
    if signals.ndim != 2 or len(names) not in (0, signals.shape[1]):
        raise SysidError(f"expected inputs (N, nu) and a name for each, got shape {signals.shape}, {len(names)} names")
    count = signals.shape[1]
    centred = [signal - signal.mean() for signal in signals.T]
    rows = len(signals) - lags + 1
    # with fewer rows chance alone makes the lagged inputs look dependent
    if count < 2 or rows < 2 * lags * count or not all(signal.any() for signal in centred):
        return None
    # The newest sample first, as in a regressor.
    blocks = [sliding_window_view(signal, lags)[:, ::-1] / signal.std() for signal in centred]
    # Orthonormal bases remove the spectrum of each signal: their joint condition measures the dependence alone.
    bases: list[FloatArray] = []
    for block in blocks:
        basis, values, _ = svd(block, full_matrices=False)
        bases.append(basis[:, values > NUMERICAL_RANK * values[0]])
    return InputIndependence(
        names=tuple(names) or default_names("u", count),
        lags=lags,
        condition=float(np.linalg.cond(np.hstack(bases))),
        covariance_condition=float(np.linalg.cond(np.hstack(blocks))) ** 2,
        orders=tuple(order_of_excitation(signal, max_order=lags) for signal in centred),
    )
