"""Initial estimates for the prediction-error minimisation.

None of these is a prediction-error estimate; each fails on some systems, and on different ones.
"""

from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import chain, combinations, islice

import numpy as np
import scipy

from sysid.models.polynomials import stabilised
from sysid.polynomial.error_jacobian import path_responses
from sysid.polynomial.gram_matrices import lagged_products, lagged_solution
from sysid.polynomial.least_squares import solve
from sysid.polynomial.long_arx import LongArx, arx_errors, arx_solution, long_arx_models, long_arx_order
from sysid.polynomial.missing_outputs import MissingOutputs
from sysid.polynomial.orders import Orders, with_delays
from sysid.polynomial.prediction_error import InitialEstimate, minimise
from sysid.polynomial.regressors import arx_regressors, input_lags, lagged, output_lags
from sysid.polynomial.stability_limit import admissible
from sysid.records.arrays import FloatArray
from sysid.records.data import IOData
from sysid.records.errors import SysidError

FILL_ROUNDS = 12  # limit on the rounds of filling and fitting
FILL_SETTLED = 1e-2  # change of the filled outputs, relative to the errors, at which they end


def fill_gaps(experiments: Sequence[IOData], orders: Orders) -> tuple[IOData, ...]:
    """Fill gaps with conditional means of a long ARX model, which is fitted to the filled record in turn."""
    if all(e.complete for e in experiments):
        return tuple(experiments)
    n = long_arx_order(experiments, orders, 3)
    filled = [replace(e, y=interpolated(e), missing=False) for e in experiments]
    for _ in range(FILL_ROUNDS):
        model = long_arx_models(filled, orders, n)(n)
        last_filled, filled = filled, []
        change = errors = 0.0
        for experiment, last in zip(experiments, last_filled, strict=True):
            update = _fill_with_conditional_means(model, experiment, last)
            change += float(np.sum((update.y - last.y) ** 2))
            errors += float(np.sum(model.errors(update)[model.skip :] ** 2))
            filled.append(update)
        if change <= FILL_SETTLED**2 * errors:
            break
    return tuple(filled)


def interpolated(experiment: IOData) -> FloatArray:
    """Outputs with straight lines across their gaps (N, ny)."""
    times = np.arange(len(experiment))
    channels = []
    for y, known in zip(experiment.y.T, experiment.known.T, strict=True):
        channels.append(np.interp(times, times[known], y[known]))
    return np.column_stack(channels)


def _fill_with_conditional_means(model: LongArx, experiment: IOData, filled: IOData) -> IOData:
    """Fill gaps with their conditional means under a model; before its errors begin, the earlier filling stays."""
    known = experiment.known[model.skip :]
    y = filled.y.copy()
    y[model.skip :][~known] = 0.0
    errors = arx_errors(replace(filled, y=y), model.a, model.b)[model.skip :]
    # the errors of an ARX model respond to an output by A
    gaps = MissingOutputs.of(known, model.a[:, None, None])
    if gaps.count:
        y[model.skip :][~known] = -gaps.best(errors[:, None, None])[:, 0]
    return replace(filled, y=y)


HANKEL_ROWS = 100  # of the pulse responses: enough for slow poles, and an eigenproblem of this size is fast
REFINEMENTS = 8  # limit on the Steiglitz-McBride iterations
SETTLED = 1e-3  # relative change of the denominator at which they end
DAMPED = 0.995  # largest modulus of poles in filters: their responses die out, and errors of estimates with them
LIGHTLY_DAMPED = 1.0 - 1e-6  # the same of estimates that keep resonances which last as long as the record


def initial_estimates(experiments: Sequence[IOData], orders: Orders) -> Iterator[InitialEstimate]:
    """Initial estimates for the structure that the orders select."""
    if not (orders.nd or any(orders.nf)):
        return armax_initial_estimates(experiments, orders)
    if orders.na:
        return general_initial_estimates(experiments, orders)
    estimates = bj_initial_estimates if orders.nc or orders.nd else oe_initial_estimates
    return estimates(experiments, orders)


