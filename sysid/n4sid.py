"""Subspace identification."""

import warnings
from collections.abc import Sequence

import numpy as np

from sysid.arrays import FloatArray
from sysid.data import IOData, as_experiments
from sysid.errors import SysidError, SysidWarning
from sysid.estimate import Estimate
from sysid.excitation import check_excitation
from sysid.local_coordinates import InputCoordinates, LocalCoordinates
from sysid.predictor import Predictor, Scales
from sysid.predictor_estimate import check_enough_samples, make_predictor_estimate
from sysid.predictor_fit import least_squares_fit
from sysid.predictor_record import Record
from sysid.subspace import subspace


def n4sid(
    data: IOData | Sequence[IOData],
    order: int,
    *,
    block_rows: int | None = None,
    direct: bool = True,
    gain: bool = True,
    stable: bool = False,
) -> Estimate:
    """Find the states of a system as what its past tells of its future [VanOverschee1996; Larimore1990].

    A and C from the shift of the observability matrix, weighted by canonical variates; B, D and the initial states by
    least squares on the simulated output, given A and C; K from the covariance of what the regression of the states
    leaves. There is no search, hence no local minimum; the result is consistent, not efficient: `pem_ss` refines it.

    Args:
        data: One experiment, or several that share the model; any numbers of inputs and outputs.
        order: Number of states.
        block_rows: Samples of past, and of future, that are looked at; by default 2.5 times the order, at least 10, as
            far as the data allow.
        direct: Whether D is estimated; otherwise it is zero.
        gain: Whether K is estimated; otherwise it is zero.
        stable: Whether A is made stable where it is not, at the expense of fit [Maciejowski1995].

    Returns:
        The estimate. `parameters` are local coordinates; their covariance is not known (NaN), so that intervals are NaN
        too. Diagnostics: `canonical_correlations`, `block_rows`.

    Raises:
        SysidError: Constant input, an order that block rows or data do not allow.

    Warns:
        SysidWarning: Poor excitation, an order beyond the rank of the data, an unstable model.
    """
    experiments = as_experiments(data)
    nu, ny = experiments[0].nu, experiments[0].ny
    if isinstance(order, bool) or not isinstance(order, int | np.integer) or order < 1:
        raise SysidError(f"order must be a whole number >= 1, got {order!r}")
    samples = check_enough_samples(experiments, order, order * (nu + 2 * ny) + nu * ny)
    shortest = min(len(e) - e.window for e in experiments)
    # rows of the triangle: 2 s nu inputs and 2 s ny outputs need as many columns
    most = min((samples + len(experiments)) // (2 * (nu + ny) + 2 * len(experiments)), shortest // 2)
    s = min(max(10, -(-5 * order // 2)), most) if block_rows is None else block_rows
    if isinstance(s, bool) or not isinstance(s, int | np.integer) or not order < s * ny or not 2 <= s <= most:
        raise SysidError(
            f"block_rows must be a whole number from {order // ny + 1} (order {order}, {ny} output(s)) to {most} "
            f"(for {samples} samples in {len(experiments)} experiment(s)), got {s!r}"
        )
    texts = check_excitation(experiments, [2 * int(s)] * nu)
    scales = Scales.of(experiments)
    records = [Record.of(e, scales, gain=True) for e in experiments]
    found = subspace([r.w for r in records], nu, int(order), int(s), stable=stable)
    if len(found.A) < order:
        texts.append(
            f"past and future of the data have {len(found.A)} canonical correlations that do not vanish: a model of "
            f"that order instead of {order} is given"
        )
    start = Predictor(found.A, found.B, found.C, found.D if direct else np.zeros((ny, nu)))
    observer = not start.is_stable()
    if observer:
        texts.append(
            f"the model is unstable: largest pole modulus {np.abs(np.linalg.eigvals(found.A)).max():.6g}; "
            "stable=True forbids it"
        )
        A = found.A - found.K @ found.C
        start = Predictor(A, np.hstack((found.B - found.K @ start.D, found.K)), found.C, start.D)
        if not start.is_stable():
            raise SysidError("found neither a stable model nor a stable predictor; try another order or block_rows")
    else:
        records = [Record.of(e, scales, gain=False) for e in experiments]
    fitted = least_squares_fit(records, start, InputCoordinates(direct))
    if observer and not gain:
        B = fitted.M[:, :nu] + found.K @ fitted.D
        predictor = Predictor(found.A, B, found.C, fitted.D)
    elif not observer and gain:
        predictor = _with_gain(fitted, found.K, texts)
    else:
        predictor = fitted
    for text in texts:
        warnings.warn(text, SysidWarning, stacklevel=2)
    basis = LocalCoordinates(direct)(predictor)
    return make_predictor_estimate(
        "n4sid",
        experiments,
        {"order": int(order), "block_rows": int(s)},
        scales,
        predictor=predictor,
        basis=basis,
        covariance=np.full((basis.shape[1],) * 2, np.nan),
        diagnostics={
            "iterations": 0,
            "converged": True,
            "canonical_correlations": found.canonical_correlations,
            "block_rows": int(s),
        },
        texts=texts,
    )


def _with_gain(simulator: Predictor, K: FloatArray, texts: list[str]) -> Predictor:
    """The predictor with innovation gain of a model without; the model as it is where the gain would not be stable."""
    p = simulator
    out = Predictor(p.A - K @ p.C, np.hstack((p.M - K @ p.D, K)), p.C, p.D)
    if out.is_stable():
        return out
    texts.append("no stable innovation gain was found: K = 0 is given")
    return Predictor(p.A, np.hstack((p.M, np.zeros_like(K))), p.C, p.D)
