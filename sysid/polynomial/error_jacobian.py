"""Prediction errors of one experiment and their exact Jacobian, for each assumption on the initial conditions.

Missing outputs and initial conditions are eliminated together: the result is the Jacobian of the record with the
missing outputs at their conditional means, projected onto the complement of both [GolubPereyra2003].
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property, partial

import numpy as np
import scipy

from sysid.models.polynomials import ONE, is_stable
from sysid.polynomial.initial_conditions import InitialConditions
from sysid.polynomial.missing_outputs import MissingOutputs
from sysid.polynomial.orders import NO_TREND, Orders, SplitPolynomials
from sysid.polynomial.orthonormal_basis import gramian
from sysid.polynomial.regressors import input_lags, lagged, output_lags
from sysid.polynomial.trends import trend_terms
from sysid.records.arrays import FloatArray
from sysid.records.data import IOData
from sysid.records.singular_values import svd

LEAST_VARIANCE = 1e-8  # of an initial disturbance state, relative to the innovation: keeps the covariance regular
ROUNDING = 1e-12  # the same relative to the sum of variances, for a disturbance that hardly decays
FIRST_LENGTH = 256  # samples after which most transients have died out
NEGLIGIBLE = 1e-17  # tail of a transient, relative to its largest value, that rounding hides
DIED = 1e-60  # of a transient, relative to its largest value: no sum with any signal keeps a digit of it
DEPENDENT_TRANSIENTS = 1e-12  # singular value, relative to the largest, that rounding makes of zero
VANISHED = 1e-10  # error by a line of unit size that is rounding
VANISHED_CONSTANT = 1e-4  # error by a constant of one that hardly tells it: any level would do
STEP = 1e-5  # of the coefficients, for difference quotients of the small matrices of backcasting


@dataclass(frozen=True, eq=False)
class ErrorJacobian:
    """Errors with their derivatives.

    Attributes:
        columns: [d eps / d theta, eps], the initial conditions projected out; with backcasting the initial disturbance
            states come first, in units of the deviation of the innovation (rows, p + 1).
        errors: Number of prediction errors among the rows.
        transients: Number of free initial conditions.
        log_determinant: Contribution of missing outputs to -2 times the logarithm of the likelihood.
        slope: Derivatives of `log_determinant` (p,); None without missing outputs.
        trend: Trend of the output that explains most of the errors, in `trend_terms` (k,).
    """

    columns: FloatArray
    errors: int
    transients: int
    log_determinant: float = 0.0
    slope: FloatArray | None = None
    trend: FloatArray = field(default_factory=partial(np.zeros, 0))


def error_jacobian(
    experiment: IOData,
    orders: Orders,
    theta: FloatArray,
    initial_conditions: InitialConditions,
    roots: FloatArray | None = None,
    responses: "FreeResponses | None" = None,
) -> ErrorJacobian:
    """Prediction errors and Jacobian of one single-output experiment at stable parameters theta (p,).

    With square `roots` of weights (rows,) every row is multiplied by its own, and initial conditions and trends are
    those of the weighted least squares; not for backcasting. The free `responses` at the same parameters, of several
    experiments, are computed here unless they are given.
    """
    projects_no_trend = initial_conditions is not InitialConditions.ESTIMATED
    if orders.trend_terms and projects_no_trend:
        jacobian = error_jacobian if roots is None else partial(error_jacobian, roots=roots)
        return _jacobian_beside_trend(jacobian, experiment, orders, theta, initial_conditions)
    y, u = experiment.y[:, 0], experiment.u
    if initial_conditions is InitialConditions.ZERO:
        from_rest = _free_conditions_jacobian(y, u, orders, orders.split(theta), 0, NO_RESPONSE)
        columns = from_rest.columns[experiment.window :]
        if roots is not None:
            columns *= roots[:, None]
        return ErrorJacobian(columns, len(columns), 0)
    if initial_conditions is InitialConditions.BACKCAST and max(orders.nc, orders.nd):
        return _backcast_jacobian(y, u, orders, theta, orders.first_row(experiment.window))
    start = orders.first_error(experiment.window)
    responses = responses or FreeResponses(orders, theta)
    return _free_conditions_jacobian(y, u, orders, responses.polynomials, start, responses.of(len(y), start), roots)


def jacobian_of_record(
    experiment: IOData,
    orders: Orders,
    theta: FloatArray,
    initial_conditions: InitialConditions,
    responses: "FreeResponses | None" = None,
) -> ErrorJacobian:
    """`error_jacobian` of a complete record, `gapped_error_jacobian` of one with missing outputs."""
    if experiment.complete:
        return error_jacobian(experiment, orders, theta, initial_conditions, responses=responses)
    return gapped_error_jacobian(experiment, orders, theta, initial_conditions)


def _jacobian_beside_trend(
    jacobian: Callable[[IOData, Orders, FloatArray, InitialConditions], ErrorJacobian],
    experiment: IOData,
    orders: Orders,
    theta: FloatArray,
    initial_conditions: InitialConditions,
) -> ErrorJacobian:
    """Jacobian of the record without the trend that explains most of its errors, projected onto the complement of it.

    The errors that a trend causes are those of a record that is nothing else: this holds whatever else is projected.
    """
    without_trend = replace(orders, trend=NO_TREND)
    terms = trend_terms(orders.trend, len(experiment))
    effects = []
    for term in terms.T:
        y = np.where(experiment.known[:, 0], term, np.nan)
        alone = replace(experiment, y=y, u=np.zeros_like(experiment.u))
        effects.append(jacobian(alone, without_trend, theta, initial_conditions).columns[:, -1])
    caused = _without_vanished(np.stack(effects, axis=1))
    errors = jacobian(experiment, without_trend, theta, initial_conditions).columns[:, -1]
    if not caused.any():
        coefficients, basis = np.zeros(terms.shape[1]), np.zeros((len(errors), 0))
    else:
        basis, coefficients = orthonormal(caused, errors)
    levelled = replace(experiment, y=experiment.y[:, 0] - terms @ coefficients)
    result = jacobian(levelled, without_trend, theta, initial_conditions)
    _subtract_projection(basis, result.columns)
    return replace(result, transients=result.transients + basis.shape[1], trend=coefficients)


def _without_vanished(caused: FloatArray) -> FloatArray:
    """The errors (rows, k) that terms of a trend cause; zero where a term shows no more.

    Behind a root at one a constant is the free state of an integrator, and a line is a constant in its input: that one
    causes little, and yet all of a drift.
    """
    sizes = np.sqrt(np.mean(caused**2, axis=0))
    for term, size in enumerate(sizes):
        if size < (VANISHED_CONSTANT if term == 0 else VANISHED):
            caused[:, term] = 0.0
    return caused


def _free_conditions_jacobian(
    y: FloatArray,
    u: FloatArray,
    orders: Orders,
    polynomials: SplitPolynomials,
    start: int,
    response: "FreeResponse",
    roots: FloatArray | None = None,
) -> ErrorJacobian:
    """Errors and Jacobian from `start` on, with the response to free initial conditions and a trend projected out.

    With w_j = B_j/F_j u_j and v = A y - sum_j w_j, the errors are eps = D/C v and their derivatives [Ljung1999, ch. 10]

        d eps / d a_i = D/C y(t - i)        d eps / d b_i = -D/(C F_j) u_j(t - nk - i + 1)
        d eps / d c_i = -1/C eps(t - i)     d eps / d f_i = D/(C F_j) w_j(t - i)
        d eps / d d_i = 1/C v(t - i)

    Filters run over the whole record from rest. The error of that assumption is, from `start` on, a free response of
    1/C or of D/(C F), hence in the span of the transient columns.
    """
    a, b, c, d, f = polynomials
    responses = path_responses(u, b, f)
    # a filter without coefficients would cost as much as any other
    output = _moving_average(a, y) if orders.na else y
    v = output - sum(responses)
    noise_count = max(orders.nc, orders.nd)
    eps = scipy.signal.lfilter(d, c, v)[start:] if noise_count else v[start:].copy()

    corrected = v[start:]
    outputs = [response[start:] for response in responses]
    weighted_eps = eps if roots is None else roots * eps
    basis = None
    trend = np.zeros(orders.trend_terms)
    free = response.columns
    # a trend may vanish behind a root at one
    if response.is_any:
        if roots is None:
            basis, conditions = response.basis.with_coefficients(eps)
        else:
            basis, conditions = orthonormal(free * roots[: len(free), None], weighted_eps)
            # the filters below take the errors themselves
            eps[: len(free)] -= free @ conditions
        _subtract_projection(basis, weighted_eps)
        if orders.trend_terms:
            trend = conditions[response.transients :]
            conditions = conditions[: response.transients]
            of_trend = trend_terms(orders.trend, len(y)) @ trend
            y = y - of_trend
            corrected = corrected - (_moving_average(a, of_trend) if orders.na else of_trend)[start:]
        # w and v with the fitted initial conditions of eps; those of 1/C come first
        for j, transient in _path_transients(f, conditions[noise_count:], len(eps)):
            outputs[j][: len(transient)] += transient
            corrected[: len(transient)] -= transient

    # the initial conditions of the filters below do not matter: they are transients too
    columns = np.empty((len(eps), orders.count + 1), order="F")
    of_a, of_b, of_c, of_d, of_f = orders.ranges
    if orders.na:
        _write_delayed(columns[:, of_a], scipy.signal.lfilter(d, c, y), first=1)
    for j, nk in enumerate(orders.nk):
        filtered = scipy.signal.lfilter(d, np.convolve(c, f[j]), u[:, j])
        _write_delayed(columns[:, of_b[j]], -filtered, first=nk)
    if orders.nc:
        _write_delayed(columns[:, of_c], -scipy.signal.lfilter([1.0], c, eps), first=1)
    if orders.nd:
        _write_delayed(columns[:, of_d], scipy.signal.lfilter([1.0], c, corrected), first=1)
    for j, nf in enumerate(orders.nf):
        if nf:
            filtered = scipy.signal.lfilter(d, np.convolve(c, f[j]), outputs[j])
            _write_delayed(columns[:, of_f[j]], filtered, first=1)
    if roots is not None:
        columns *= roots[:, None]
    if basis is not None:
        _subtract_projection(basis, columns[:, : orders.count])
    columns[:, orders.count] = weighted_eps
    free_conditions = 0 if basis is None else basis.shape[1]
    return ErrorJacobian(columns, len(columns), free_conditions, trend=trend)


def _beside_trend(
    transients: FloatArray, terms: FloatArray, filters: tuple[FloatArray, FloatArray, FloatArray], start: int
) -> FloatArray:
    """Transients with the errors beside them that the terms of a trend (N, k) cause, from `start` on.

    The filters are A, C and D of the errors D/C A y.
    """
    a, c, d = filters
    caused = terms[start:].copy()
    if max(len(a), len(c), len(d)) > 1:
        caused = scipy.signal.lfilter(d, c, scipy.signal.lfilter(a, [1.0], terms, axis=0), axis=0)[start:]
    free = np.zeros((len(caused), transients.shape[1] + terms.shape[1]), order="F")
    free[: len(transients), : transients.shape[1]] = transients
    free[:, transients.shape[1] :] = _without_vanished(caused)
    return free


def path_responses(u: FloatArray, b: Sequence[FloatArray], f: Sequence[FloatArray]) -> list[FloatArray]:
    """Responses B_j/F_j u_j of the paths from each input, from rest (N,) each."""
    responses = []
    for j, (bj, fj) in enumerate(zip(b, f, strict=True)):
        if len(fj) == 1:
            responses.append(_moving_average(bj, u[:, j]))
        else:
            responses.append(scipy.signal.lfilter(bj, fj, u[:, j]))
    return responses


def _moving_average(coefficients: FloatArray, signal: FloatArray) -> FloatArray:
    """Response (N,) of a filter without denominator from rest: the same bits as `lfilter`, in a tenth of its time."""
    return np.convolve(coefficients, signal)[: len(signal)]


def _path_transients(f: Sequence[FloatArray], conditions: FloatArray, rows: int) -> Iterator[tuple[int, FloatArray]]:
    """Free response of 1/F until it has died out of each input whose F has a degree, with the number of the input.

    The initial conditions enter as pulses at the first samples, as many as the degree; those of all inputs stand one
    after the other.
    """
    first = 0
    for j, fj in enumerate(f):
        degree = len(fj) - 1
        if degree:
            pulses = conditions[first : first + degree]
            # followed to the end of a record it would be of denormal numbers, which cost ten times as much
            (transient,) = _pulse_responses([(ONE, fj)], pulses, FIRST_LENGTH, rows, DIED)
            yield j, transient
            first += degree


def _subtract_projection(basis: FloatArray, signals: FloatArray) -> None:
    """Subtract in place from signals (rows,) or (rows, k) their projection onto an orthonormal basis.

    The basis is zero after its last row, which may be far before that of the signals.
    """
    leading = signals[: len(basis)]
    leading -= basis @ (basis.T @ leading)


def _backcast_jacobian(y: FloatArray, u: FloatArray, orders: Orders, theta: FloatArray, start: int) -> ErrorJacobian:
    """Errors and Jacobian from `start` on; the initial disturbance state x costs x' P^-1 x, P its covariance.

    The disturbance filters run from rest at `start`. The state enters as pulses at the first samples, through 1/C. It
    takes part as further errors L^-1 x with L L' = P, in the first rows. Errors and derivatives otherwise as in
    `_free_conditions_jacobian`.
    """
    a, b, c, d, f = orders.split(theta)
    rows, m = len(y) - start, max(orders.nc, orders.nd)
    responses = path_responses(u, b, f)
    v = (scipy.signal.lfilter(a, [1.0], y) - sum(responses))[start:]
    root = _inverse_covariance_root(c, d, m)
    errors = np.concatenate((np.zeros(m), scipy.signal.lfilter(d, c, v)))
    basis, conditions = orthonormal(_backcast_transients(orders, theta, root, rows), errors)
    _subtract_projection(basis, errors)
    for j, transient in _path_transients(f, conditions[m:], rows):
        responses[j][start : start + len(transient)] += transient
        v[: len(transient)] -= transient

    columns = np.zeros((m + rows, orders.count + 1), order="F")
    of_a, of_b, of_c, of_d, of_f = orders.ranges
    if orders.na:
        columns[m:, of_a] = scipy.signal.lfilter(d, c, lagged(y, output_lags(orders.na), start), axis=0)
    for j, (nb, nk) in enumerate(zip(orders.nb, orders.nk, strict=True)):
        inputs = lagged(scipy.signal.lfilter([1.0], f[j], u[:, j]), input_lags(nb, nk), start)
        columns[m:, of_b[j]] = -scipy.signal.lfilter(d, c, inputs, axis=0)
    columns[m:, of_c] = -_delayed_copies(scipy.signal.lfilter([1.0], c, errors[m:]), orders.nc, first=1)
    columns[m:, of_d] = _delayed_copies(scipy.signal.lfilter([1.0], c, v), orders.nd, first=1)
    by_c, by_d = _state_cost_derivatives(c, d, root, conditions[:m])
    columns[:m, of_c], columns[:m, of_d] = by_c, by_d
    for j, nf in enumerate(orders.nf):
        if nf:
            filtered = _delayed_copies(scipy.signal.lfilter([1.0], f[j], responses[j]), nf, first=1)[start:]
            columns[m:, of_f[j]] = scipy.signal.lfilter(d, c, filtered, axis=0)
    _subtract_projection(basis, columns[:, : orders.count])
    columns[:, orders.count] = errors
    return ErrorJacobian(columns, rows, basis.shape[1] - m)


def _backcast_transients(orders: Orders, theta: FloatArray, root: FloatArray, rows: int) -> FloatArray:
    """Errors by a unit of each initial condition (m + rows, m + sum(nf)): disturbance states, then those of 1/F.

    The first m rows are the errors L^-1 x of the disturbance states, L^-1 the `root`; those of 1/F cost nothing.
    """
    _, _, c, d, f = orders.split(theta)
    m = len(root)
    pulse = _unit_pulse(rows)
    of_states = np.vstack((root, _delayed_copies(scipy.signal.lfilter([1.0], c, pulse), m)))
    # a first block without columns stands in where there is no input
    of_paths = [np.zeros((rows, 0))]
    for fj, nf in zip(f, orders.nf, strict=True):
        of_paths.append(_delayed_copies(scipy.signal.lfilter(d, np.convolve(c, fj), pulse), nf))
    free = np.vstack((np.zeros((m, sum(orders.nf))), np.hstack(of_paths)))
    return np.hstack((of_states, free))


def _state_cost_derivatives(
    c: FloatArray, d: FloatArray, root: FloatArray, state: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Derivatives of the errors L^-1 x by the coefficients of C (m, nc) and D (m, nd), at a fixed state x (m,).

    By central differences: the derivative of a Cholesky factor of a Stein equation's solution is no simple formula, and
    the matrices are small.
    """
    m = len(root)
    by_c, by_d = np.empty((m, len(c) - 1)), np.empty((m, len(d) - 1))
    for i in range(len(c) - 1):
        step = STEP * np.eye(1, len(c), i + 1)[0]
        difference = _inverse_covariance_root(c + step, d, m) - _inverse_covariance_root(c - step, d, m)
        by_c[:, i] = -difference @ state / (2.0 * STEP)
    for i in range(len(d) - 1):
        step = STEP * np.eye(1, len(d), i + 1)[0]
        # at the stability limit one side has no stationary covariance; the difference is then one-sided, or zero
        upper = _inverse_covariance_root(c, d + step, m) if is_stable(d + step) else None
        lower = _inverse_covariance_root(c, d - step, m) if is_stable(d - step) else None
        sides = (upper is not None) + (lower is not None)
        upper = root if upper is None else upper
        lower = root if lower is None else lower
        difference = upper - lower
        by_d[:, i] = -difference @ state / (max(sides, 1) * STEP)
    return by_c, by_d