def armax_initial_estimates(experiments: Sequence[IOData], orders: Orders) -> Iterator[InitialEstimate]:
    """Initial estimates of ARMAX: Hannan-Rissanen of two long ARX orders, simulated and reduced long ARX, and ARX."""
    y = [e.y[:, 0] for e in experiments]
    u = [e.u for e in experiments]
    rows = [orders.first_row(e.window) for e in experiments]
    shortest, middle, longest = (long_arx_order(experiments, orders, factor) for factor in (3, 5, 8))
    long_arx = long_arx_models(experiments, orders, longest)
    for n in (shortest, longest):
        yield InitialEstimate(f"Hannan-Rissanen ({n})", hannan_rissanen(experiments, orders, long_arx(n)))
    model = long_arx(middle)
    noise_free = [model.simulate(e) for e in experiments]
    path = arx_solution(noise_free, u, orders.na, orders.nb, orders.nk, rows)
    yield InitialEstimate(f"simulated ARX ({middle})", _without_noise_model(orders, path))
    yield InitialEstimate(f"reduced ARX ({middle})", _reduced_armax(experiments, orders, model))
    path = arx_solution(y, u, orders.na, orders.nb, orders.nk, rows)
    yield InitialEstimate("arx", _without_noise_model(orders, path))


def check_room_to_start(experiments: Sequence[IOData], orders: Orders) -> None:
    """Refuse orders for which the data are too short to make initial estimates."""
    orders = _as_armax(orders) if orders.na else orders
    dynamics, rows = max((orders.na, *orders.nf)), _hankel_rows(experiments, orders)
    if dynamics >= rows:
        raise SysidError(
            f"too many orders for the data: dynamics of order {dynamics} need an experiment of {3 * (dynamics + 1)} "
            f"samples, the longest has {max(len(e) for e in experiments)}"
        )
    # the residuals of the long ARX model and their lags
    skipped = long_arx_order(experiments, orders, 8) + max(orders.nk, default=0) + max(orders.nc, orders.nd)
    available = []
    for experiment in experiments:
        first = max(experiment.window, orders.first_row(0), *orders.nf)
        available.append(len(experiment) - max(first, skipped))
    # coefficients of one regression: input path with the noise of ARMAX, or the disturbance of Box-Jenkins alone
    of_path = sum(orders.nb) + orders.nc + max((orders.na, *orders.nf))
    if min(available) <= 0 or sum(available) <= max(of_path, orders.nc + orders.nd):
        raise SysidError(
            f"too many orders for the data: {orders.count} parameters and {max(sum(available), 0)} samples in "
            f"{len(experiments)} experiment(s) after the first {skipped}, which the initial estimates need"
        )


def oe_initial_estimates(experiments: Sequence[IOData], orders: Orders) -> Iterator[InitialEstimate]:
    """OE: Steiglitz-McBride from the simulation of a long ARX model, that model reduced, and variants of ARX."""
    y = [e.y[:, 0] for e in experiments]
    n = long_arx_order(experiments, orders, 5)
    model = long_arx_models(experiments, orders, n)(n)
    noise_free = [model.simulate(e) for e in experiments]
    simulated = steiglitz_mcbride(experiments, orders, noise_free, 0)
    refined = steiglitz_mcbride(experiments, orders, y, REFINEMENTS, simulated)
    yield InitialEstimate(f"Steiglitz-McBride from simulated ARX ({n})", refined)
    yield InitialEstimate(f"reduced ARX ({n})", reduced_path(experiments, orders, model))
    yield InitialEstimate("Steiglitz-McBride from arx", steiglitz_mcbride(experiments, orders, y, REFINEMENTS))
    refined = steiglitz_mcbride(experiments, orders, noise_free, REFINEMENTS, simulated)
    yield InitialEstimate(f"Steiglitz-McBride of simulated ARX ({n})", refined)
    yield InitialEstimate(f"simulated ARX ({n})", simulated)
    yield InitialEstimate("arx", steiglitz_mcbride(experiments, orders, y, 0))
    yield from lightly_damped_estimates(experiments, orders, model)


