"""Transfer functions from frequency responses, by maximum likelihood."""

from collections.abc import Callable, Sequence

import numpy as np

from sysid.continuous.fit_response_ss import states_by_vector_fitting
from sysid.continuous.rational_grid import Fraction, Fractions
from sysid.continuous.response_estimate import likelihood_of, response_estimate
from sysid.continuous.response_likelihood import Likelihood, greatest
from sysid.continuous.structures import PerPath, RationalPath, RealisePaths, per_path
from sysid.models.continuous import Resampled
from sysid.models.estimate import Estimate
from sysid.models.frequency_response import FrequencyResponse
from sysid.models.state_space import StateSpace
from sysid.polynomial.orders import Orders
from sysid.polynomial.polynomial_estimate import Realise
from sysid.records.arguments import real_number, shown, truth_value, whole_number
from sysid.records.arrays import FloatArray
from sysid.records.errors import SysidError

REFITS = 5  # steps of linear least squares
KNOWN = 5.0  # standard deviations that a response differs from zero where its phase is used
LONGEST = 1000  # delay in samples, each of them a state of the model
SCREENED, DELAYS = 60, 4  # delays tried, and those that are searched from


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
    stable, max_iterations = truth_value("stable", stable), whole_number("max_iterations", max_iterations, 1)
    _, ny, nu = data.response.response.shape
    if ny > 1 and not continuous:
        raise SysidError(
            f"expected one output in discrete time, got {ny}: fit_response_ss, or response.select(outputs=[0])"
        )
    if not continuous and not (np.isscalar(delay) and delay == 0.0):
        raise SysidError(f"delay is of continuous time: expected nk, in samples, in discrete time, got {shown(delay)}")
    paths = _orders(nb, nf, delay if continuous else nk, ny, nu, continuous)
    unknown = sum(b + f + (continuous and late is None) for b, f, late in paths)
    if data.rows <= unknown:
        raise SysidError(
            f"{unknown} parameters from {data.rows:.4g} independent values of the response: lower the orders"
        )
    best = greatest(data, _starts(data, paths, stable, continuous), max_iterations)
    theta, change = best.model.parameters(data.scale)
    sequence, polynomials, continuous_model = np.arange(len(theta)), None, None
    realise: Callable[[FloatArray], StateSpace]
    if continuous:
        structures = [RationalPath(f, b - 1, late) for b, f, late in paths]
        rows = tuple(tuple(structures[i * nu : (i + 1) * nu]) for i in range(ny))
        continuous_model = RealisePaths(rows, summary, "zoh", None)
        names, realise = continuous_model.names, Resampled(continuous_model)
        counts = {"nb": [b for b, _, _ in paths], "nf": [f for _, f, _ in paths]}
        reported = {name: np.squeeze(np.reshape(values, (ny, nu))).tolist() for name, values in counts.items()}
    else:
        delays = tuple(int(path.delay) for path in best.model.paths)
        orders = Orders(0, tuple(b for b, _, _ in paths), 0, 0, tuple(f for _, f, _ in paths), delays)
        # polynomial models have all B before all F
        parts = np.split(sequence, np.cumsum([count for b, f, _ in paths for count in (b, f)])[:-1])
        sequence = np.concatenate(parts[::2] + parts[1::2])
        names, reported, realise = orders.names, orders.select("nb", "nf", "nk"), Realise(orders, summary, None)
        polynomials = orders.polynomials(theta[sequence])
    return response_estimate(
        "fit_response",
        data,
        summary,
        best,
        reported,
        theta=theta[sequence],
        directions=(change @ best.directions)[sequence],
        names=names,
        realise=realise,
        realise_continuous=continuous_model,
        polynomials=polynomials,
    )


Path = tuple[int, int, float | None]


def _orders(nb: object, nf: object, delay: object, ny: int, nu: int, continuous: bool) -> list[Path]:
    """Coefficients of the numerator, degree of the denominator and delay, None if unknown, of every path."""
    name = "delay" if continuous else "nk"
    tables = [per_path(key, value, ny, nu) for key, value in (("nb", nb), ("nf", nf), (name, delay))]
    paths: list[Path] = []
    for b, f, late in zip(*([one for row in table for one in row] for table in tables), strict=True):
        n = whole_number("nf", f, 0)
        m = whole_number("nb", b, 1, n + 1 if continuous else None)
        if late is not None and continuous:
            late = real_number("delay", late, "be a time >= 0 in s, or None", lambda d: 0.0 <= d < np.inf)
        paths.append((m, n, late if late is None or continuous else whole_number("nk", late, 0, LONGEST)))
    return paths