def _inverse_covariance_root(c: FloatArray, d: FloatArray, m: int) -> FloatArray:
    """Inverse of L (m, m), L L' the stationary covariance of the observer-form state of C/D for unit innovations.

    The states obey x+ = A x + K e with -d1, -d2, ... in the first column of A and K = (c1 - d1, c2 - d2, ...).
    """
    A = np.eye(m, k=1)
    A[: len(d) - 1, 0] = -d[1:]
    K = np.zeros((m, 1))
    K[: len(c) - 1, 0] += c[1:]
    K[: len(d) - 1, 0] -= d[1:]
    # rounding moves several roots of D that meet at the unit circle beyond it
    with np.errstate(over="ignore", invalid="ignore"):
        covariance = gramian(A, K @ K.T)
    if not np.isfinite(covariance).all():
        # a state of infinite variance may take any value at no cost
        return np.zeros((m, m))
    floor = max(LEAST_VARIANCE, ROUNDING * float(np.trace(covariance)))
    root = np.linalg.cholesky(0.5 * (covariance + covariance.T) + floor * np.eye(m))
    return np.asarray(scipy.linalg.solve_triangular(root, np.eye(m), lower=True))


def free_transients(orders: Orders, polynomials: SplitPolynomials, rows: int) -> FloatArray:
    """Responses of the errors to free initial conditions, one column each, until they have died out.

    Those of the disturbance are free responses of 1/C, those of an input path of D/(C F).
    """
    _, _, c, d, f = polynomials
    filters, counts = [], []
    if max(orders.nc, orders.nd):
        filters.append((np.ones(1), c))
        counts.append(max(orders.nc, orders.nd))
    for fj, nf in zip(f, orders.nf, strict=True):
        if nf:
            filters.append((d, np.convolve(c, fj)))
            counts.append(nf)
    if not filters:
        return np.zeros((0, 0))
    # a response that is negligible in its last quarter may be delayed by a quarter of its length without loss
    first_length = max(FIRST_LENGTH, 4 * max(counts))
    responses = _pulse_responses(filters, ONE, first_length, rows, NEGLIGIBLE)
    transients = np.empty((len(responses[0]), sum(counts)), order="F")
    first = 0
    for response, count in zip(responses, counts, strict=True):
        _write_delayed(transients[:, first : first + count], response, first=0)
        first += count
    return transients


