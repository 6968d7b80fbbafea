"""Simpler models: fewer states, or the delays taken out."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import scipy

from sysid.models.estimate import Estimate
from sysid.models.model_forms import as_model
from sysid.models.state_space import StateSpace
from sysid.models.system_matrices import balanced_truncation
from sysid.records.arguments import truth_value, whole_number
from sysid.records.arrays import FloatArray

MINIMAL = 1e-12  # Hankel singular value, relative to the largest, below which a state is not minimal


def balred(model: StateSpace | Estimate, order: int, *, match_dc: bool = False) -> StateSpace:
    """Reduce the order by balanced truncation of the paths from u and e to y [Moore1981].

    The response from [u, e / sigma] changes by at most twice the sum of the dropped Hankel singular values, at any
    frequency; sigma are the standard deviations of the innovations where they are known, else 1.

    Args:
        model: A stable model, or an estimate of one.
        order: Number of states to keep.
        match_dc: Whether the dropped states are residualised (follow the others at once) instead of truncated, which
            keeps the response at 0 Hz exactly.

    Returns:
        The reduced model, balanced; of even lower order where the model is not minimal.

    Raises:
        SysidError: The model is not stable, or has fewer states than `order`.
    """
    model = as_model(model)
    order, match_dc = whole_number("order", order, 0, model.order), truth_value("match_dc", match_dc)
    sigma = _innovation_deviations(model)
    drive = np.hstack((model.B, model.gain * sigma))
    A, B, C, _ = balanced_truncation(model.A, drive, model.C, MINIMAL)
    D = np.hstack((model.D, np.diag(sigma)))
    kept, dropped = slice(0, order), slice(order, len(A))
    if match_dc and len(A) > order:
        # at 0 Hz the dropped states are x2 = (I - A22)^-1 (A21 x1 + B2 u)
        at_dc = np.linalg.inv(np.eye(len(A) - order) - A[dropped, dropped])
        into, out = at_dc @ A[dropped, kept], at_dc @ B[dropped]
        B = B[kept] + A[kept, dropped] @ out
        D = D + C[:, dropped] @ out
        A, C = A[kept, kept] + A[kept, dropped] @ into, C[:, kept] + C[:, dropped] @ into
    else:
        A, B, C = A[kept, kept], B[kept], C[:, kept]
    nu = model.nu
    K, direct = B[:, nu:] / sigma, D[:, nu:] / sigma
    covariance = model.innovation_covariance
    if match_dc:
        # e enters the output through `direct` now; the innovation is what does so by the identity
        K = K @ np.linalg.inv(direct)
        covariance = None if covariance is None else direct @ covariance @ direct.T
    gain = K if np.any(model.gain) else None
    return replace(model, A=A, B=B[:, :nu], C=C, D=D[:, :nu], K=gain, innovation_covariance=covariance)


def hankel_singular_values(model: StateSpace | Estimate) -> FloatArray:
    """Hankel singular values of the path from [u, e / sigma] to y, as in `balred` [Moore1981].

    Args:
        model: A stable model, or an estimate of one.

    Returns:
        Singular values, largest first (n,).

    Raises:
        SysidError: The model is not stable.
    """
    model = as_model(model)
    B = np.hstack((model.B, model.gain * _innovation_deviations(model)))
    return balanced_truncation(model.A, B, model.C, 0.0)[3]


def _innovation_deviations(model: StateSpace) -> FloatArray:
    """Standard deviation of each innovation (ny,); one where it is not known or zero."""
    covariance = model.innovation_covariance
    if covariance is None:
        return np.ones(model.ny)
    sigma = np.sqrt(np.maximum(np.diag(covariance), 0.0))
    return np.where(sigma > 0.0, sigma, 1.0)


SILENT = 1e-12  # part of a pulse response's largest value below which the response has not begun


def split_delay(model: StateSpace | Estimate) -> tuple[StateSpace, tuple[int, ...]]:
    """Remove the delays from the path from u to y, so that `d2c` can convert the remaining dynamics.

    An input that acts on all outputs only from lag k on is advanced by k - 1 samples; one sample of delay stays, as
    every held input has it.

    Args:
        model: A model or estimate; its noise model has no part in this.

    Returns:
        The model without delays beyond one sample, and the removed delay of each input in samples (nu,).

    Raises:
        SysidError: Neither a model nor an estimate.
    """
    path = as_model(model).input_path()
    pulses = np.abs(path.markov(path.order + 1)).max(axis=1)
    B, D = path.B.copy(), path.D.copy()
    delays = []
    for j in range(path.nu):
        active = np.flatnonzero(pulses[:, j] > SILENT * pulses[:, j].max())
        delay = max(int(active[0]) - 1, 0) if len(active) else 0
        # advanced by `delay` samples, an input acts through A^delay B
        B[:, j] = np.linalg.matrix_power(path.A, delay) @ B[:, j]
        delays.append(delay)
    return replace(path, B=B, D=D).input_path(), tuple(delays)


def add_delay(model: StateSpace, samples: int) -> StateSpace:
    """Delay the inputs of a model by further samples, with a state for each input and sample.

    Args:
        model: A model.
        samples: Samples of further delay.

    Returns:
        The model, its noise model unchanged.
    """
    return delayed_inputs(model, (samples,) * model.nu)


def delayed_inputs(model: StateSpace, delays: Sequence[int]) -> StateSpace:
    """Delay every input of a model by samples of its own, with a state for each of them.

    Args:
        model: A model.
        delays: Samples of further delay of each input (nu,).

    Returns:
        The model, its noise model and the names of its channels unchanged.
    """
    past = sum(delays)
    if not past:
        return model
    n, first = model.order, model.order
    A = scipy.linalg.block_diag(model.A, np.zeros((past, past)))
    B, D = np.vstack((model.B, np.zeros((past, model.nu)))), model.D.copy()
    C = np.hstack((model.C, np.zeros((model.ny, past))))
    for j, delay in enumerate(delays):
        if not delay:
            continue
        # past inputs are states: u(t - 1), ..., u(t - delay), the last of which acts as u(t) did
        last = first + delay - 1
        A[first + 1 : last + 1, first:last] = np.eye(delay - 1)
        A[:n, last], C[:, last] = model.B[:, j], model.D[:, j]
        B[:, j], D[:, j] = 0.0, 0.0
        B[first, j] = 1.0
        first += delay
    K = None if model.K is None else np.vstack((model.K, np.zeros((past, model.ny))))
    return replace(model, A=A, B=B, C=C, D=D, K=K)
