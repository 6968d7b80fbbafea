"""Prediction-error refinement of state-space models."""

import warnings
from collections.abc import Callable, Iterator, Sequence
from functools import partial

import numpy as np
from numpy.typing import ArrayLike

from sysid.models.data_summary import DataSummary
from sysid.models.estimate import Estimate
from sysid.models.predict import aligned, as_model
from sysid.models.state_space import StateSpace
from sysid.polynomial.armax import armax
from sysid.polynomial.data_checks import check_excitation, check_means
from sysid.polynomial.oe import oe
from sysid.records.arguments import truth_value, whole_number
from sysid.records.arrays import FloatArray
from sysid.records.data import IOData, as_experiments
from sysid.records.errors import SysidError, SysidWarning, warn_each
from sysid.subspace.n4sid import n4sid
from sysid.subspace.observer_gain import spectral_radius, stable_gain
from sysid.subspace.okid import okid
from sysid.subspace.predictor import Predictor, Record, Scales, local_coordinates
from sysid.subspace.predictor_errors import Point, gapped_covariance
from sysid.subspace.predictor_estimate import (
    check_enough_samples,
    check_gain,
    degrees_of_freedom,
    make_predictor_estimate,
    scaled_output_weight,
)
from sysid.subspace.predictor_fit import Minimum, column_scale, gradient_covariance, minimise

HORIZONS = (8, 12, 16, 20)  # block rows of n4sid, beside the fewest that allow the order
OBSERVERS = (5, 10)  # observer Markov parameters of okid


