"""Eigensystem realisation: state-space models from Markov parameters or from their correlations."""

import textwrap
import warnings
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from sysid.models.state_space import StateSpace
from sysid.records.arguments import whole_number
from sysid.records.arrays import FloatArray, Locked, real_array
from sysid.records.data import IOData
from sysid.records.errors import SysidError, SysidWarning
from sysid.records.printing import Part, numbers
from sysid.records.singular_values import singular_values, svd

NUMERICAL_RANK = 1e-13  # singular value, relative to the largest, that is rounding


@dataclass(frozen=True, eq=False, repr=False)
class Realisation(Locked):
    """A model realised from Markov parameters, and the share of them that it describes.

    Attributes:
        model: The model; K = 0.
        hankel_singular_values: Singular values of H(0), largest first.
        percent_described: 100 sum(xi[:n]) / sum(xi) with xi the singular values of R0 = H(0) H(0)', as SOCIT prints it;
            not a fit of the output.
        percent_described_unsquared: The same ratio of the singular values of H(0) themselves.
        modal_singular_values: sqrt(|b_i| |c_i| / |1 - |lambda_i||) per mode, in the sequence of `model.poles()`.
    """

    model: StateSpace
    hankel_singular_values: FloatArray
    percent_described: float
    percent_described_unsquared: float
    modal_singular_values: FloatArray

    def _parts(self) -> list[Part]:
        values = textwrap.shorten(", ".join(numbers(self.hankel_singular_values)), 90, placeholder=" ...")
        share = f"{self.percent_described:.2f} % of the Markov parameters described"
        return [f"Realisation of order {self.model.order}, {share}", f"singular values: {values}", *self.model._parts()]


def era(
    markov: ArrayLike, order: int, *, dt: float = 1.0, block_rows: int | None = None, block_columns: int | None = None
) -> Realisation:
    """Realise a model by the singular value decomposition of a Hankel matrix [JuangPappa1985].

    H(0) = R S V', A = S^-1/2 R' H(1) V S^-1/2, B = S^1/2 V' E, C = E' R S^1/2.

    Args:
        markov: Y_0 = D, Y_1 = CB, Y_2 = CAB, ... (K, ny, nu); (K,) for one input and one output.
        order: Number of states.
        dt: Sampling interval in s.
        block_rows: Block rows of H; by default half of the largest number.
        block_columns: Block columns of H; by default the rest.

    Returns:
        The model and its singular values.

    Raises:
        SysidError: Too few Markov parameters for the order or the blocks.

    Warns:
        SysidWarning: H(0) has lower numerical rank than `order`, which is then reduced.
    """
    y = markov_array(markov)
    rows, columns = hankel_shape(y, block_rows, block_columns, reserve=0)
    h0, h1 = block_hankel(y[1:], rows, columns), block_hankel(y[2:], rows, columns)
    left, xi, right = svd(h0, full_matrices=False)
    n = checked_order(order, xi)
    root = np.sqrt(xi[:n])
    ny, nu = y.shape[1:]
    # equal shares of the singular values for observability and controllability: internally balanced coordinates
    A = (left[:, :n] / root).T @ h1 @ (right[:n].T / root)
    B = root[:, None] * right[:n, :nu]
    C = left[:ny, :n] * root
    return realisation(A, B, C, y[0], dt, xi, n)


def realisation(
    A: FloatArray, B: FloatArray, C: FloatArray, D: FloatArray, dt: float, xi: NDArray[np.floating], order: int
) -> Realisation:
    """Assemble the result from the matrices and the singular values of H(0)."""
    poles, modes = np.linalg.eig(A)
    # as `StateSpace.poles` lists them
    sequence = np.argsort(-np.abs(poles), kind="stable")
    # least squares, since nearly equal poles have nearly dependent modes
    modal_inputs = np.linalg.lstsq(modes, B.astype(complex), rcond=None)[0]
    b = np.linalg.norm(modal_inputs, axis=1)
    c = np.linalg.norm(C @ modes, axis=0)
    distances = np.maximum(np.abs(1.0 - np.abs(poles)), np.finfo(float).tiny)
    modal = np.sqrt(b * c / distances)
    spectrum = np.asarray(xi, dtype=np.float64)
    squares = spectrum**2
    return Realisation(
        model=StateSpace(A, B, C, D, None, dt),
        hankel_singular_values=spectrum,
        percent_described=_percent(squares, order),
        percent_described_unsquared=_percent(spectrum, order),
        modal_singular_values=modal[sequence],
    )


def markov_array(markov: ArrayLike) -> FloatArray:
    """Check Markov parameters and return them as (K, ny, nu)."""
    y = real_array("markov", markov)
    y = y[:, None, None] if y.ndim == 1 else y
    if y.ndim != 3 or len(y) < 3:
        raise SysidError(f"markov: expected at least 3 parameters, shape (K, ny, nu) or (K,), got {np.shape(markov)}")
    return y


