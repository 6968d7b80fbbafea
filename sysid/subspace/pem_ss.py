"""Prediction-error refinement of state-space models."""

import warnings
from collections.abc import Callable, Iterator, Sequence
from functools import partial

import numpy as np

from sysid.models.estimate import DataSummary, Estimate
from sysid.models.predict import as_model, check_channels
from sysid.models.state_space import StateSpace
from sysid.polynomial.data_checks import check_excitation, check_means
from sysid.records.arguments import truth_value, whole_number
from sysid.records.arrays import FloatArray
from sysid.records.data import IOData, as_experiments
from sysid.records.errors import SysidError, SysidWarning
from sysid.subspace.n4sid import n4sid
from sysid.subspace.observer_gain import spectral_radius, stable_gain
from sysid.subspace.okid import okid
from sysid.subspace.predictor import LocalCoordinates, Predictor, Record, Scales
from sysid.subspace.predictor_errors import Point, gapped_covariance
from sysid.subspace.predictor_estimate import check_enough_samples, degrees_of_freedom, make_predictor_estimate
from sysid.subspace.predictor_fit import Minimum, coloured_information, column_scale, minimise

HORIZONS = (8, 12, 16, 20)  # block rows beside the least that allow the order
OBSERVERS = (5, 10)  # samples of past for OKID