def _delayed_copies(signal: FloatArray, count: int, first: int = 0) -> FloatArray:
    """Columns of `signal` delayed by first, first + 1, ..., from rest."""
    # columns are contiguous, since they are written one by one
    out = np.empty((len(signal), count), order="F")
    _write_delayed(out, signal, first)
    return out


def _write_delayed(columns: FloatArray, signal: FloatArray, first: int) -> None:
    """Write a signal (N,) delayed by first, first + 1, ..., from rest, into columns (rows, count): its last rows."""
    skipped = len(signal) - len(columns)
    for i in range(columns.shape[1]):
        delay = first + i
        zeros = max(delay - skipped, 0)
        columns[:zeros, i] = 0.0
        columns[zeros:, i] = signal[skipped + zeros - delay : len(signal) - delay]


def _unit_pulse(length: int) -> FloatArray:
    pulse = np.zeros(length)
    pulse[0] = 1.0
    return pulse


def _pulse_responses(
    filters: Sequence[tuple[FloatArray, FloatArray]],
    pulses: FloatArray,
    length: int,
    longest: int,
    negligible: float,
) -> list[FloatArray]:
    """Responses of filters (numerator, denominator) to pulses at the first samples, from rest, until all have died out.

    Args:
        filters: The filters.
        pulses: Inputs at the first samples (k,), k <= longest.
        length: Samples of the first try.
        longest: Most samples.
        negligible: Values of the last quarter, relative to the largest of the response, at which it has died out.
    """
    length = min(max(length, len(pulses)), longest)
    while True:
        signal = np.zeros(length)
        signal[: len(pulses)] = pulses
        responses = [scipy.signal.lfilter(numerator, denominator, signal) for numerator, denominator in filters]
        if length == longest or all(_has_died_out(response, negligible) for response in responses):
            return responses
        length = min(4 * length, longest)


