"""Subspace identification."""

import warnings
from collections.abc import Sequence

import numpy as np

from sysid.models.estimate import Estimate
from sysid.polynomial.excitation import check_excitation
from sysid.polynomial.operating_point import check_means
from sysid.records.arguments import truth_value, whole_number
from sysid.records.arrays import FloatArray
from sysid.records.data import IOData, as_experiments
from sysid.records.errors import SysidError, SysidWarning
from sysid.subspace.canonical_variates import subspace
from sysid.subspace.local_coordinates import InputCoordinates, LocalCoordinates
from sysid.subspace.predictor import Predictor, Scales
from sysid.subspace.predictor_estimate import check_enough_samples, make_predictor_estimate
from sysid.subspace.predictor_fit import least_squares_fit
from sysid.subspace.predictor_record import Record

LARGEST_ORDER = 60  # n^2 local coordinates have to be found, at a cost that grows as n^6: some ten seconds


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
        order: Number of states, 60 at most.
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
        SysidWarning: Poor excitation, means that do not fit the dynamics, an order beyond the rank of the data, an
            unstable model.
    """
    experiments = as_experiments(data)
    nu, ny = experiments[0].nu, experiments[0].ny
    order = whole_number("order", order, 1, LARGEST_ORDER)
    direct, gain, stable = (
        truth_value(name, value) for name, value in (("direct", direct), ("gain", gain), ("stable", stable))
    )
    samples = check_enough_samples(experiments, order, order * (nu + 2 * ny) + nu * ny)
    shortest = min(len(e) - e.window for e in experiments)
    # rows of the triangle: 2 s nu inputs and 2 s ny outputs need as many columns
    most = min((samples + len(experiments)) // (2 * (nu + ny) + 2 * len(experiments)), shortest // 2)
    # the observability matrix is shifted by a block row
    least = max(-(-order // ny) + 1, 2)
    if least > most:
        raise SysidError(
            f"too few samples for order {order}: {samples} in {len(experiments)} experiment(s) allow {most} block "
            f"row(s), {ny} output(s) need {least}"
        )
    wanted = min(max(10, -(-5 * order // 2)), most) if block_rows is None else block_rows
    s = whole_number("block_rows", wanted, least, most)
    texts = check_excitation(experiments, [2 * int(s)] * nu) + check_means(experiments, -(-order // ny))
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
            texts[-1] = (
                f"neither a stable model (largest pole modulus {np.abs(np.linalg.eigvals(found.A)).max():.6g}) nor a "
                "stable predictor was found: A has been made stable, at the expense of fit; try another order or "
                "block_rows"
            )
            found, observer = subspace([r.w for r in records], nu, int(order), int(s), stable=True), False
            start = Predictor(found.A, found.B, found.C, found.D if direct else np.zeros((ny, nu)))
            if not start.is_stable():
                raise SysidError("found neither a stable model nor a stable predictor; try another order or block_rows")
    if not observer:
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