def lightly_damped_estimates(
    experiments: Sequence[IOData], orders: Orders, model: LongArx
) -> Iterator[InitialEstimate]:
    """OE with poles next to the unit circle: a long ARX model reduced, Steiglitz-McBride from it and from ARX.

    The other estimates damp such poles. From there a search does not find a resonance that lasts thousands of samples:
    the phase of its response has a minimum of the criterion at every turn.
    """
    y = [e.y[:, 0] for e in experiments]
    reduced = reduced_path(experiments, orders, model, LIGHTLY_DAMPED)
    estimates = {
        "reduced ARX": reduced,
        "Steiglitz-McBride from reduced ARX": steiglitz_mcbride(
            experiments, orders, y, REFINEMENTS, reduced, LIGHTLY_DAMPED
        ),
        "Steiglitz-McBride from arx": steiglitz_mcbride(experiments, orders, y, REFINEMENTS, radius=LIGHTLY_DAMPED),
        "arx": steiglitz_mcbride(experiments, orders, y, 0, radius=LIGHTLY_DAMPED),
    }
    for name, theta in estimates.items():
        _, _, _, _, f = orders.split(theta)
        # without poles beyond the other limit the estimate is one of the others
        if any(np.abs(np.roots(fj)).max(initial=0.0) > DAMPED for fj in f):
            yield InitialEstimate(f"{name}, lightly damped", theta)


def hannan_rissanen(experiments: Sequence[IOData], orders: Orders, model: LongArx) -> FloatArray:
    """ARMAX: least squares with the residuals of a long ARX model in place of e [HannanRissanen1982]."""
    u_lags = [input_lags(nb, nk) for nb, nk in zip(orders.nb, orders.nk, strict=True)]
    lags = [output_lags(orders.na), *u_lags, output_lags(orders.nc)]
    longest_lag = max(orders.first_row(0), orders.nc)
    # the residuals need `skip` samples before them, their lags nc more
    starts = [max(max(e.window, model.skip) + orders.nc, longest_lag) for e in experiments]
    products: FloatArray | float = 0.0
    for e, start in zip(experiments, starts, strict=True):
        signals = np.column_stack((e.y[:, 0], e.u, model.errors(e)))
        products = products + lagged_products(signals, longest_lag, start)
    # the right-hand side is y - e
    weights = [1.0] + [0.0] * len(orders.nb) + [-1.0]
    theta = lagged_solution(np.asarray(products), lags, weights)
    if theta is not None:
        return with_stable_noise(orders, theta)
    rows, targets = [], []
    for e, start in zip(experiments, starts, strict=True):
        y, errors = e.y[:, 0], model.errors(e)
        arx_columns = arx_regressors(y, e.u, orders.na, orders.nb, orders.nk, start)
        rows.append(np.hstack((arx_columns, lagged(errors, output_lags(orders.nc), start))))
        targets.append((y - errors)[start:])
    return with_stable_noise(orders, solve(np.vstack(rows), np.concatenate(targets)[:, None]).solution[:, 0])


def with_stable_noise(orders: Orders, theta: FloatArray) -> FloatArray:
    """The same parameters with the roots of C and F moved inside the unit circle."""
    a, b, c, d, f = orders.split(theta)
    return orders.join(a, b, stabilised(c), d, [stabilised(fj) for fj in f])


def steiglitz_mcbride(
    experiments: Sequence[IOData],
    orders: Orders,
    y: Sequence[FloatArray],
    iterations: int,
    first: FloatArray | None = None,
    radius: float = DAMPED,
) -> FloatArray:
    """Repeated least squares on data filtered by 1/F [SteiglitzMcBride1965]; several inputs share one F.

    `first` are parameters whose F filters in the first iteration; None starts with ARX. No root of F has a modulus
    beyond `radius`.
    """
    nf = max(orders.nf)
    u = [e.u for e in experiments]
    starts = [max(e.window, nf, orders.first_row(e.window)) for e in experiments]
    f = np.ones(1)
    if first is not None:
        _, _, _, _, denominators = orders.split(first)
        f = max(denominators, key=len)
    theta = np.zeros(0)
    for k in range(iterations + 1):
        last_f = f
        if k or first is not None:
            filtered_y = [scipy.signal.lfilter([1.0], f, yi) for yi in y]
            filtered_u = [scipy.signal.lfilter([1.0], f, ui, axis=0) for ui in u]
        else:
            filtered_y, filtered_u = list(y), u
        theta = arx_solution(filtered_y, filtered_u, nf, orders.nb, orders.nk, starts)
        f = stabilised(np.concatenate(([1.0], theta[:nf])), radius)
        if len(last_f) == len(f) and np.abs(f - last_f).max() <= SETTLED * np.abs(f).max():
            break
    return orders.join(np.ones(1), _split_numerators(orders, theta[nf:]), f=[_cut_denominator(f, n) for n in orders.nf])