def initial_estimates(experiments: Sequence[IOData], order: int) -> Iterator[tuple[str, StateSpace]]:
    """Names and models of initial estimates: n4sid with several horizons, and okid, as far as the data allow."""
    ny = experiments[0].ny
    for rows in sorted({order // ny + 2, *HORIZONS}):
        yield from _attempt(
            f"n4sid ({rows} block rows)",
            order,
            partial(n4sid, experiments, order, block_rows=rows, stable=True),
        )
    for past in OBSERVERS:
        if past * ny >= order:
            yield from _attempt(f"okid (p = {past})", order, partial(okid, experiments, order, p=past))


def _attempt(name: str, order: int, make: Callable[[], Estimate]) -> Iterator[tuple[str, StateSpace]]:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", SysidWarning)
        try:
            model = make().model
        except (SysidError, np.linalg.LinAlgError):
            return
    if model.order == order:
        yield name, model


ILL_CONDITIONED = 1e12  # condition of the information matrix: the square of that of the Jacobian
CROSSING_STEPS = 20  # steps with the opposite choice of `gain`, whose minimum is a further initial estimate
SCREENING_STEPS, REFINED = 10, 2  # steps from every initial estimate, and how many of them are refined further
SHORT = 50.0  # output values per parameter below which the criterion often has several minima
POLYNOMIALS = 200.0  # the same, below which the fit of one output as polynomials, which is quick, is tried
SLOW = 50  # steps; more suggest a difficult criterion, with several minima too
COLOUR = 30  # order of the autoregressive models of a coloured disturbance


def pem_ss(
    data: IOData | Sequence[IOData],
    start: int | Estimate | StateSpace | Sequence[Estimate | StateSpace],
    *,
    direct: bool = True,
    gain: bool = True,
    coloured: bool = False,
    output_weight: ArrayLike | None = None,
    search: bool = True,
    max_iterations: int = 100,
) -> Estimate:
    """Minimise log det of the covariance of the one-step prediction errors [Ljung1999, ch. 7; McKelvey2004].

    This is maximum likelihood. With `output_weight` W the sum of e' W e is minimised instead, for models that are to
    predict or simulate some outputs better than others; I gives the sum of squares of all outputs.

    The order is that of `start`. Steps are orthogonal to the directions that only change the basis of the state, so
    that no canonical form is needed. The predictor A - K C stays stable at every accepted step; the initial state of
    every experiment is estimated.

    With `gain=True`, the default, plant and disturbance share one state, and the estimate is efficient if
    the order is that of both together: three outputs with a disturbance of first order each need three states more.
    With the order of the plant alone, K biases the plant; use more states, or `gain=False`. `resid` is the check: the
    residuals must be white with K, and independent of the input without.

    Real data of a higher order than the model often have several minima. Pass several starts, for example `n4sid` with
    different `block_rows`: each is refined, and the best is returned.

    With `gain=False` the simulation error is minimised (an output-error model, K = 0). It is consistent for a
    disturbance of any colour that is independent of the input; the covariance holds for a white one, unless `coloured`
    is set.

    Args:
        data: One experiment, or several that share the model; any numbers of inputs (none: a time series) and outputs.
            With missing outputs, the likelihood of the known ones is maximised; `n4sid` or `armax` give a start.
        start: Initial estimate by `n4sid`, `okid` or any other method, or a model; or several of one order. A number is
            the order of an `n4sid` to start from.
        direct: Whether D is estimated; otherwise it is zero. Beside feedback without delay, D would be that of the
            controller: pass False.
        gain: Whether K is estimated; otherwise it is zero.
        coloured: With `gain=False`, whether the covariance allows for a disturbance that is not white, by an
            autoregressive model of each output's [Ljung1999, ch. 9]. The estimate itself is the same.
        output_weight: W, symmetric without negative eigenvalues (ny, ny), in the sequence of the data's outputs, per
            their units squared. Its size does not matter; an output of no weight counts with 1e-6 of the largest. The
            covariance allows for errors of any covariance [Ljung1999, ch. 9]. Not with missing outputs.
        search: Whether to try further initial estimates (`n4sid` with several horizons, `okid`, with and without K)
            after a single start if several minima are likely: fewer than 50 output values per parameter, or a fit that
            converges slowly or not at all. Such a fit takes about ten times as long. With one output also `armax` (`oe`
            without K), from fewer than 200 values per parameter on. Not with missing outputs.
        max_iterations: Limit on the accepted steps.

    Returns:
        The estimate. `parameters` are local coordinates: K, then A, B and C along directions orthogonal to changes of
        the basis of the state, then D; their covariance gives that of bandwidth and responses.
        Diagnostics: `criteria`, the minimum from each start, NaN for an unusable one.

    Raises:
        SysidError: Constant input, channels that do not fit, no state, starts of different orders, too little data, a
            weight that is none, no start with a stable predictor (with `gain=False`: no stable start).

    Warns:
        SysidWarning: Poor excitation, means that do not fit the dynamics, no convergence, bad conditioning, a predictor
            at the edge of stability.
    """
    max_iterations = whole_number("max_iterations", max_iterations, 1)
    flags = {"direct": direct, "gain": gain, "coloured": coloured, "search": search}
    direct, gain, coloured, search = (truth_value(name, value) for name, value in flags.items())
    experiments = as_experiments(data, missing=not coloured and output_weight is None, series=True)
    if isinstance(start, int | np.integer):
        start = n4sid(experiments, start, direct=direct, gain=gain)
    origins = list(start) if isinstance(start, Sequence) else [start]
    models = [aligned(as_model(origin), experiments[0]) for origin in origins]
    if coloured and gain:
        raise SysidError("coloured=True needs gain=False: with gain=True the model itself describes the colour")
    if len({model.order for model in models}) != 1:
        raise SysidError(f"expected one start, or several of one order; got orders {[m.order for m in models]}")
    model = models[0]
    if model.order == 0:
        raise SysidError(
            "expected a start with at least one state, got order 0: a direct term alone is arx(data, 0, 1, 0)"
        )
    nu, ny, n = model.nu, model.ny, model.order
    check_gain(nu, gain)
    count = n * (nu + (2 if gain else 1) * ny) + (nu * ny if direct else 0)
    samples = check_enough_samples(experiments, n, count)
    messages = check_excitation(experiments, [n + (1 if direct else 0)] * nu) + check_means(experiments, -(-n // ny))
    scales = Scales.of(experiments)
    weight = scaled_output_weight(output_weight, scales)
    records = [Record.of(e, scales, gain, weight) for e in experiments]
    minima: dict[int, Minimum] = {}
    refused: list[SysidError] = []
    for k, one in enumerate(models):
        try:
            starts = _starts(one, scales, direct, gain)
        except SysidError as error:
            refused.append(error)
            continue
        minima[k] = _refined(records, starts, direct, max_iterations)
    if not minima:
        raise refused[0]
    chosen = min(minima, key=lambda k: minima[k].point.criterion)
    minimum, origin = minima[chosen], origins[chosen]
    name = origin.method if isinstance(origin, Estimate) else "model"
    slow = not minimum.converged or minimum.iterations > SLOW
    thorough = slow or samples * ny < SHORT * count
    doubtful = thorough or (ny == 1 and samples < POLYNOMIALS * count)
    if search and len(origins) == 1 and doubtful and not minimum.exact and all(e.complete for e in experiments):
        first = (name, models[0], minimum)
        minimum, name = _searched(experiments, records, scales, first, direct, gain, thorough, max_iterations)
    covariance, condition = _covariance(minimum.normal.information)
    innovation = None
    if minimum.point.gaps:
        innovation = minimum.point.covariance
        if gain and not minimum.exact:
            at, information = minimum.point, minimum.normal.information
            covariance = gapped_covariance(records, at.predictor, at.weight, information, minimum.normal.basis)
    if (coloured or weight is not None) and not minimum.exact:
        colour = min(COLOUR, samples // 20) if coloured else 0
        middle = gradient_covariance(records, minimum.point, minimum.normal.basis, colour)
        covariance = covariance @ middle @ covariance
    covariance = covariance * samples / degrees_of_freedom(experiments, minimum.point.predictor, count)
    radius = float(np.abs(np.linalg.eigvals(minimum.point.predictor.A)).max())
    if not minimum.converged:
        messages.append(f"pem_ss did not converge: {minimum.reason}")
    if condition > ILL_CONDITIONED and not minimum.exact:
        messages.append(
            f"the parameters are poorly determined: condition number {condition:.2g} of the information matrix"
        )
    if radius > 1.0 - 1e-4:
        what = "predictor" if gain else "model"
        messages.append(
            f"the {what} has a pole of modulus {radius:.7f}, at the edge of stability: intervals may be wrong"
        )
    warn_each(messages)
    return make_predictor_estimate(
        "pem_ss",
        experiments,
        {"order": n},
        scales,
        predictor=minimum.point.predictor,
        basis=minimum.normal.basis,
        covariance=covariance,
        diagnostics={
            "condition": condition,
            "iterations": minimum.iterations,
            "evaluations": minimum.evaluations,
            "converged": minimum.converged,
            "reason": minimum.reason,
            "start": name,
            "criteria": tuple(minima[k].point.criterion if k in minima else np.nan for k in range(len(origins))),
        },
        messages=messages,
        innovation=innovation,
    )


def _polynomial_estimates(
    experiments: Sequence[IOData], order: int, direct: bool, gain: bool
) -> Iterator[tuple[str, StateSpace]]:
    """The fit of the same model of one output as polynomials, which may end in another minimum."""
    count, delay = (order + 1, 0) if direct else (order, 1)
    if gain:
        yield from _attempt("armax", order, partial(armax, experiments, order, count, order, delay))
    elif experiments[0].nu == 1:
        yield from _attempt("oe", order, partial(oe, experiments, count, order, delay, coloured=False))


def _searched(
    experiments: Sequence[IOData],
    records: Sequence[Record],
    scales: Scales,
    first: tuple[str, StateSpace, Minimum],
    direct: bool,
    gain: bool,
    thorough: bool,
    max_iterations: int,
) -> tuple[Minimum, str]:
    """The lowest of several minima, and the name of its initial estimate; of one output from polynomials at least."""
    name, start, best = first
    summary = DataSummary.of(experiments)
    directions = partial(local_coordinates, direct=direct)
    screened: list[tuple[str, Minimum]] = []
    candidates = list(initial_estimates(experiments, start.order)) if thorough else []
    if start.ny == 1:
        candidates += _polynomial_estimates(experiments, start.order, direct, gain)
    # the minimum of the criterion with the opposite `gain` helps to escape from local minima
    other = [Record.of(e, scales, not gain, records[0].output_weight) for e in experiments]
    try:
        crossed = minimise(other, _starts(start, scales, direct, not gain)[0], directions, CROSSING_STEPS)
        candidates.append(
            (f"{name}, refined {'without' if gain else 'with'} K", scales.model(crossed.point.predictor, summary, None))
        )
    except SysidError:
        pass
    for label, model in candidates:
        try:
            starts = _starts(model, scales, direct, gain)
        except SysidError:
            continue
        screened += [(label, minimise(records, begin, directions, SCREENING_STEPS)) for begin in starts]
    screened.sort(key=lambda pair: pair[1].point.criterion)
    for label, few in screened[:REFINED]:
        minimum = few if few.converged else minimise(records, few.point.predictor, directions, max_iterations)
        if minimum.point.criterion < best.point.criterion:
            best, name = minimum, label
    return best, name


def _refined(records: Sequence[Record], starts: Sequence[Predictor], direct: bool, max_iterations: int) -> Minimum:
    """The minimum from the best of some predictors."""
    begin = starts[0]
    if len(starts) > 1:
        begin = min(starts, key=lambda p: Point.at(records, p.balanced(), np.eye(p.C.shape[0])).criterion)
    return minimise(records, begin, partial(local_coordinates, direct=direct), max_iterations)


def _starts(model: StateSpace, scales: Scales, direct: bool, gain: bool) -> list[Predictor]:
    """Stable initial predictors: with the gain of the start, made stable if necessary, and without gain.

    The gain of a poor model may be worse than none.
    """
    A, C = model.A, model.C
    D = model.D if direct else np.zeros_like(model.D)
    gains = [np.zeros_like(model.gain)]
    if gain:
        known = model.innovation_covariance
        gains.insert(0, stable_gain(A, C, model.gain, np.eye(model.ny) if known is None else known))
    predictors = [scales.predictor(StateSpace(A, model.B, C, D, K, model.dt), gain) for K in gains]
    out = [p for p in predictors if p.is_stable()]
    if out:
        return out
    radius, observer = spectral_radius(A), spectral_radius(A - gains[0] @ C)
    if gain:
        raise SysidError(
            f"the start needs a stable predictor: A - K C has spectral radius {observer:.6g}, and A itself {radius:.6g}"
        )
    raise SysidError(
        f"with gain=False the start must be stable, given one with largest pole modulus {radius:.6g}; "
        "n4sid(data, order, stable=True) gives a stable one"
    )


def _covariance(information: FloatArray) -> tuple[FloatArray, float]:
    """Inverse of the information (q, q), and its condition number after scaling to unit diagonal."""
    scale = column_scale(information)
    values, vectors = np.linalg.eigh(information / np.outer(scale, scale))
    kept = values > 1e-14 * values[-1]
    if not kept.any():
        return np.full_like(information, np.nan), np.inf
    half = vectors[:, kept] / np.sqrt(values[kept]) / scale[:, None]
    return half @ half.T, float(values[-1] / values[0]) if values[0] > 0.0 else np.inf