def _starts(data: Likelihood, paths: list[Path], stable: bool, continuous: bool) -> list[Fractions]:
    """Vector fits and fits by linear least squares, at the most likely of several delays where one is unknown."""
    _, ny, nu = data.response.response.shape
    free = [late is None for _, _, late in paths]
    longest = [_longest_delay(data, k // nu, k % nu) if one else 0.0 for k, one in enumerate(free)]
    tried = [np.zeros(len(paths))]
    if any(free) and continuous:
        tried = [share * np.array(longest) for share in np.linspace(0.0, 1.0, SCREENED)]
    elif any(free):
        tried = [np.full(len(paths), k) for k in range(min(round(max(longest) / data.response.dt) + 2, 4 * SCREENED))]

    ones, unit = np.ones(len(data.x), dtype=complex), data.scale if continuous else 1.0

    def fits(late: FloatArray, *, screening: bool) -> list[Fractions]:
        parts = []
        for k, (b, f, fixed) in enumerate(paths):
            channel = divmod(k, nu)
            delay = unit * (float(late[k]) if fixed is None else fixed)
            path = Fraction(ones, ones, b, f, data.weights()[:, *channel], delay, fixed is None and continuous)
            parts.append(_path_fits(data, channel, path, stable, continuous, screening=screening))
        return [Fractions(data.x, one, (ny, nu), stable, not continuous) for one in zip(*parts, strict=False)]

    if len(tried) == 1:
        return fits(tried[0], screening=False)
    best = np.argsort([data.cost(fits(late, screening=True)[0]) for late in tried])[:DELAYS]
    return [fits(tried[k], screening=False)[0] for k in best]


def _longest_delay(data: Likelihood, i: int, j: int) -> float:
    """Delay longer than the phase shows, s: half as much again as its slope where it is known."""
    f, g = data.response.frequencies, data.response.response[:, i, j]
    known = np.abs(g) * data.weights()[:, i, j] > KNOWN
    f, g = (f[known], g[known]) if data.known and known.sum() > 2 else (f, g)
    turned = -np.angle(g[1:] * g[:-1].conj()) / (2 * np.pi)
    return 1.5 * max(float(np.median(turned / np.diff(f))), float(turned.sum() / np.ptp(f)), 0.0)


def _path_fits(
    data: Likelihood, channel: tuple[int, int], path: Fraction, stable: bool, continuous: bool, *, screening: bool
) -> list[Fraction]:
    """Fits of one path at its delay, best first: linear least squares from the fastest poles and from vector fits."""
    x, w, n = data.x, path.weights, path.nf
    g = data.response.response[:, *channel] / path.factor(x, not continuous)
    if not n:
        return [path.with_numerator(x, g)]
    poles = [np.full(n, -1.0 if continuous else 0.0, dtype=complex)]
    if not screening:
        # B/F without its delay is proper in z
        proper = g if continuous else g * x ** (n - path.nb + 1.0)
        states = states_by_vector_fitting(
            x,
            data.response.frequencies,
            proper[:, None, None],
            w[:, None, None],
            (n, n + 2, 2 * n),
            path.nb > n or not continuous,
            stable,
            0.0 if continuous else data.response.dt,
        )
        poles += [np.linalg.eigvals(one.matrices.A).astype(complex) for one in states]
    out = []
    for start in poles:
        chain = [path.with_poles(x, start).with_numerator(x, g)]
        for _ in range(REFITS):
            chain.append(chain[-1].refitted(x, g, stable, not continuous))
        costs = [float(np.sum(np.abs(w * (g - one.numerator / one.denominator)) ** 2)) for one in chain]
        out.append((min(costs), chain[int(np.argmin(costs))]))
    return [fit for _, fit in sorted(out, key=lambda one: one[0])]
