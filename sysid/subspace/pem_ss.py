"""Prediction-error refinement of state-space models."""

import warnings
from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from sysid.models.data_summary import DataSummary
from sysid.models.estimate import Estimate
from sysid.models.model_forms import as_model
from sysid.models.predict import aligned
from sysid.models.state_space import StateSpace
from sysid.polynomial.armax import armax
from sysid.polynomial.data_checks import check_excitation, check_means
from sysid.polynomial.oe import oe
from sysid.records.arguments import truth_value, whole_number
from sysid.records.arrays import FloatArray
from sysid.records.data import IOData, as_experiments
from sysid.records.errors import SysidError, SysidWarning, warn_each
from sysid.subspace.input_delays import Delays, delays_of, input_delays, with_input_delays, without_delays
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
    """Name and model of an initial estimate; nothing if it fails or has another order."""
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
    nk: int | Sequence[int] | None = None,
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
        nk: Known delay of all inputs, or of each, in samples, as in `n4sid`. The order is without the delays: a model
            as start is one of the delayed inputs. None takes the delays of a start that was estimated with `nk`, else
            none.
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
    delays = _input_delays(nk, data, start)
    if delays is not None:
        fit = partial(
            pem_ss,
            start=_undelayed_start(start, delays),
            nk=0,
            direct=direct,
            gain=gain,
            coloured=coloured,
            output_weight=output_weight,
            search=search,
            max_iterations=max_iterations,
        )
        return with_input_delays(fit, as_experiments(data, missing=True, series=True), delays)
    max_iterations = whole_number("max_iterations", max_iterations, 1)
    flags = {"direct": direct, "gain": gain, "coloured": coloured, "search": search}
    direct, gain, coloured, search = (truth_value(name, value) for name, value in flags.items())
    experiments = as_experiments(data, missing=not coloured and output_weight is None, series=True)
    origins = _origins(start, experiments, direct, gain)
    models = [aligned(as_model(origin), experiments[0]) for origin in origins]
    if coloured and gain:
        raise SysidError("coloured=True needs gain=False: with gain=True the model itself describes the colour")
    n = _common_order(models)
    nu, ny = models[0].nu, models[0].ny
    check_gain(nu, gain)
    count = _parameter_count(n, nu, ny, direct, gain)
    samples = check_enough_samples(experiments, n, count)
    excited_lags = n + 1 if direct else n
    messages = check_excitation(experiments, [excited_lags] * nu) + check_means(experiments, -(-n // ny))
    scales = Scales.of(experiments)
    weight = scaled_output_weight(output_weight, scales)
    records = [Record.of(e, scales, gain, weight) for e in experiments]
    minima = _minima(models, records, scales, direct, gain, max_iterations)
    criteria = {k: minimum.point.criterion for k, minimum in minima.items()}
    chosen = min(criteria, key=criteria.__getitem__)
    minimum, name = minima[chosen], _name_of(origins[chosen])
    if search and len(origins) == 1 and not minimum.exact and all(e.complete for e in experiments):
        first = (name, models[0], minimum)
        minimum, name = _lowest_minimum(
            experiments, records, scales, first, direct, gain, samples * ny / count, max_iterations
        )
    colour_order = min(COLOUR, samples // 20) if coloured else None
    covariance, condition = _parameter_covariance(records, minimum, gain, colour_order)
    covariance = covariance * samples / degrees_of_freedom(experiments, minimum.point.predictor, count)
    messages += _doubts(minimum, condition, gain)
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
            **_diagnostics_of_search(minimum),
            "start": name,
            "criteria": tuple(criteria.get(k, np.nan) for k in range(len(origins))),
        },
        messages=messages,
        innovation=minimum.point.covariance if minimum.point.gaps else None,
    )


def _diagnostics_of_search(minimum: Minimum) -> dict[str, Any]:
    """Diagnostics of the search that ended in the minimum."""
    return {
        "iterations": minimum.iterations,
        "evaluations": minimum.evaluations,
        "converged": minimum.converged,
        "reason": minimum.reason,
    }


def _input_delays(
    nk: int | Sequence[int] | None,
    data: IOData | Sequence[IOData],
    start: int | Estimate | StateSpace | Sequence[Estimate | StateSpace],
) -> Delays | None:
    """Delays of the inputs, those asked for or those of the start; None where there are none."""
    experiments = as_experiments(data, missing=True, series=True)
    if nk is not None:
        delays = input_delays(nk, experiments)
        return delays if any(delays) else None
    starts = start if isinstance(start, Sequence) else [start]
    of_starts = {delays_of(origin) for origin in starts}
    if of_starts <= {None}:
        # an empty sequence of starts is refused with the other orders
        return None
    if len(of_starts) > 1:
        raise SysidError("the starts were estimated with different delays nk: expected one nk for all")
    return of_starts.pop()


def _undelayed_start(
    start: int | Estimate | StateSpace | Sequence[Estimate | StateSpace], delays: Delays
) -> int | Estimate | StateSpace | list[Estimate | StateSpace]:
    """The start as a model of the delayed inputs."""
    if isinstance(start, Sequence):
        return [_undelayed_origin(origin, delays) for origin in start]
    if isinstance(start, Estimate | StateSpace):
        return _undelayed_origin(start, delays)
    return start


def _undelayed_origin(origin: Estimate | StateSpace, delays: Delays) -> Estimate | StateSpace:
    """One start as a model of the delayed inputs; refuse an estimate with other delays."""
    delays_of_start = delays_of(origin)
    if not isinstance(origin, Estimate) or delays_of_start is None:
        return origin
    if delays_of_start != delays:
        raise SysidError(f"the start was estimated with nk = {list(delays_of_start)}, expected {list(delays)}")
    return without_delays(origin)


def _origins(
    start: int | Estimate | StateSpace | Sequence[Estimate | StateSpace],
    experiments: Sequence[IOData],
    direct: bool,
    gain: bool,
) -> list[Estimate | StateSpace]:
    """Initial estimates and models as a list; of a number the `n4sid` of this order."""
    if isinstance(start, int | np.integer):
        return [n4sid(experiments, start, direct=direct, gain=gain)]
    return list(start) if isinstance(start, Sequence) else [start]


def _name_of(origin: Estimate | StateSpace) -> str:
    """Method of an initial estimate, for the diagnostics."""
    return origin.method if isinstance(origin, Estimate) else "model"


def _parameter_count(n: int, nu: int, ny: int, direct: bool, gain: bool) -> int:
    """Parameters of a model of n states without the freedom of its basis: n (nu + ny) of the plant, n ny of K, D."""
    count = n * (nu + ny)
    if gain:
        count += n * ny
    if direct:
        count += nu * ny
    return count


def _common_order(models: Sequence[StateSpace]) -> int:
    """Order of the initial models; refuse different orders, and models without a state."""
    orders = [model.order for model in models]
    if len(set(orders)) != 1:
        raise SysidError(f"expected one start, or several of one order; got orders {orders}")
    if orders[0] == 0:
        raise SysidError(
            "expected a start with at least one state, got order 0: a direct term alone is arx(data, 0, 1, 0)"
        )
    return orders[0]


def _minima(
    models: Sequence[StateSpace],
    records: Sequence[Record],
    scales: Scales,
    direct: bool,
    gain: bool,
    max_iterations: int,
) -> dict[int, Minimum]:
    """Minimum from each initial model by its index, without those that give no stable predictor; refuse none at all."""
    minima: dict[int, Minimum] = {}
    refusals: list[SysidError] = []
    for k, model in enumerate(models):
        try:
            starts = _starts(model, scales, direct, gain)
        except SysidError as error:
            refusals.append(error)
            continue
        minima[k] = _refined(records, starts, direct, max_iterations)
    if not minima:
        raise refusals[0]
    return minima


def _parameter_covariance(
    records: Sequence[Record], minimum: Minimum, gain: bool, colour_order: int | None
) -> tuple[FloatArray, float]:
    """Covariance of the parameters, not yet corrected for the degrees of freedom, and condition of the information.

    `colour_order` is that of the autoregressive models of a coloured disturbance; None for a white one.
    """
    point, normal = minimum.point, minimum.normal
    covariance, condition = _covariance(normal.information)
    if minimum.exact:
        # errors at rounding level have no covariance to allow for
        return covariance, condition
    if point.gaps and gain:
        covariance = gapped_covariance(records, point.predictor, point.weight, normal.information, normal.basis)
    if colour_order is not None or point.output_weight is not None:
        # the criterion is not the likelihood: the sandwich of information and covariance of the gradient
        middle = gradient_covariance(records, point, normal.basis, colour_order or 0)
        covariance = covariance @ middle @ covariance
    return covariance, condition


def _doubts(minimum: Minimum, condition: float, gain: bool) -> list[str]:
    """Warnings of no convergence, poorly determined parameters, and poles at the edge of stability."""
    messages: list[str] = []
    if not minimum.converged:
        messages.append(f"pem_ss did not converge: {minimum.reason}")
    if condition > ILL_CONDITIONED and not minimum.exact:
        messages.append(
            f"the parameters are poorly determined: condition number {condition:.2g} of the information matrix"
        )
    radius = float(np.abs(np.linalg.eigvals(minimum.point.predictor.A)).max())
    if radius > 1.0 - 1e-4:
        subject = "predictor" if gain else "model"
        messages.append(
            f"the {subject} has a pole of modulus {radius:.7f}, at the edge of stability: intervals may be wrong"
        )
    return messages


def _polynomial_estimates(
    experiments: Sequence[IOData], order: int, direct: bool, gain: bool
) -> Iterator[tuple[str, StateSpace]]:
    """The fit of the same model of one output as polynomials, which may end in another minimum."""
    count, delay = (order + 1, 0) if direct else (order, 1)
    if gain:
        yield from _attempt("armax", order, partial(armax, experiments, order, count, order, delay))
    elif experiments[0].nu == 1:
        yield from _attempt("oe", order, partial(oe, experiments, count, order, delay, coloured=False))


def _lowest_minimum(
    experiments: Sequence[IOData],
    records: Sequence[Record],
    scales: Scales,
    first: tuple[str, StateSpace, Minimum],
    direct: bool,
    gain: bool,
    density: float,
    max_iterations: int,
) -> tuple[Minimum, str]:
    """Search for a lower minimum if the first is doubtful; return the lowest and the name of its initial estimate.

    Args:
        experiments: The data.
        records: The same, scaled.
        scales: Of the channels.
        first: Name of the initial estimate, its model, and the minimum from there.
        direct: Whether D is estimated.
        gain: Whether K is estimated.
        density: Output values per parameter; few make several minima likely.
        max_iterations: Limit on the accepted steps.
    """
    name, start, best = first
    slow = not best.converged or best.iterations > SLOW
    thorough = slow or density < SHORT
    if not thorough and (start.ny > 1 or density >= POLYNOMIALS):
        return best, name
    summary = DataSummary.of(experiments)
    directions = partial(local_coordinates, direct=direct)
    screened: list[tuple[str, Minimum]] = []
    candidates = list(initial_estimates(experiments, start.order)) if thorough else []
    if start.ny == 1:
        candidates += _polynomial_estimates(experiments, start.order, direct, gain)
    # the minimum of the criterion with the opposite `gain` helps to escape from local minima; without input and gain
    # nothing drives the model, and there is no such criterion
    if start.nu or not gain:
        opposite = [Record.of(e, scales, not gain, records[0].output_weight) for e in experiments]
        # where the opposite choice has no stable start, there is a candidate less
        with suppress(SysidError):
            crossed = minimise(opposite, _starts(start, scales, direct, not gain)[0], directions, CROSSING_STEPS)
            with_or_without = "without" if gain else "with"
            model = scales.model(crossed.point.predictor, summary, None)
            candidates.append((f"{name}, refined {with_or_without} K", model))
    for label, model in candidates:
        try:
            starts = _starts(model, scales, direct, gain)
        except SysidError:
            continue
        screened += [(label, minimise(records, begin, directions, SCREENING_STEPS)) for begin in starts]
    screened.sort(key=lambda pair: pair[1].point.criterion)
    for label, minimum in screened[:REFINED]:
        if not minimum.converged:
            minimum = minimise(records, minimum.point.predictor, directions, max_iterations)
        if minimum.point.criterion < best.point.criterion:
            best, name = minimum, label
    return best, name


def _refined(records: Sequence[Record], starts: Sequence[Predictor], direct: bool, max_iterations: int) -> Minimum:
    """The minimum from that of several initial predictors which has the smallest criterion."""

    def criterion(predictor: Predictor) -> float:
        return Point.at(records, predictor.balanced(), np.eye(len(predictor.C))).criterion

    begin = starts[0] if len(starts) == 1 else min(starts, key=criterion)
    return minimise(records, begin, partial(local_coordinates, direct=direct), max_iterations)


def _starts(model: StateSpace, scales: Scales, direct: bool, gain: bool) -> list[Predictor]:
    """Stable initial predictors: with the gain of the start, made stable if necessary, and without gain.

    The gain of a poor model may be worse than none.
    """
    A, C = model.A, model.C
    D = model.D if direct else np.zeros_like(model.D)
    gains = [np.zeros_like(model.gain)]
    if gain:
        covariance = model.innovation_covariance
        if covariance is None:
            covariance = np.eye(model.ny)
        gains.insert(0, stable_gain(A, C, model.gain, covariance))
    predictors = [scales.predictor(StateSpace(A, model.B, C, D, K, model.dt), gain) for K in gains]
    stable = [predictor for predictor in predictors if predictor.is_stable()]
    if stable:
        return stable
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
    """Pseudo-inverse of the information (q, q), and its condition number after scaling to unit diagonal."""
    scale = column_scale(information)
    values, vectors = np.linalg.eigh(information / np.outer(scale, scale))
    # directions at rounding level, in which the data say nothing, count as known exactly
    kept = values > 1e-14 * values[-1]
    if not kept.any():
        return np.full_like(information, np.nan), np.inf
    half = vectors[:, kept] / np.sqrt(values[kept]) / scale[:, None]
    condition = float(values[-1] / values[0]) if values[0] > 0.0 else np.inf
    return half @ half.T, condition