def other_starts(experiments: Sequence[IOData], order: int) -> Iterator[tuple[str, StateSpace]]:
    """Models by subspaces of several horizons and by OKID; what the data do not allow is left out."""
    ny = experiments[0].ny
    for rows in sorted({order // ny + 2, *HORIZONS}):
        yield from _tried(
            f"n4sid ({rows} block rows)",
            order,
            partial(n4sid, experiments, order, block_rows=rows, stable=True),
        )
    for past in OBSERVERS:
        if past * ny >= order:
            yield from _tried(f"okid (p = {past})", order, partial(okid, experiments, order, p=past))


def _tried(name: str, order: int, make: Callable[[], Estimate]) -> Iterator[tuple[str, StateSpace]]:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", SysidWarning)
        try:
            model = make().model
        except (SysidError, np.linalg.LinAlgError):
            return
    if model.order == order:
        yield name, model


ILL_CONDITIONED = 1e12
CROSSING_STEPS = 20  # towards the minimum with K, where none is asked for, and the other way round
SCREENING_STEPS, POLISHED = 10, 2  # steps by which other beginnings are compared, and how many of them are gone on with
SHORT = 50.0  # values of output per parameter below which a criterion often has several minima
COLOUR = 30  # coefficients of the autoregressive models of a coloured disturbance


def pem_ss(
    data: IOData | Sequence[IOData],
    start: Estimate | StateSpace | Sequence[Estimate | StateSpace],
    *,
    direct: bool = True,
    gain: bool = True,
    coloured: bool = False,
    search: bool = True,
    max_iterations: int = 100,
) -> Estimate:
    """Minimise log det of the covariance of the one-step prediction errors [Ljung1999, ch. 7; McKelvey2004].

    The order is that of `start`. Every step moves in the directions that change the behaviour, none in those that only
    change the basis of the state, so that no canonical form is needed. The predictor A - K C stays stable at every
    accepted step; the initial state of every experiment is estimated.

    With `gain=True`, the default, plant and disturbance share one state, and the estimate is the best there is where
    the order is that of both together: three outputs with a disturbance of first order each add three states to it.
    Where the order is that of the plant alone, K is bought with errors in the plant; take more states then, or
    `gain=False`. `resid` tells: what is left must be white with K, and independent of the input without.

    Real data of a higher order than the model often have several minima. Give several starts then, for example `n4sid`
    with different `block_rows`: each is refined, and the best is returned.

    With `gain=False` the simulation error is minimised (an output-error model, K = 0): unbiased also where the
    disturbance is coloured in a way that a model of this order cannot describe, as long as the input is independent of
    it; the covariance then holds for a white one, unless `coloured` is set.

    Args:
        data: One experiment, or several that share the model; any numbers of inputs and outputs. Outputs may be
            missing: the likelihood of those that are known is maximised. `okid`, `armax` and others give a start then.
        start: Where to begin: an estimate by `n4sid`, `okid` or any other method, or a model; or several of one order.
        direct: Whether D is estimated; otherwise it is zero.
        gain: Whether K is estimated; otherwise it is zero.
        coloured: With `gain=False`, whether the covariance allows for a disturbance that is not white, by an
            autoregressive model of each output's [Ljung1999, ch. 9]. The estimate itself is the same.
        search: Whether other beginnings (`n4sid` with several horizons, `okid`, with and without K) are tried where one
            start is given and several minima are likely: the data hold fewer than 50 values of output per parameter. A
            few steps screen them. Such a fit takes about ten times as long.
        max_iterations: Accepted steps at most.

    Returns:
        The estimate. `parameters` are local coordinates: entries of A - K C, B - K D, K, C and D along directions
        orthogonal to changes of the state's basis; their covariance goes through to bandwidth and responses.
        Diagnostics: `criteria`, the minimum that each start led to, NaN for one that could not be used.

    Raises:
        SysidError: Constant input, channels that do not fit, no state, starts of different orders, too little data, no
            start whose predictor (with `gain=False`: which itself) is stable.

    Warns:
        SysidWarning: Poor excitation, means that do not fit the dynamics, no convergence, bad conditioning, a predictor
            at the edge of stability.
    """
    max_iterations = whole_number("max_iterations", max_iterations, 1)
    flags = {"direct": direct, "gain": gain, "coloured": coloured, "search": search}
    direct, gain, coloured, search = (truth_value(name, value) for name, value in flags.items())
    experiments = as_experiments(data, missing=not coloured)
    given = list(start) if isinstance(start, Sequence) else [start]
    models = [as_model(one) for one in given]
    if coloured and gain:
        raise SysidError(
            "coloured=True is for output-error models: with gain=True the model itself describes the colour"
        )
    if len({model.order for model in models}) != 1:
        raise SysidError(f"expected one start, or several of one order; got orders {[m.order for m in models]}")
    for model in models:
        for e in experiments:
            check_channels(model, e)
    model = models[0]
    if model.order == 0:
        raise SysidError(
            "expected a start with at least one state, got order 0: a direct term alone is arx(data, 0, 1, 0)"
        )
    nu, ny, n = model.nu, model.ny, model.order
    count = n * (nu + (2 if gain else 1) * ny) + (nu * ny if direct else 0)
    samples = check_enough_samples(experiments, n, count)
    texts = check_excitation(experiments, [n + (1 if direct else 0)] * nu) + check_means(experiments, -(-n // ny))
    scales = Scales.of(experiments)
    records = [Record.of(e, scales, gain) for e in experiments]
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
    found, origin = minima[chosen], given[chosen]
    name = origin.method if isinstance(origin, Estimate) else "model"
    doubtful = samples * ny < SHORT * count and found.reason != "errors at rounding level"
    if search and len(given) == 1 and doubtful and all(e.complete for e in experiments):
        found, name = _searched(experiments, records, scales, (name, models[0], found), direct, gain, max_iterations)
    covariance, condition = _covariance(found.normal.information)
    innovation = None
    if found.point.gaps:
        innovation = found.point.covariance
        if gain and found.reason != "errors at rounding level":
            at, information = found.point, found.normal.information
            covariance = gapped_covariance(records, at.predictor, at.weight, information, found.normal.basis)
    if coloured and found.reason != "errors at rounding level":
        point, basis = found.point, found.normal.basis
        covariance = covariance @ coloured_information(records, point, basis, min(COLOUR, samples // 20)) @ covariance
    covariance = covariance * samples / degrees_of_freedom(experiments, found.point.predictor, count)
    radius = float(np.abs(np.linalg.eigvals(found.point.predictor.A)).max())
    if not found.converged:
        texts.append(f"pem_ss did not converge: {found.reason}")
    if condition > ILL_CONDITIONED and found.reason != "errors at rounding level":
        texts.append(
            f"the parameters are poorly determined: condition number {condition:.2g} of the information matrix"
        )
    if radius > 1.0 - 1e-4:
        what = "predictor" if gain else "model"
        texts.append(f"the {what} has a pole of modulus {radius:.7f}, at the edge of stability: intervals may not hold")
    for text in texts:
        warnings.warn(text, SysidWarning, stacklevel=2)
    return make_predictor_estimate(
        "pem_ss",
        experiments,
        {"order": n},
        scales,
        predictor=found.point.predictor,
        basis=found.normal.basis,
        covariance=covariance,
        diagnostics={
            "condition": condition,
            "iterations": found.iterations,
            "evaluations": found.evaluations,
            "converged": found.converged,
            "reason": found.reason,
            "start": name,
            "criteria": tuple(minima[k].point.criterion if k in minima else np.nan for k in range(len(given))),
        },
        texts=texts,
        innovation=innovation,
    )


def _searched(
    experiments: Sequence[IOData],
    records: Sequence[Record],
    scales: Scales,
    first: tuple[str, StateSpace, Minimum],
    direct: bool,
    gain: bool,
    max_iterations: int,
) -> tuple[Minimum, str]:
    """The best of several minima, and from where."""
    name, given, best = first
    summary = DataSummary.of(experiments)
    directions = LocalCoordinates(direct)
    screened: list[tuple[str, Minimum]] = []
    candidates = list(other_starts(experiments, given.order))
    # the minimum of the other criterion leads round some that are not the lowest
    other = [Record.of(e, scales, not gain) for e in experiments]
    try:
        crossed = minimise(other, _starts(given, scales, direct, not gain)[0], directions, CROSSING_STEPS)
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
    for label, few in screened[:POLISHED]:
        found = few if few.converged else minimise(records, few.point.predictor, directions, max_iterations)
        if found.point.criterion < best.point.criterion:
            best, name = found, label
    return best, name


def _refined(records: Sequence[Record], starts: Sequence[Predictor], direct: bool, max_iterations: int) -> Minimum:
    """The minimum that the nearest of some predictors leads to."""
    begin = starts[0]
    if len(starts) > 1:
        begin = min(starts, key=lambda p: Point.at(records, p.balanced(), np.eye(p.C.shape[0])).criterion)
    return minimise(records, begin, LocalCoordinates(direct), max_iterations)


def _starts(model: StateSpace, scales: Scales, direct: bool, gain: bool) -> list[Predictor]:
    """Predictors to begin from: with the gain of the start, made stable where it is not, and without any.

    A gain found together with a poorer model may be far off; then it is better to begin without one.
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
    half = vectors[:, kept] / np.sqrt(values[kept]) / scale[:, None]
    return half @ half.T, float(values[-1] / values[0]) if values[0] > 0.0 else np.inf
