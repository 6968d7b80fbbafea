"""Eigensystem realisation from correlations of Markov parameters."""

import numpy as np
from numpy.typing import ArrayLike

from sysid.records.arguments import whole_number
from sysid.subspace.era import Realisation, block_hankel, checked_order, hankel_shape, markov_array, realisation


def era_dc(
    markov: ArrayLike,
    order: int,
    *,
    dt: float = 1.0,
    block_rows: int | None = None,
    block_columns: int | None = None,
    lags: int = 2,
) -> Realisation:
    """Realise from R_k = H(k) H(0)', k = 0, 1, ..., in which noise averages out [JuangCooperWright1988].

    The correlations form a block Hankel matrix U(0), lags x lags; U(0) = P S Q', A = S^-1/2 P' U(1) Q S^-1/2, C is the
    first block of P S^1/2, and B follows from H(0) through the observability matrix. With one lag it is ERA
    in other words.

    Args:
        markov: Y_0 = D, Y_1 = CB, Y_2 = CAB, ... (K, ny, nu); (K,) for one input and one output.
        order: Number of states.
        dt: Sampling interval in s.
        block_rows: Block rows of H; by default half of what the parameters and lags allow.
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
    correlations = np.array([block_hankel(y[1 + k :], rows, columns) @ h0.T for k in range(2 * lags)])
    left, values, right = np.linalg.svd(block_hankel(correlations, lags, lags), full_matrices=False)
    n = checked_order(order, np.sqrt(values))
    root = np.sqrt(values[:n])
    A = (left[:, :n] / root).T @ block_hankel(correlations[1:], lags, lags) @ (right[:n].T / root)
    observability = left[: rows * ny, :n] * root
    C = observability[:ny]
    B = np.linalg.lstsq(observability, h0, rcond=None)[0][:, :nu]
    return realisation(A, B, C, y[0], dt, np.linalg.svd(h0, compute_uv=False), n)