def _has_died_out(response: FloatArray, negligible: float) -> bool:
    """Whether the last quarter of a response is negligible beside its largest value."""
    size = np.abs(response)
    return bool(size[-(len(size) // 4) :].max() <= negligible * size.max())


@dataclass(frozen=True, eq=False)
class OrthonormalBasis:
    """Orthonormal basis of transients, as long as they last; dependent ones (of inputs with equal F) are left out.

    Attributes:
        columns: The basis (rows, k).
        values: Singular values of the transients (k,).
        right: Their right singular vectors (k, transients).
    """

    columns: FloatArray
    values: FloatArray
    right: FloatArray

    @staticmethod
    def of(transients: FloatArray) -> "OrthonormalBasis":
        """Basis of transients (rows, m)."""
        size = np.abs(transients)
        alive = np.flatnonzero(size.max(axis=1) > NEGLIGIBLE * size.max())
        length = int(alive[-1]) + 1
        left, values, right = svd(transients[:length], full_matrices=False)
        kept = values > DEPENDENT_TRANSIENTS * values[0]
        return OrthonormalBasis(left[:, kept], values[kept], right[kept])

    def with_coefficients(self, eps: FloatArray) -> tuple[FloatArray, FloatArray]:
        """The basis, and the coefficients of errors (rows,) in the transients (m,)."""
        return self.columns, self.right.T @ ((self.columns.T @ eps[: len(self.columns)]) / self.values)


def orthonormal(transients: FloatArray, eps: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Orthonormal basis of the transients until they have died out, and the coefficients of eps in them."""
    return OrthonormalBasis.of(transients).with_coefficients(eps)


@dataclass(frozen=True, eq=False)
class FreeResponse:
    """What free initial conditions and a trend cause in the errors of a record.

    Attributes:
        columns: The transients, then the errors that the terms of a trend cause (rows, k), until they have died out.
        transients: Number of transients.
    """

    columns: FloatArray
    transients: int

    @cached_property
    def is_any(self) -> bool:
        """Whether there is any."""
        return bool(self.columns.shape[1] and self.columns.any())

    @cached_property
    def basis(self) -> OrthonormalBasis:
        """Basis of the columns, of which some are not zero."""
        return OrthonormalBasis.of(self.columns)


NO_RESPONSE = FreeResponse(np.zeros((0, 0)), 0)
"""Free response of a record from rest, which has none."""


class FreeResponses:
    """Free responses at one set of parameters, computed once for experiments of one length in a row.

    Those of all lengths would take more memory than the longest experiment.

    Attributes:
        polynomials: The polynomials at these parameters.
    """

    def __init__(self, orders: Orders, theta: FloatArray) -> None:
        self.polynomials = orders.split(theta)
        self._orders = orders
        self._length = (0, 0)
        self._response = NO_RESPONSE

    def of(self, samples: int, start: int) -> FreeResponse:
        """That of an experiment of so many samples whose errors begin at `start`."""
        if self._length != (samples, start):
            self._length, self._response = (samples, start), self._computed(samples, start)
        return self._response

    def _computed(self, samples: int, start: int) -> FreeResponse:
        transients = free_transients(self._orders, self.polynomials, samples - start)
        columns = transients
        if self._orders.trend_terms:
            a, _, c, d, _ = self.polynomials
            columns = _beside_trend(transients, trend_terms(self._orders.trend, samples), (a, c, d), start)
        return FreeResponse(columns, transients.shape[1])


FIRST_RESPONSE = 64  # samples after which most responses have died out
NEGLIGIBLE_RESPONSE = 1e-12  # tail of a response, relative to its largest value
DEPENDENT = 1e-9  # remainder of a transient, relative to it, after the missing outputs are eliminated


def gapped_error_jacobian(
    experiment: IOData, orders: Orders, theta: FloatArray, initial_conditions: InitialConditions
) -> ErrorJacobian:
    """Errors and Jacobian of one single-output experiment, one row per sample; not for backcasting."""
    if orders.trend_terms:
        return _jacobian_beside_trend(gapped_error_jacobian, experiment, orders, theta, initial_conditions)
    a, b, c, d, f = orders.split(theta)
    at_rest = initial_conditions is InitialConditions.ZERO
    known = experiment.known[:, 0]
    y = np.where(known, experiment.y[:, 0], 0.0)
    start = experiment.window if at_rest else orders.first_error(experiment.window)
    rows = len(y) - start
    response = _response_until_negligible(np.convolve(d, a), c, len(y))
    gaps = MissingOutputs.of(known[start:, None], response[:, None, None])

    inputs = sum(path_responses(experiment.u, b, f))
    errors = scipy.signal.lfilter(d, c, scipy.signal.lfilter(a, [1.0], y) - inputs)[start:]
    # outputs that are missing before the first error are free initial conditions; the transients of 1/C cover the
    # earlier ones
    reach = len(response) if at_rest else orders.na
    early = [t for t in range(max(start - reach, 0), start) if not known[t]]
    transients = np.zeros((0, 0)) if at_rest else free_transients(orders, orders.split(theta), rows)
    free = np.zeros((rows, len(early) + transients.shape[1]))
    for i, t in enumerate(early):
        remaining_response = response[start - t :][:rows]
        free[: len(remaining_response), i] = remaining_response
    free[: len(transients), len(early) :] = transients

    # conditional means of the missing outputs, at the initial conditions that fit best
    remainder = gaps.eliminated(np.column_stack((free, errors))[:, None])[:, 0]
    basis, coefficients = _basis_and_coefficients(remainder[:, :-1], free, remainder[:, -1])
    y[early] = -coefficients[: len(early)]
    y[start:][~known[start:]] = -gaps.best((errors - free @ coefficients)[:, None, None])[:, 0]

    filled = replace(experiment, y=y, missing=False)
    columns = gaps.eliminated(error_jacobian(filled, orders, theta, initial_conditions).columns[:, None])[:, 0]
    _subtract_projection(basis, columns)
    slope = _log_determinant_slope(gaps, orders, theta)
    return ErrorJacobian(columns, rows - gaps.count, basis.shape[1], gaps.log_determinant, slope)


def _log_determinant_slope(gaps: MissingOutputs, orders: Orders, theta: FloatArray) -> FloatArray:
    """Derivatives of log det(G'G) of the missing outputs (p,), which does not depend on B and F.

    They follow from those of the response g = D A/C of the errors to an output.
    """
    a, _, c, d, _ = orders.split(theta)
    out = np.zeros(orders.count)
    if len(gaps.response) == 1:
        return out
    pulse = _unit_pulse(len(gaps.response))
    of_a, _, of_c, of_d, _ = orders.ranges
    by_first_coefficients = [
        (of_a, scipy.signal.lfilter(d, c, pulse)),
        (of_c, -scipy.signal.lfilter([1.0], c, gaps.response[:, 0, 0])),
        (of_d, scipy.signal.lfilter(a, c, pulse)),
    ]
    indices, derivatives = [], []
    for positions, derivative in by_first_coefficients:
        for lag, position in enumerate(range(positions.start, positions.stop), start=1):
            indices.append(position)
            # each further coefficient acts one sample later
            derivatives.append(np.concatenate((np.zeros(lag), derivative))[: len(pulse)])
    out[indices] = gaps.slope(np.array(derivatives)[:, :, None, None])
    return out


def _response_until_negligible(numerator: FloatArray, denominator: FloatArray, longest: int) -> FloatArray:
    """Pulse response until it has died out, at most `longest` samples."""
    if len(denominator) == 1 or not denominator[1:].any():
        return numerator[:longest]
    length = min(max(FIRST_RESPONSE, 4 * (len(numerator) + len(denominator))), longest)
    (response,) = _pulse_responses([(numerator, denominator)], ONE, length, longest, NEGLIGIBLE_RESPONSE)
    alive = np.flatnonzero(np.abs(response) > NEGLIGIBLE_RESPONSE * np.abs(response).max())
    return response[: alive[-1] + 1]


def _basis_and_coefficients(
    remainder: FloatArray, free: FloatArray, errors: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Orthonormal basis of free columns, and the coefficients of the errors in these columns.

    The `remainder` is that of the free columns after the missing outputs are eliminated, the errors' likewise.
    """
    if not free.shape[1]:
        return remainder, np.zeros(0)
    lengths = np.sqrt(np.einsum("ij,ij->j", free, free))
    lengths[lengths == 0.0] = 1.0
    vectors, values, right = svd(remainder / lengths, full_matrices=False)
    kept = values > DEPENDENT
    basis = vectors[:, kept]
    return basis, (right[kept].T @ ((basis.T @ errors) / values[kept])) / lengths