def hankel_shape(y: FloatArray, block_rows: int | None, block_columns: int | None, reserve: int) -> tuple[int, int]:
    """Block rows and columns for which the Markov parameters suffice for H(0) and H(1 + reserve)."""
    # the last index of Y in H(1 + reserve) is rows + columns + reserve
    available = len(y) - 1 - reserve
    if available < 2:
        raise SysidError(
            f"too few Markov parameters: {len(y)} given, with block_rows and block_columns of 1 at least "
            f"{3 + reserve} are needed"
        )
    rows = available // 2 if block_rows is None else whole_number("block_rows", block_rows, 1)
    columns = available - rows if block_columns is None else whole_number("block_columns", block_columns, 1)
    if rows < 1 or columns < 1 or rows + columns > available:
        raise SysidError(
            f"{len(y)} Markov parameters allow block_rows + block_columns <= {available}, each at least 1; "
            f"got {rows} + {columns}"
        )
    return rows, columns


def block_hankel(y: FloatArray, rows: int, columns: int) -> FloatArray:
    """Block (i, j) is y[i + j]; (rows * ny, columns * nu)."""
    _, ny, nu = y.shape
    index = np.arange(rows)[:, None] + np.arange(columns)
    return y[index].transpose(0, 2, 1, 3).reshape(rows * ny, columns * nu)


def checked_order(order: int, xi: FloatArray) -> int:
    """Check the order, and reduce it with a warning to the numerical rank of the Hankel matrix."""
    order = whole_number("order", order, 1, len(xi))
    if xi[0] == 0.0:
        raise SysidError("the Markov parameters after the first are all zero: there are no dynamics to realise")
    rank = max(int((xi > NUMERICAL_RANK * xi[0]).sum()), 1)
    if rank < order:
        warnings.warn(
            f"the Markov parameters have numerical rank {rank}: the model has order {rank} instead of {order}",
            SysidWarning,
            stacklevel=3,
        )
    return min(order, rank)


def _percent(values: FloatArray, order: int) -> float:
    """Share of the first `order` values in the sum of all."""
    total = float(values.sum())
    if total <= 0.0:
        return 100.0
    return float(100.0 * values[:order].sum() / total)


def markov_parameters(data: IOData, count: int) -> FloatArray:
    """Markov parameters by least squares on past inputs alone, D = 0; unbiased in an open loop, whatever the noise.

    Args:
        data: One experiment.
        count: Number of values behind D.

    Returns:
        Y_0 = 0, Y_1, ..., Y_count (count + 1, ny, nu).
    """
    latest_first = np.lib.stride_tricks.sliding_window_view(data.u, count, axis=0)[:-1, :, ::-1]
    columns = latest_first.transpose(0, 2, 1).reshape(len(latest_first), count * data.nu)
    solution = np.linalg.lstsq(columns, data.y[count:], rcond=None)[0]
    pulses = solution.reshape(count, data.nu, data.ny).transpose(0, 2, 1)
    return np.concatenate((np.zeros((1, data.ny, data.nu)), pulses))


def era_dc(
    markov: ArrayLike,
    order: int,
    *,
    dt: float = 1.0,
    block_rows: int | None = None,
    block_columns: int | None = None,
    lags: int = 2,
) -> Realisation:
    """Realise a model from R_k = H(k) H(0)', k = 0, 1, ..., which average noise out [JuangCooperWright1988].

    The correlations form a block Hankel matrix U(0), lags x lags; U(0) = P S Q', A = S^-1/2 P' U(1) Q S^-1/2, C is the
    first block of P S^1/2, and B follows from H(0) through the observability matrix. With one lag it is
    equivalent to ERA.

    Args:
        markov: Y_0 = D, Y_1 = CB, Y_2 = CAB, ... (K, ny, nu); (K,) for one input and one output.
        order: Number of states.
        dt: Sampling interval in s.
        block_rows: Block rows of H; by default half of the largest number.
        block_columns: Block columns of H; by default the rest.
        lags: Block rows and columns of the correlation matrix, >= 1.

    Returns:
        The model and its singular values (those of H(0), as in `era`).

    Raises:
        SysidError: Too few Markov parameters for the order, the blocks or the lags.

    Warns:
        SysidWarning: U(0) has lower numerical rank than `order`, which is then reduced.
    """
    y = markov_array(markov)
    lags = whole_number("lags", lags, 1)
    rows, columns = hankel_shape(y, block_rows, block_columns, reserve=2 * lags - 2)
    ny, nu = y.shape[1:]
    h0 = block_hankel(y[1:], rows, columns)
    shifted_by_lag = [block_hankel(y[1 + k :], rows, columns) for k in range(2 * lags)]
    correlations = np.array([shifted @ h0.T for shifted in shifted_by_lag])
    u0, u1 = block_hankel(correlations, lags, lags), block_hankel(correlations[1:], lags, lags)
    left, values, right = svd(u0, full_matrices=False)
    # correlations are squares: their roots are comparable with the singular values of H(0)
    n = checked_order(order, np.sqrt(values))
    root = np.sqrt(values[:n])
    A = (left[:, :n] / root).T @ u1 @ (right[:n].T / root)
    observability = left[: rows * ny, :n] * root
    C = observability[:ny]
    B = np.linalg.lstsq(observability, h0, rcond=None)[0][:, :nu]
    return realisation(A, B, C, y[0], dt, singular_values(h0), n)