def _cut_denominator(f: FloatArray, degree: int) -> FloatArray:
    """The first coefficients of a stable denominator, stabilised again where some are cut off."""
    return f if degree == len(f) - 1 else stabilised(f[: degree + 1])


def reduced_path(experiments: Sequence[IOData], orders: Orders, model: LongArx, radius: float = DAMPED) -> FloatArray:
    """OE: F from the pulse responses of a long ARX model, path by path; then B by least squares on the data.

    No root of F has a modulus beyond `radius`.
    """
    rows = _hankel_rows(experiments, orders)
    *responses, _ = model.responses(2 * rows + max(orders.nk) + max(orders.nb), radius)
    f = []
    for response, nb, nk, nf in zip(responses, orders.nb, orders.nk, orders.nf, strict=True):
        # after the last coefficient of B the response obeys the recursion by F
        f.append(reduced_denominator([response[max(nk + nb - nf, 1) :]], nf, rows, radius))
    blocks, targets = [], []
    for e in experiments:
        start = orders.first_row(e.window)
        columns = []
        for j, (nb, nk) in enumerate(zip(orders.nb, orders.nk, strict=True)):
            filtered = scipy.signal.lfilter([1.0], f[j], e.u[:, j])
            columns.append(lagged(filtered, input_lags(nb, nk), start))
        blocks.append(np.hstack(columns))
        targets.append(e.y[start:])
    theta = solve(np.vstack(blocks), np.concatenate(targets)).solution[:, 0]
    return orders.join(np.ones(1), _split_numerators(orders, theta), f=f)


def reduced_denominator(responses: Sequence[FloatArray], order: int, rows: int, radius: float = DAMPED) -> FloatArray:
    """Stable denominator shared by pulse responses, from their Hankel matrices [JuangPappa1985].

    Each response (2 rows,) or longer starts where its recursion holds.
    """
    if order == 0:
        return np.ones(1)
    # the largest eigenvectors of H H' are the left singular vectors of the Hankel matrices side by side
    square: FloatArray | float = 0.0
    for response in responses:
        hankel = scipy.linalg.hankel(response[:rows], response[rows - 1 : 2 * rows - 1])
        square = square + hankel @ hankel.T
    _, vectors = np.linalg.eigh(square)
    observability = vectors[:, -order:]
    dynamics, *_ = np.linalg.lstsq(observability[:-1], observability[1:], rcond=None)
    return stabilised(np.atleast_1d(np.poly(np.linalg.eigvals(dynamics)).real), radius)


def _reduced_armax(experiments: Sequence[IOData], orders: Orders, model: LongArx) -> FloatArray:
    """ARMAX: A from all pulse responses of a long ARX model, then B and C by least squares with its residuals."""
    rows = _hankel_rows(experiments, orders)
    residuals = [model.errors(e) for e in experiments]
    # each path counts as much as its signal moves the output
    inputs, innovations = np.concatenate([e.u for e in experiments]), [error[model.skip :] for error in residuals]
    weights = [float(np.std(u)) for u in inputs.T]
    weights.append(float(np.std(np.concatenate(innovations))))
    # after the last coefficient of B or C the responses obey the recursion by A
    firsts = [nk + nb - orders.na for nk, nb in zip(orders.nk, orders.nb, strict=True)]
    firsts.append(orders.nc - orders.na + 1)
    responses = model.responses(2 * rows + max(*firsts, 1))
    weighted = []
    for response, first, weight in zip(responses, firsts, weights, strict=True):
        weighted.append(weight * response[max(first, 1) :])
    a = reduced_denominator(weighted, orders.na, rows)
    blocks, targets = [], []
    for e, error in zip(experiments, residuals, strict=True):
        start = max(max(e.window, model.skip) + orders.nc, orders.first_row(0))
        inputs = arx_regressors(e.y[:, 0], e.u, 0, orders.nb, orders.nk, start)
        blocks.append(np.hstack((inputs, lagged(error, output_lags(orders.nc), start))))
        targets.append((scipy.signal.lfilter(a, [1.0], e.y[:, 0]) - error)[start:])
    theta = solve(np.vstack(blocks), np.concatenate(targets)[:, None]).solution[:, 0]
    return with_stable_noise(orders, np.concatenate((a[1:], theta)))


