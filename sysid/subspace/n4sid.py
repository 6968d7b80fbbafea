"""Subspace identification: states from the past of the data."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Literal, get_args

import numpy as np
import scipy

from sysid.models.estimate import Estimate
from sysid.polynomial.data_checks import check_excitation, check_means
from sysid.polynomial.gram_matrices import hankel_moments, hankel_triangle
from sysid.polynomial.stability_limit import STABILITY_MARGIN
from sysid.records.arguments import one_of, truth_value, whole_number
from sysid.records.arrays import FloatArray
from sysid.records.data import IOData, as_experiments
from sysid.records.errors import Message, SysidError, warn_each
from sysid.records.singular_values import svd
from sysid.subspace.gaps import estimate_with_gaps
from sysid.subspace.input_delays import input_delays, with_input_delays
from sysid.subspace.predictor import Predictor, Record, Scales, input_coordinates, local_coordinates
from sysid.subspace.predictor_errors import Point
from sysid.subspace.predictor_estimate import check_enough_samples, check_gain, make_predictor_estimate
from sysid.subspace.predictor_fit import least_squares_fit, pulled_in

Weighting = Literal["cva", "moesp"]

SINGULAR = 1e-10  # power in a direction of the future, relative to the largest, below which it gets no weight
NOTHING = 1e-24  # the same, relative to all channels, below which the outputs count as zero
RANK = 1e-8  # canonical correlation, relative to the largest, below which a state does not exist


@dataclass(frozen=True, eq=False)
class Subspace:
    """Result of the subspace step.

    Attributes:
        A: State matrix (n, n).
        B: Input matrix from the regression of states (n, nu), an initial value only.
        C: Output matrix (ny, n).
        D: Direct term (ny, nu), likewise.
        noise: Covariance of process and measurement noise (n + ny, n + ny), up to a factor.
        total: Covariance of next state and output (n + ny, n + ny), up to the same factor.
        canonical_correlations: Between past and future, largest first; of MOESP singular values.
        block_rows: Samples of past, and of future.
    """

    A: FloatArray
    B: FloatArray
    C: FloatArray
    D: FloatArray
    noise: FloatArray
    total: FloatArray
    canonical_correlations: FloatArray
    block_rows: int

    def gain(self) -> FloatArray:
        """Innovation gain with A - K C stable; zero if the data have no disturbance (n, ny)."""
        return kalman_gain(self.A, self.C, self.noise, self.total)

    def simulator(self) -> Predictor:
        """The model without innovation gain."""
        return Predictor(self.A, self.B, self.C, self.D)


def subspace(
    signals: Sequence[FloatArray], nu: int, order: int, block_rows: int, *, direct: bool, weighting: Weighting = "cva"
) -> Subspace:
    """Regress the future on the past with the future input projected out [VanOverschee1996; Larimore1990].

    With Uf the future inputs, P the past and Yf the future outputs, the triangle of [Uf; P; Yf] contains the part of Yf
    that the past explains. Divided by the root of Yf given Uf, its singular values are canonical correlations, and its
    first left singular vectors give the observability matrix. MOESP does not divide: its singular values are in units
    of the outputs.

    Args:
        signals: [u, y] per experiment (N, nu + ny), channels of about unit size.
        nu: Number of inputs.
        order: Number of states.
        block_rows: Samples of past, and of future.
        direct: Whether D is estimated; otherwise it is zero.
        weighting: Of the future outputs: "cva" or "moesp".

    Raises:
        SysidError: Order not between 1 and (block_rows - 1) * ny, or outputs that are zero.
    """
    q = signals[0].shape[1]
    ny, s = q - nu, block_rows
    if not 1 <= order <= (s - 1) * ny:
        raise SysidError(
            f"order must be a whole number from 1 to (block_rows - 1) * ny = {(s - 1) * ny}, got {order!r}"
        )
    index = np.arange(2 * s * q).reshape(2 * s, q)
    past, future_inputs, future_outputs = index[:s].ravel(), index[s:, :nu].ravel(), index[s:, nu:].ravel()
    moments = hankel_moments(signals, 2 * s)
    triangle = hankel_triangle(signals, 2 * s, moments, np.concatenate((future_inputs, past, future_outputs)))
    past_begin = len(future_inputs)
    past_end = past_begin + len(past)
    past_triangle = triangle[past_begin:past_end, past_begin:past_end]
    explained = triangle[past_end:, past_begin:past_end]
    residual = triangle[past_end:, past_end:]
    given_inputs = explained @ explained.T + residual @ residual.T
    values, vectors = np.linalg.eigh(given_inputs)
    if not values[-1] > NOTHING * float(np.trace(moments)):
        raise SysidError(
            "the outputs are zero, or nearly so, given the past of the record: there are no states to identify"
        )
    root = np.ones(len(values))
    if weighting == "cva":
        root = np.sqrt(np.maximum(values, SINGULAR * values[-1]))
    # the smaller, symmetric eigenproblem would lose half of the digits of the singular values
    left, correlations, right = svd((vectors / root).T @ explained, full_matrices=False)
    rank = int((correlations > RANK * correlations[0]).sum())
    n = max(min(order, rank), 1)
    observability = (vectors * root) @ (left[:, :n] * np.sqrt(correlations[:n]))
    A = np.linalg.lstsq(observability[:-ny], observability[ny:], rcond=None)[0]
    C = observability[:ny]
    to_state = np.sqrt(correlations[:n])[:, None] * (right[:n] @ _inverse(past_triangle))
    B, D, noise, total = _regression(moments, index, nu, s, to_state)
    if not direct:
        D = np.zeros_like(D)
    return Subspace(A, B, C, D, noise, total, correlations, s)


def _inverse(lower: FloatArray) -> FloatArray:
    """Inverse of a lower triangle; the pseudo-inverse if it is nearly singular, as after a poor excitation."""
    size = np.abs(np.diag(lower))
    if size.min(initial=1.0) > SINGULAR * size.max(initial=1.0):
        return np.asarray(scipy.linalg.solve_triangular(lower, np.eye(len(lower)), lower=True))
    return np.asarray(np.linalg.pinv(lower, rcond=SINGULAR), dtype=np.float64)


def _regression(
    moments: FloatArray, index: FloatArray, nu: int, s: int, to_state: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """B, D and the covariances of noise and target in the regression of next state and output on state and input.

    States are `to_state` times the past, so that all sums over time are moments already computed; `index` holds the
    position of every channel at every lag among them.
    """
    n, past, next_past = len(to_state), index[:s].ravel(), index[1 : s + 1].ravel()
    present_input, present_output = index[s, :nu], index[s, nu:]

    def moment(rows: FloatArray, columns: FloatArray) -> FloatArray:
        return moments[np.ix_(rows, columns)]

    state_by_input = to_state @ moment(past, present_input)
    regressors = np.block(
        [
            [to_state @ moment(past, past) @ to_state.T, state_by_input],
            [state_by_input.T, moment(present_input, present_input)],
        ]
    )
    cross = np.block(
        [
            [to_state @ moment(past, next_past) @ to_state.T, to_state @ moment(past, present_output)],
            [moment(present_input, next_past) @ to_state.T, moment(present_input, present_output)],
        ]
    )
    solution = np.linalg.lstsq(regressors, cross, rcond=1e-13)[0].T
    target = np.block(
        [
            [to_state @ moment(next_past, next_past) @ to_state.T, to_state @ moment(next_past, present_output)],
            [moment(present_output, next_past) @ to_state.T, moment(present_output, present_output)],
        ]
    )
    noise = target - solution @ cross - cross.T @ solution.T + solution @ regressors @ solution.T
    return solution[:n, n:], solution[n:, n:], noise, target


def kalman_gain(A: FloatArray, C: FloatArray, noise: FloatArray, total: FloatArray) -> FloatArray:
    """Gain of the stationary Kalman filter (n, ny); zero if there is no noise and A is stable.

    `noise` and `total` are covariances of process and measurement noise, and of next state and output (n + ny, n + ny),
    up to a common factor.
    """
    n, ny = len(A), len(C)
    size = float(np.trace(total[n:, n:]))
    if not size > 0.0:
        return np.zeros((n, ny))
    # a noise of 1e-9 of the output is rounding
    noise_free = float(np.trace(noise[n:, n:])) <= 1e-18 * size
    if noise_free and np.abs(np.linalg.eigvals(A)).max() < 1.0:
        return np.zeros((n, ny))
    values, vectors = np.linalg.eigh(0.5 * (noise + noise.T) / size)
    # without noise any gain that makes the predictor of an unstable A stable serves: that for unit noise
    floor = 1e-14 if not noise_free else 1.0
    positive = (vectors * np.maximum(values, floor)) @ vectors.T
    positive = 0.5 * (positive + positive.T)
    Q, R, S = positive[:n, :n], positive[n:, n:], positive[:n, n:]
    try:
        P = scipy.linalg.solve_discrete_are(A.T, C.T, Q, R, s=S)
        innovation = C @ P @ C.T + R
        K = np.linalg.solve(innovation.T, (A @ P @ C.T + S).T).T
    except (np.linalg.LinAlgError, ValueError):
        return np.zeros((n, ny))
    return np.asarray(K) if np.isfinite(K).all() else np.zeros((n, ny))


LARGEST_ORDER = 60  # the n^2 local coordinates cost n^6: some ten seconds at this order
HORIZON = 0.25  # of the slowest time constant; a longer one is worse where the noise shares the slow pole
GROWTH = 3.0  # of the horizon for slow data, relative to the default: more only adds noise to records of few samples
WORTHWHILE = 1.5  # growth, relative to the default, below which accuracy hardly changes
SHARE = 0.4  # of the longest possible horizon, beyond which a longer one loses more to noise than it gains
LARGEST_TRIANGLE = 1000  # rows of the triangle up to which the horizon grows: a second of processor time
LONGER = (1.5, 2.0, 3.0)  # horizons that may give a stable model, relative to the one that does not
DISTANCES = 8  # trial time constants of unstable poles that are moved


def n4sid(
    data: IOData | Sequence[IOData],
    order: int,
    *,
    nk: int | Sequence[int] = 0,
    block_rows: int | None = None,
    direct: bool = True,
    gain: bool = True,
    stable: bool = False,
    weighting: Weighting = "cva",
) -> Estimate:
    """Identify a state-space model by subspaces [VanOverschee1996; Larimore1990].

    A and C from the shift of the observability matrix; B, D and the initial states by least squares on the simulated
    output, given A and C; K from the residual covariance of the regression of the states. There is no search, hence no
    local minimum; the estimate is consistent, not efficient: `pem_ss` refines it. Under feedback it is biased, and
    `pbsid` is not.

    Args:
        data: One experiment, or several that share the model; any numbers of inputs (none: a time series) and outputs.
            Missing outputs are filled by their conditional means under the model, in several rounds.
        order: Number of states, 60 at most; those of delays come on top.
        nk: Known delay of all inputs, or of each, in samples, MATLAB's InputDelay: y(t) depends on u(t - nk) and
            earlier inputs, with `direct=False` on those before. The inputs are shifted before the estimation, and the
            model has the delays as further states. The inputs before a record are not known: of each experiment the
            first max(nk) samples serve as the past alone, and have no residual (NaN).
        block_rows: Samples of past, and of future; by default 2.5 times the order, at least 10. If the model of this
            horizon is slow, a quarter of its slowest time constant, up to three times as many. Short data allow fewer.
        direct: Whether D is estimated; otherwise it is zero. Beside feedback without delay, D would be that of the
            controller: pass False.
        gain: Whether K is estimated; otherwise it is zero.
        stable: Whether to enforce a stable A: of models from longer horizons, unless `block_rows` is set, and of models
            of which only the unstable poles were moved, the one with the best simulated fit.
        weighting: "cva" (canonical variates) relates the future outputs to what the past leaves of them, and is best
            where the order suffices; "moesp" keeps the states of the largest power, which may suit lower orders.

    Returns:
        The estimate. `parameters` are local coordinates; their covariance and all intervals are NaN (unknown).
        Diagnostics: `canonical_correlations` ("moesp": singular values), `block_rows`, `moved_poles` (moduli before
        the move).

    Raises:
        SysidError: Constant input, an order that block rows or data do not allow, delays that do not fit.

    Warns:
        SysidWarning: Poor excitation, means that do not fit the dynamics, an order beyond the rank of the data, an
            unstable model.
    """
    experiments = as_experiments(data, missing=True, series=True)

    def fit(records: Sequence[IOData], gain: bool) -> Estimate:
        return n4sid(
            records, order, block_rows=block_rows, direct=direct, gain=gain, stable=stable, weighting=weighting
        )

    delays = input_delays(nk, experiments)
    if any(delays):
        return with_input_delays(partial(fit, gain=gain), experiments, delays)
    nu, ny = experiments[0].nu, experiments[0].ny
    order = whole_number("order", order, 1, LARGEST_ORDER)
    if not all(e.complete for e in experiments):
        # of outputs that are missing none counts: filled ones tell nothing
        check_enough_samples(experiments, order, _largest_count(experiments[0], order))
        return estimate_with_gaps(fit, experiments, truth_value("gain", gain))
    direct, gain, stable = truth_value("direct", direct), truth_value("gain", gain), truth_value("stable", stable)
    one_of("weighting", weighting, get_args(Weighting))
    check_gain(nu, gain)
    fewest, longest = _block_row_limits(experiments, order)
    default = min(max(10, -(-5 * order // 2)), longest)
    s = whole_number("block_rows", default if block_rows is None else block_rows, fewest, longest)
    excitation = check_excitation(experiments, [2 * int(s)] * nu)
    scales = Scales.of(experiments)
    records = [Record.of(e, scales, gain=True) for e in experiments]
    estimate = partial(subspace, [r.w for r in records], nu, int(order), direct=direct, weighting=weighting)
    step = estimate(int(s))
    quick = LARGEST_TRIANGLE // (2 * (nu + ny))
    if block_rows is None:
        slow = min(_slow_horizon(step), int(SHARE * longest), quick)
        # an input that does not excite the longer horizon makes it worse
        if slow >= WORTHWHILE * s and check_excitation(experiments, [2 * slow] * nu) == excitation:
            step = estimate(slow)
    messages = excitation + check_means(experiments, -(-order // ny))
    if len(step.A) < order:
        messages.append(
            f"past and future of the data have {len(step.A)} nonzero canonical correlations: the model has that order "
            f"instead of {order}"
        )
    observer: Predictor | None = None
    if not (stable or step.simulator().is_stable()):
        observer, message = _observer_of_unstable(step)
        messages.append(message)
    moved: tuple[float, ...] = ()
    if observer is not None:
        fitted = least_squares_fit(records, observer, partial(input_coordinates, direct=direct))
        predictor = fitted if gain else _without_gain(step, fitted)
    else:
        horizons = [int(factor * step.block_rows) for factor in LONGER] if block_rows is None else []
        longer = map(estimate, [rows for rows in horizons if rows <= min(longest, quick)])
        simulated = [Record.of(e, scales, gain=False) for e in experiments]
        step, fitted, moved = _best_stable(step, longer, simulated, direct)
        predictor = _with_gain(fitted, step.gain(), messages) if gain else fitted
    warn_each(messages)
    return _make_estimate(experiments, int(order), scales, step, predictor, direct, moved, messages)


def _largest_count(first: IOData, order: int) -> int:
    """Number of parameters of a model with gain and direct term."""
    return order * (first.nu + 2 * first.ny) + first.nu * first.ny


def _block_row_limits(experiments: Sequence[IOData], order: int) -> tuple[int, int]:
    """Fewest block rows that the order needs, and the largest number that the data allow."""
    nu, ny = experiments[0].nu, experiments[0].ny
    samples = check_enough_samples(experiments, order, _largest_count(experiments[0], order))
    shortest = min(len(e) - e.window for e in experiments)
    # the triangle has 2 s (nu + ny) rows, and needs as many columns
    columns = samples + len(experiments)
    longest = min(columns // (2 * (nu + ny) + 2 * len(experiments)), shortest // 2)
    # the observability matrix is shifted by a block row
    fewest = max(-(-order // ny) + 1, 2)
    if fewest > longest:
        raise SysidError(
            f"too few samples for order {order}: {samples} in {len(experiments)} experiment(s) allow {longest} block "
            f"row(s), {ny} output(s) need {fewest}"
        )
    return fewest, longest


def _observer_of_unstable(step: Subspace) -> tuple[Predictor | None, str]:
    """The stable predictor by which an unstable model is fitted, and a warning; None if it is unstable too."""
    radius = float(np.abs(np.linalg.eigvals(step.A)).max())
    A, K = step.A - step.gain() @ step.C, step.gain()
    observer = Predictor(A, np.hstack((step.B - K @ step.D, K)), step.C, step.D)
    if observer.is_stable():
        advice = "; stable=True enforces a stable one"
        text = f"the model is unstable: largest pole modulus {radius:.6g}{advice}"
        return observer, Message(text, "unstable-model", stable=advice)
    message = (
        f"neither a stable model (largest pole modulus {radius:.6g}) nor a stable predictor exists: A was "
        "made stable, at the expense of fit; try another order or block_rows"
    )
    return None, message


def _without_gain(step: Subspace, observer: Predictor) -> Predictor:
    """The simulator of a fitted observer, whose M is [B - K D, K]."""
    B = observer.M[:, : observer.D.shape[1]] + step.gain() @ observer.D
    return Predictor(step.A, B, step.C, observer.D)


def _make_estimate(
    experiments: Sequence[IOData],
    order: int,
    scales: Scales,
    step: Subspace,
    predictor: Predictor,
    direct: bool,
    moved: tuple[float, ...],
    messages: Sequence[str],
) -> Estimate:
    """Assemble the estimate; a subspace method gives no covariance of its parameters."""
    basis = local_coordinates(predictor, direct)
    return make_predictor_estimate(
        "n4sid",
        experiments,
        {"order": order, "block_rows": step.block_rows},
        scales,
        predictor=predictor,
        basis=basis,
        covariance=np.full((basis.shape[1],) * 2, np.nan),
        diagnostics={
            "iterations": 0,
            "converged": True,
            "canonical_correlations": step.canonical_correlations,
            "block_rows": step.block_rows,
            "moved_poles": moved,
        },
        messages=messages,
    )


def _slow_horizon(step: Subspace) -> int:
    """Horizon for the slowest pole: a quarter of its time constant, at most GROWTH times the present horizon.

    Of a pair of complex poles the natural frequency counts, whatever the damping: fast modes fit into any horizon.
    """
    poles = np.linalg.eigvals(step.A).astype(complex)
    # a pole at zero, a delay, is infinitely fast
    rates = np.abs(np.log(np.where(poles == 0.0, np.finfo(float).tiny, poles)))
    slowest = float(rates.min())
    return int(min(HORIZON / max(slowest, np.finfo(float).tiny), GROWTH * step.block_rows))


def _best_stable(
    step: Subspace, longer: Iterable[Subspace], records: Sequence[Record], direct: bool
) -> tuple[Subspace, Predictor, tuple[float, ...]]:
    """The subspace step with B and D fitted to the simulated output, made stable if it is not.

    The step, the fitted model, and the moduli of the poles that were moved. Candidates are stable models of longer
    horizons, and the model with its unstable poles moved to moduli that give them time constants from the horizon to
    ten times the record; that with the best simulated fit is taken.
    """
    directions, model = partial(input_coordinates, direct=direct), step.simulator()
    if model.is_stable():
        return step, least_squares_fit(records, model, directions), ()
    samples, bound = max(len(r.y) for r in records), 1.0 - STABILITY_MARGIN
    moduli = np.abs(np.linalg.eigvals(step.A))
    unstable_moduli = tuple(moduli[moduli > bound].tolist())
    candidates: list[tuple[Subspace, tuple[float, ...]]] = [(candidate, ()) for candidate in longer]
    for limit in np.exp(-1.0 / np.geomspace(step.block_rows, 10.0 * samples, DISTANCES)):
        pulled = replace(step, A=pulled_in(model, limit, bound).A)
        candidates.append((pulled, unstable_moduli))
    candidates = [candidate for candidate in candidates if candidate[0].simulator().is_stable()]
    if not candidates:
        raise SysidError("neither a stable model nor a stable predictor exists; try another order or block_rows")
    fits = [least_squares_fit(records, candidate.simulator(), directions) for candidate, _ in candidates]
    criteria = [Point.at(records, fit.balanced(), np.eye(len(fit.C))).criterion for fit in fits]
    best = int(np.argmin(criteria))
    best_step, moved = candidates[best]
    return best_step, fits[best], moved


def _with_gain(simulator: Predictor, K: FloatArray, messages: list[str]) -> Predictor:
    """Add the innovation gain to a model without one; K = 0 if the predictor would not be stable."""
    A, B, C, D = simulator.A, simulator.M, simulator.C, simulator.D
    observer = Predictor(A - K @ C, np.hstack((B - K @ D, K)), C, D)
    if observer.is_stable():
        return observer
    messages.append("no stable innovation gain exists: K = 0")
    return Predictor(A, np.hstack((B, np.zeros_like(K))), C, D)
