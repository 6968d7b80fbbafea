"""Transfer functions from frequency responses, by maximum likelihood."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from sysid.continuous.fit_response_ss import states_by_vector_fitting
from sysid.continuous.rational_grid import Fraction, Fractions
from sysid.continuous.response_estimate import FittedParameters, likelihood_of, response_estimate
from sysid.continuous.response_likelihood import Likelihood, Maximum, greatest
from sysid.continuous.structures import PerPath, RationalPath, RealisePaths, per_path
from sysid.models.continuous import Resampled
from sysid.models.data_summary import DataSummary
from sysid.models.estimate import Estimate
from sysid.models.frequency_response import FrequencyResponse
from sysid.polynomial.orders import Orders
from sysid.polynomial.polynomial_estimate import Realise
from sysid.records.arguments import real_number, shown, truth_value, whole_number
from sysid.records.arrays import ComplexArray, FloatArray
from sysid.records.errors import SysidError

REFITS = 5  # steps of linear least squares
CLEAR_PHASE = 5.0  # standard deviations that a response differs from zero where its phase is used
LONGEST_DELAY = 1000  # in samples, each of them a state of the model
SCREENED_DELAYS = 60  # delays tried in continuous time, evenly spread
SCREENED_SAMPLES = 240  # delays tried in discrete time at most, one for each whole number of samples
SEARCHED_DELAYS = 4  # the most likely of the tried delays, from which the search starts


@dataclass(frozen=True)
class PathOrders:
    """Orders of the transfer function of one path.

    Attributes:
        nb: Number of coefficients of the numerator.
        nf: Degree of the denominator.
        delay: In s, or in samples of a model in discrete time; None if it is estimated.
    """

    nb: int
    nf: int
    delay: float | None


def fit_response(
    response: FrequencyResponse,
    nb: PerPath,
    nf: PerPath,
    nk: PerPath | None = 1,
    *,
    delay: float | Sequence[float | None] | Sequence[Sequence[float | None]] | None = 0.0,
    continuous: bool | None = None,
    stable: bool = True,
    known_variance: bool = True,
    max_iterations: int = 100,
) -> Estimate:
    """Fit transfer functions to a frequency response by maximum likelihood [Pintelon2012, ch. 9].

    Minimises the sum over frequencies of e* S^-1 e, e the errors of all paths and S their covariance. In discrete time
    G = B(q)/F(q) as in `oe`; in continuous time as in `tfest`, with m = nb - 1 and n = nf,
    G(s) = exp(-s delay) (b_m s^m + ... + b_0) / (s^n + a_n-1 s^(n-1) + ... + a_0). The search starts from vector fits
    [Gustavsen2006] and from iterated linear least squares [SanathananKoerner1963]; it runs in polynomials that are
    orthogonal on the frequencies [Brubeck2021], so that decades between poles cost no digits.

    Args:
        response: Measured response; frequencies where it is NaN are omitted. Without a covariance all errors have one
            variance, which is estimated.
        nb: Number of coefficients of the numerator: a number for all paths, one per input, or with several outputs a
            row per output of one per input.
        nf: Degree of the denominator, likewise.
        nk: Delay in samples of a discrete-time model, likewise; None is estimated.
        delay: Delay in s of a continuous-time model, likewise; None is estimated.
        continuous: Fit a continuous-time model; by default where the response has dt = 0. A response of sampled data is
            then taken as that of a band-limited input; for a held input fit in discrete time and convert by `d2c`.
        stable: Whether all poles must be stable.
        known_variance: Whether the covariance of the response is known; otherwise it is known up to a factor.
        max_iterations: Limit on the steps of the search.

    Returns:
        Estimate, a `ContinuousEstimate` in continuous time. Residuals are errors in standard deviations. Diagnostics
        compare their sum of squares with that expected of a true model, and have the probability of a larger one,
        `p_value`.

    Raises:
        SysidError: Several outputs in discrete time, orders that do not fit, more parameters than values.

    Warns:
        SysidWarning: No convergence, poorly determined parameters, a sum of squares far above the expected one.
    """
    data, continuous, summary = likelihood_of(response, continuous, known_variance)
    stable = truth_value("stable", stable)
    max_iterations = whole_number("max_iterations", max_iterations, 1)
    _, ny, nu = data.response.response.shape
    if ny > 1 and not continuous:
        raise SysidError(
            f"expected one output in discrete time, got {ny}: fit_response_ss, or response.select(outputs=[0])"
        )
    if not continuous and not (np.isscalar(delay) and delay == 0.0):
        raise SysidError(f"delay is of continuous time: expected nk, in samples, in discrete time, got {shown(delay)}")
    paths = _orders_of_paths(nb, nf, delay if continuous else nk, ny, nu, continuous)
    unknown = sum(path.nb + path.nf for path in paths)
    if continuous:
        # a delay in samples is chosen among whole numbers: it takes no derivative, and no value of the response
        unknown += sum(path.delay is None for path in paths)
    if data.rows <= unknown:
        raise SysidError(
            f"{unknown} parameters from {data.rows:.4g} independent values of the response: lower the orders"
        )
    starts = _initial_models(data, paths, stable, continuous)
    best = greatest(data, starts, max_iterations)
    parameters_of = _continuous_parameters if continuous else _discrete_parameters
    return response_estimate("fit_response", data, summary, best, parameters_of(data, summary, paths, best))


def _orders_of_paths(nb: object, nf: object, delay: object, ny: int, nu: int, continuous: bool) -> list[PathOrders]:
    """Orders of every path, output by output, from those that the caller gives for all paths, inputs or channels."""
    counts = per_path("nb", nb, ny, nu)
    degrees = per_path("nf", nf, ny, nu)
    delays = per_path("delay" if continuous else "nk", delay, ny, nu)
    paths = []
    for i, j in np.ndindex(ny, nu):
        degree = whole_number("nf", degrees[i][j], 0)
        # in continuous time a numerator of higher degree than the denominator has no state-space model
        most_coefficients = degree + 1 if continuous else None
        count = whole_number("nb", counts[i][j], 1, most_coefficients)
        paths.append(PathOrders(count, degree, _checked_delay(delays[i][j], continuous)))
    return paths


def _checked_delay(delay: object, continuous: bool) -> float | None:
    """Delay in s, or in samples of a model in discrete time; None is kept."""
    if delay is None:
        return None
    if continuous:
        return real_number("delay", delay, "be a time >= 0 in s, or None", lambda d: 0.0 <= d < np.inf)
    return whole_number("nk", delay, 0, LONGEST_DELAY)


def _continuous_parameters(
    data: Likelihood, summary: DataSummary, paths: list[PathOrders], best: Maximum[Fractions]
) -> FittedParameters:
    """Coefficients of powers of s and delays, path by path, with their model."""
    theta, change = best.model.parameters(data.scale)
    _, ny, nu = data.response.response.shape
    structures = [RationalPath(path.nf, path.nb - 1, path.delay) for path in paths]
    rows = []
    for i in range(ny):
        rows.append(tuple(structures[i * nu : (i + 1) * nu]))
    # a response tells nothing of the noise at the samples: no innovation covariance
    realise = RealisePaths(tuple(rows), summary, "zoh", None)
    counts = np.reshape([path.nb for path in paths], (ny, nu))
    degrees = np.reshape([path.nf for path in paths], (ny, nu))
    return FittedParameters(
        values=theta,
        directions=change @ best.directions,
        names=realise.names,
        # a single path or output as a number or a list, as the caller would write it
        orders={"nb": np.squeeze(counts).tolist(), "nf": np.squeeze(degrees).tolist()},
        realise=Resampled(realise),
        realise_continuous=realise,
    )


def _discrete_parameters(
    data: Likelihood, summary: DataSummary, paths: list[PathOrders], best: Maximum[Fractions]
) -> FittedParameters:
    """Coefficients of B and F of the inputs, with their model."""
    theta, change = best.model.parameters(data.scale)
    nb, nf = tuple(path.nb for path in paths), tuple(path.nf for path in paths)
    delays = tuple(int(path.delay) for path in best.model.paths)
    orders = Orders(0, nb, 0, 0, nf, delays)
    # the search has B and F path by path, polynomial models have all B before all F
    ends = np.cumsum(np.column_stack((nb, nf)).ravel())
    blocks = np.split(np.arange(len(theta)), ends[:-1])
    sequence = np.concatenate(blocks[::2] + blocks[1::2])
    return FittedParameters(
        values=theta[sequence],
        directions=(change @ best.directions)[sequence],
        names=orders.names,
        orders=orders.select("nb", "nf", "nk"),
        realise=Realise(orders, summary, None),
        polynomials=orders.polynomials(theta[sequence]),
    )


def _initial_models(data: Likelihood, paths: list[PathOrders], stable: bool, continuous: bool) -> list[Fractions]:
    """Models that the search starts from, at the most likely of several delays where one is unknown."""
    candidates = _candidate_delays(data, paths, continuous)
    if len(candidates) == 1:
        return _models_at(data, paths, candidates[0], stable, continuous, screening=False)
    costs = []
    for delays in candidates:
        screened = _models_at(data, paths, delays, stable, continuous, screening=True)
        costs.append(data.cost(screened[0]))
    best = np.argsort(costs)[:SEARCHED_DELAYS]
    return [_models_at(data, paths, candidates[k], stable, continuous, screening=False)[0] for k in best]


def _candidate_delays(data: Likelihood, paths: list[PathOrders], continuous: bool) -> list[FloatArray]:
    """Sets of delays to try, one value per path: in s, or in samples of a model in discrete time."""
    _, _, nu = data.response.response.shape
    longest = np.zeros(len(paths))
    for k, path in enumerate(paths):
        if path.delay is None:
            longest[k] = _longest_delay(data, *divmod(k, nu))
    if all(path.delay is not None for path in paths):
        return [longest]
    if continuous:
        return [share * longest for share in np.linspace(0.0, 1.0, SCREENED_DELAYS)]
    # all unknown delays together: a grid over several would take a power of the time
    count = min(round(float(longest.max()) / data.response.dt) + 2, SCREENED_SAMPLES)
    return [np.full(len(paths), float(samples)) for samples in range(count)]


def _longest_delay(data: Likelihood, i: int, j: int) -> float:
    """Limit above the delay of a path, s: half as much again as the steeper of two slopes of its phase."""
    f, g = data.response.frequencies, data.response.response[:, i, j]
    clear = np.abs(g) * data.weights()[:, i, j] > CLEAR_PHASE
    if data.known_variance and clear.sum() > 2:
        f, g = f[clear], g[clear]
    turns = -np.angle(g[1:] * g[:-1].conj()) / (2 * np.pi)
    median_slope, mean_slope = float(np.median(turns / np.diff(f))), float(turns.sum() / np.ptp(f))
    return 1.5 * max(median_slope, mean_slope, 0.0)


def _models_at(
    data: Likelihood, paths: list[PathOrders], delays: FloatArray, stable: bool, continuous: bool, *, screening: bool
) -> list[Fractions]:
    """Models at some delays, each path fitted by itself: of the best fits of all paths, of the second best, and so on.

    `delays` holds where the orders leave a delay unknown.
    """
    _, ny, nu = data.response.response.shape
    ones = np.ones(len(data.x), dtype=complex)
    unit = data.scale if continuous else 1.0  # x is s / scale
    fits = []
    for k, orders in enumerate(paths):
        channel = divmod(k, nu)
        delay = float(delays[k]) if orders.delay is None else orders.delay
        searched = orders.delay is None and continuous
        weights = data.weights()[:, *channel]
        path = Fraction(ones, ones, orders.nb, orders.nf, weights, unit * delay, searched)
        fits.append(_path_fits(data, channel, path, stable, continuous, screening=screening))
    # paths without poles have one fit alone: as many models as the path with the fewest has fits
    combinations = zip(*fits, strict=False)
    return [Fractions(data.x, combination, (ny, nu), stable, not continuous) for combination in combinations]


def _path_fits(
    data: Likelihood, channel: tuple[int, int], path: Fraction, stable: bool, continuous: bool, *, screening: bool
) -> list[Fraction]:
    """Fits of one path at its delay, best first: linear least squares from the fastest poles and from vector fits."""
    x = data.x
    g = data.response.response[:, *channel] / path.factor(x, not continuous)
    if not path.nf:
        return [path.with_numerator(x, g)]
    # the highest frequency in continuous time, immediate in discrete time
    fastest_pole = -1.0 if continuous else 0.0
    poles = [np.full(path.nf, fastest_pole, dtype=complex)]
    if not screening:
        poles += _poles_by_vector_fitting(data, g, path, stable, continuous)
    fits: list[tuple[float, Fraction]] = []
    for start in poles:
        iterates = [path.with_poles(x, start).with_numerator(x, g)]
        for _ in range(REFITS):
            iterates.append(iterates[-1].refitted(x, g, stable, not continuous))
        # the iteration minimises no criterion, so the last step need not be the best
        costs = [_sum_of_squares(fit, g) for fit in iterates]
        best = int(np.argmin(costs))
        fits.append((costs[best], iterates[best]))
    return [fit for _, fit in sorted(fits, key=lambda cost_and_fit: cost_and_fit[0])]


def _poles_by_vector_fitting(
    data: Likelihood, g: ComplexArray, path: Fraction, stable: bool, continuous: bool
) -> list[ComplexArray]:
    """Sets of poles of vector fits to the response of one path without its delay."""
    n = path.nf
    # B/F without its delay is proper in z
    proper = g if continuous else g * data.x ** (n - path.nb + 1.0)
    states = states_by_vector_fitting(
        data.x,
        data.response.frequencies,
        proper[:, None, None],
        path.weights[:, None, None],
        (n, n + 2, 2 * n),
        path.nb > n or not continuous,
        stable,
        0.0 if continuous else data.response.dt,
    )
    return [np.linalg.eigvals(state.matrices.A).astype(complex) for state in states]


def _sum_of_squares(fit: Fraction, g: ComplexArray) -> float:
    """Weighted squared errors of a path, delay left out."""
    return float(np.sum(np.abs(fit.weights * (g - fit.numerator / fit.denominator)) ** 2))