def _hankel_rows(experiments: Sequence[IOData], orders: Orders) -> int:
    """Rows of the Hankel matrices of pulse responses: enough for the order, and a third of the longest record."""
    degree = max((orders.na, *orders.nf))
    return min(max(HANKEL_ROWS, 2 * degree), max(len(e) for e in experiments) // 3)


def _without_noise_model(orders: Orders, arx_theta: FloatArray) -> FloatArray:
    """Parameters of ARMAX with C = 1 from those of ARX."""
    return np.concatenate((arx_theta, np.zeros(orders.nc)))


def _split_numerators(orders: Orders, coefficients: FloatArray) -> list[FloatArray]:
    """B of each input from the coefficients of all of them (sum(nb),)."""
    return with_delays(np.split(coefficients, np.cumsum(orders.nb)[:-1]), orders.nk)


def bj_initial_estimates(experiments: Sequence[IOData], orders: Orders) -> Iterator[InitialEstimate]:
    """Box-Jenkins: input paths, each with a disturbance model by the second step of Hannan and Rissanen.

    Steiglitz-McBride on data whitened by a long ARX model gives efficient input paths [ZhuHjalmarsson2016]; a reduced
    long model and output-error fits work where that fails.
    """
    path_orders = replace(orders, nc=0, nd=0)
    shortest, longest = (long_arx_order(experiments, orders, factor) for factor in (3, 8))
    long_arx = long_arx_models(experiments, orders, longest)
    model = long_arx(shortest)
    for n in (shortest, longest):
        path = _path_from_whitened_data(experiments, path_orders, long_arx(n))
        yield InitialEstimate(
            f"whitened ({n})", _append_disturbance_model(experiments, orders, path_orders, path, model)
        )
    path = reduced_path(experiments, path_orders, long_arx(longest))
    yield InitialEstimate(
        f"reduced ARX ({longest})", _append_disturbance_model(experiments, orders, path_orders, path, model)
    )
    for start in oe_initial_estimates(experiments, path_orders):
        theta = _append_disturbance_model(experiments, orders, path_orders, start.theta, model)
        yield InitialEstimate(f"oe: {start.name}", theta)


def _path_from_whitened_data(experiments: Sequence[IOData], path_orders: Orders, model: LongArx) -> FloatArray:
    """Input paths by Steiglitz-McBride on data filtered by A of a long ARX model, which whitens the disturbance."""
    noise_free = [model.simulate(e) for e in experiments]
    first = steiglitz_mcbride(experiments, path_orders, noise_free, REFINEMENTS)
    white = []
    for experiment in experiments:
        u = scipy.signal.lfilter(model.a, [1.0], experiment.u, axis=0)
        y = scipy.signal.lfilter(model.a, [1.0], experiment.y, axis=0)
        white.append(replace(experiment, u=u, y=y))
    return steiglitz_mcbride(white, path_orders, [e.y[:, 0] for e in white], REFINEMENTS, first)


def _append_disturbance_model(
    experiments: Sequence[IOData], orders: Orders, path_orders: Orders, path: FloatArray, model: LongArx
) -> FloatArray:
    """Add C and D: regress v = y - B/F u on lags of itself and of the estimated innovations."""
    a, b, _, _, f = path_orders.split(path)
    rows, targets = [], []
    for e in experiments:
        innovations = model.errors(e)
        v = e.y[:, 0] - sum(path_responses(e.u, b, f))
        start = max(e.window, model.skip) + max(orders.nc, orders.nd)
        by_c = lagged(innovations, output_lags(orders.nc), start)
        by_d = -lagged(v, output_lags(orders.nd), start)
        rows.append(np.hstack((by_c, by_d)))
        targets.append((v - innovations)[start:])
    coefficients = solve(np.vstack(rows), np.concatenate(targets)[:, None]).solution[:, 0]
    c = stabilised(np.concatenate(([1.0], coefficients[: orders.nc])))
    d = stabilised(np.concatenate(([1.0], coefficients[orders.nc :])))
    return orders.join(a, b, c, d, f)


SHARED_STEPS = 20  # of the Box-Jenkins model whose denominators share A: with 4 the two are still far apart
CANDIDATES = 8  # choices of the roots of A among those of A D F, the likeliest first
ROUNDS = 3  # initial estimates of the other polynomials for each A


def general_initial_estimates(experiments: Sequence[IOData], orders: Orders) -> Iterator[InitialEstimate]:
    """A beside D or F: for several A, the initial estimates of the structure without A for the output A y.

    A D F y = B D u + C F e is an ARMAX model, by Hannan and Rissanen. Of its poles, those of D are zeros of B D, and
    those of F are zeros of C F; the others are roots of A. The first estimate comes from a Box-Jenkins model instead.
    """
    yield from _from_box_jenkins(experiments, orders)
    as_armax, without_a = _as_armax(orders), replace(orders, na=0)
    n = long_arx_order(experiments, as_armax, 8)
    model = long_arx_models(experiments, as_armax, n)(n)
    a, b, c, *_ = as_armax.split(hannan_rissanen(experiments, as_armax, model))
    denominators = []
    for k, factor in enumerate(_likely_factors(a, [*b, c], orders.na), start=1):
        denominators.append((f"A {k}", factor))
    plain_armax = replace(without_a, na=orders.na, nd=0, nf=(0,) * len(orders.nf))
    for start in armax_initial_estimates(experiments, plain_armax):
        denominators.append((f"A of {start.name}", plain_armax.split(start.theta)[0]))
    families = [(name, a, initial_estimates(_filter_outputs(a, experiments), without_a)) for name, a in denominators]
    # the best method for every A comes first, then the next best: the search may end at any of them
    for _ in range(ROUNDS):
        for name, a, family in families:
            for start in islice(family, 1):
                _, b, c, d, f = without_a.split(start.theta)
                yield InitialEstimate(f"{name}, {start.name}", orders.join(a, b, c, d, f))


def _from_box_jenkins(experiments: Sequence[IOData], orders: Orders) -> Iterator[InitialEstimate]:
    """From the Box-Jenkins model y = B/(A F) u + C/(A D) e, which holds A y = B/F u + C/D e; none if it has no such A.

    Its denominators are free: its search cannot give a root of F to A and a root of A to F, which is a local minimum of
    the structure with A. Roots that disturbance and paths have in common, or nearly so, are those of A.
    """
    with_free_denominators = replace(orders, na=0, nd=orders.na + orders.nd, nf=tuple(n + orders.na for n in orders.nf))
    minima = []
    for start in bj_initial_estimates(experiments, with_free_denominators):
        if admissible(with_free_denominators, start.theta):
            minima.append(minimise(experiments, with_free_denominators, start.theta, max_iterations=SHARED_STEPS).at)
    if not minima:
        return
    best = min(minima, key=lambda minimum: minimum.cost)
    _, b, c, of_disturbance, of_paths = with_free_denominators.split(best.theta)
    a, d = _common_factor(of_disturbance, of_paths, orders.na)
    f = [_common_factor(denominator, [a], orders.na)[1] for denominator in of_paths]
    fits = len(a) == orders.na + 1 and len(d) == orders.nd + 1
    if fits and all(len(fj) == nf + 1 for fj, nf in zip(f, orders.nf, strict=True)):
        yield InitialEstimate("Box-Jenkins", orders.join(a, b, c, d, f))


def _common_factor(polynomial: FloatArray, others: Sequence[FloatArray], degree: int) -> tuple[FloatArray, FloatArray]:
    """Real factor of a degree whose roots are nearly roots of all other polynomials, and what it leaves.

    One and the polynomial where pairs of complex roots allow no factor of that degree.
    """
    groups = _root_groups(polynomial)
    if not groups:
        return np.ones(1), polynomial
    distances = np.max([_relative_values(other, groups) for other in others], axis=0)
    nearness = -np.log(np.maximum(distances, np.finfo(float).tiny))
    choices = _ranked_choices(groups, nearness, degree)
    if not choices:
        return np.ones(1), polynomial
    left = [k for k in range(len(groups)) if k not in choices[0]]
    return _with_roots(groups, choices[0]), _with_roots(groups, left)


def _filter_outputs(a: FloatArray, experiments: Sequence[IOData]) -> list[IOData]:
    """Experiments with the output A y, whose first samples lack their past."""
    filtered = []
    for experiment in experiments:
        y = scipy.signal.lfilter(a, [1.0], experiment.y, axis=0)
        filtered.append(replace(experiment, y=y, window=max(experiment.window, len(a) - 1)))
    return filtered


def _as_armax(orders: Orders) -> Orders:
    """Orders of A D F y = B D u + C F e, F the product of all inputs' F."""
    f_degree = sum(orders.nf)
    # beside the B of an input stands the F of all others
    nb = tuple(b + orders.nd + f_degree - f for b, f in zip(orders.nb, orders.nf, strict=True))
    na, nc = orders.na + orders.nd + f_degree, orders.nc + f_degree
    return replace(orders, na=na, nb=nb, nc=nc, nd=0, nf=(0,) * len(orders.nf))


def _likely_factors(denominator: FloatArray, numerators: Sequence[FloatArray], degree: int) -> list[FloatArray]:
    """Real factors of a degree, the likeliest to be A first: their roots are zeros of no numerator.

    The last numerator is that of the noise.
    """
    groups = _root_groups(denominator)
    *by_input, of_noise = (_relative_values(numerator, groups) for numerator in numerators)
    # roots of D are zeros for every input, roots of F for the noise
    likelihood = np.log(np.maximum(np.max(by_input, axis=0) * of_noise, np.finfo(float).tiny))
    choices = _ranked_choices(groups, likelihood, degree)
    return [_with_roots(groups, choice) for choice in choices[:CANDIDATES]]


def _root_groups(polynomial: FloatArray) -> list[list[complex]]:
    """Real roots, and pairs of complex ones, which stay together."""
    return [_with_conjugate(root) for root in np.roots(polynomial) if root.imag >= 0.0]


def _ranked_choices(groups: Sequence[Sequence[complex]], likelihood: FloatArray, degree: int) -> list[tuple[int, ...]]:
    """Choices of groups of roots that have a degree together, those of the largest likelihood (groups,) first."""
    degrees = np.array([len(group) for group in groups], dtype=int)
    choices = []
    for count in range(1, degree + 1):
        for choice in combinations(range(len(groups)), count):
            if sum(degrees[k] for k in choice) == degree:
                choices.append(choice)
    evidence = degrees * likelihood
    choices.sort(key=lambda choice: -sum(evidence[k] for k in choice))
    return choices


def _with_roots(groups: Sequence[Sequence[complex]], choice: Sequence[int]) -> FloatArray:
    """Real monic polynomial with the roots of some of the groups."""
    chosen_roots = list(chain.from_iterable(groups[k] for k in choice))
    return np.atleast_1d(np.asarray(np.poly(chosen_roots).real, dtype=np.float64))


def _with_conjugate(root: complex) -> list[complex]:
    return [root, root.conjugate()] if root.imag else [root]


def _relative_values(polynomial: FloatArray, groups: Sequence[Sequence[complex]]) -> FloatArray:
    """Modulus of a polynomial at the first root of each group, relative to the sum of the moduli of its terms."""
    values = []
    for root, *_ in groups:
        terms = np.polyval(np.abs(polynomial), abs(root))
        # without terms, as of a B of zeros, every root is one of the polynomial
        values.append(abs(np.polyval(polynomial, root)) / terms if terms else 0.0)
    return np.array(values)
