"""State recursions over whole records, and the Kalman filter over missing output samples."""

import numpy as np
import scipy

from sysid.models.block_response import block_output
from sysid.models.companion_form import CompanionForm
from sysid.models.state_space import StateSpace
from sysid.records.arrays import FloatArray
from sysid.records.data import IOData

LARGEST_TRAJECTORY = 4_000_000  # states times samples that are kept at a time, some 200 MB
LARGEST = 1e100  # largest response that is still used in a least-squares problem


def driven_states(A: FloatArray, B: FloatArray, u: FloatArray, x0: FloatArray) -> FloatArray:
    """Return x(0), ..., x(N-1), (N, n), of x(t+1) = A x(t) + B u(t) from x0 (n,), for u (N, nu)."""
    form = CompanionForm.of(A)
    if form is None:
        return state_trajectory(A, u @ B.T, x0)
    with np.errstate(over="ignore", invalid="ignore"):
        return form.states(B, u, x0)


def driven_output(
    A: FloatArray, B: FloatArray, C: FloatArray, D: FloatArray, u: FloatArray, x0: FloatArray
) -> FloatArray:
    """Return y (N, ny) of x(t+1) = A x(t) + B u(t), y = C x + D u from x0 (n,), for u (N, nu)."""
    form = CompanionForm.of(A)
    if form is None or not form.passes_on(C):
        return output_by_blocks(A, B, C, D, u, x0)
    with np.errstate(over="ignore", invalid="ignore"):
        first_states = form.first_states(B, u, x0)
        out = u @ D.T
        for start, signal in first_states.items():
            for i in np.flatnonzero(C[:, start]):
                # a state that overflows reaches only the outputs that it is part of
                out[:, i] += C[i, start] * signal
    return out


def output_by_blocks(
    A: FloatArray, B: FloatArray, C: FloatArray, D: FloatArray, u: FloatArray, x0: FloatArray
) -> FloatArray:
    """`driven_output` of any matrix: by products where they keep the digits, else by filters of some samples."""
    products = block_output(A, B, C, D, u, x0)
    if products is not None:
        return products
    length = max(LARGEST_TRAJECTORY // max(len(A), 1), 1)
    out = np.empty((len(u), len(C)))
    state = x0
    for begin in range(0, len(u), length):
        inputs = u[begin : begin + length]
        states = state_trajectory(A, inputs @ B.T, state)
        out[begin : begin + length] = states @ C.T + inputs @ D.T
        state = A @ states[-1] + B @ inputs[-1]
    return out


def state_trajectory(A: FloatArray, w: FloatArray, x0: FloatArray) -> FloatArray:
    """Return x(0), ..., x(N-1), (N, n), of x(t+1) = A x(t) + w(t) from x0 (n,), for w (N, n).

    A unitary (Schur) change of basis makes A triangular; each state is then one first-order filter, fed by the states
    below it. This is as accurate as the plain recursion and two orders of magnitude faster than a Python loop.
    """
    steps, n = w.shape
    if n == 0:
        return np.zeros((steps, 0))
    triangle, basis = scipy.linalg.schur(A, output="complex")
    drive = w @ basis.conj()
    z = np.zeros((n, steps), dtype=complex)
    start = basis.conj().T @ x0
    # an unstable model may overflow to infinity: that is its response, not a fault
    with np.errstate(over="ignore", invalid="ignore"):
        for i in range(n - 1, -1, -1):
            forced = drive[:, i] + triangle[i, i + 1 :] @ z[i + 1 :]
            # the input at t-1 drives the state at t
            entering = np.concatenate(([start[i]], forced[:-1]))
            z[i] = scipy.signal.lfilter([1.0], [1.0, -triangle[i, i]], entering)
        return np.ascontiguousarray((basis @ z).real.T)


def free_response(A: FloatArray, C: FloatArray, steps: int) -> FloatArray:
    """Return C A^t for t = 0, 1, ... until it has died out, at most `steps` rows, (rows, ny, n).

    Omitted rows are zero to rounding, or (for an unstable A) too large to compute with. Those of a companion form are
    filtered, of any other matrix formed by powers.
    """
    form = CompanionForm.of(A)
    filtered = form is not None and form.passes_on(C)
    rows = form.free_response(C, steps) if form is not None and filtered else _response_by_powers(A, C, steps)
    usable = (np.abs(rows) < LARGEST).all(axis=(1, 2))
    usable_rows = len(rows) if usable.all() else int(np.argmin(usable))
    return rows[: min(steps, usable_rows)]


def _response_by_powers(A: FloatArray, C: FloatArray, steps: int) -> FloatArray:
    """C A^t for t = 0, 1, ..., at least until it has died out or overflows; powers are formed by doubling."""
    rows = C[None]
    power = A
    scale = np.abs(C).max() if C.size else 0.0
    with np.errstate(over="ignore", invalid="ignore"):
        while len(rows) < steps:
            # one product of large matrices instead of one for each row
            following = (rows.reshape(len(rows) * len(C), len(A)) @ power).reshape(rows.shape)
            rows = np.concatenate((rows, following))
            power = power @ power
            if not np.isfinite(power).all() or np.abs(following).max(initial=0.0) <= 1e-17 * scale:
                break
    return rows


SEGMENTS = 128  # segments of a record that are filtered side by side, as one vectorised loop
WARM_UP = 32  # samples before each part for the state covariance to converge from its initial value
SETTLED = 1e-12  # relative difference of covariances that counts as converged


def kalman_filter(
    model: StateSpace, data: IOData, x0: FloatArray, *, free: bool = False
) -> tuple[FloatArray, FloatArray]:
    """Run the predictor over a record with gaps, from state x0 (n,) [Ljung1999, sec. 14.2].

    In x+ = A x + B u + K e, y = C x + D u + e with e white of covariance R, the state is known exactly as long as no
    output is missing. At a gap its covariance grows by K R K'; the gains of the known outputs follow from it. Only the
    ratios in R matter; if the model has none, R is the diagonal matrix of the outputs' variances.

    Returns:
        States x(t) from outputs up to t - 1, driven from x0 (N, n, 1), with `free` also the free responses to unit
        initial states in further columns (N, n, 1 + n); and the inverse square root of the prediction variance of each
        output (N, ny), zero where it is missing.
    """
    R = model.innovation_covariance
    if R is None:
        R = np.diag(output_deviations(data.y) ** 2)
    start = x0[:, None]
    if free:
        start = np.concatenate((np.asarray(x0, dtype=float)[:, None], np.eye(model.order)), axis=1)
    y = np.where(data.known, data.y, 0.0)
    # an unstable model may overflow to infinity in a gap: that is its response, not a fault
    with np.errstate(over="ignore", invalid="ignore"):
        gains, inverse_deviations = _gains(model, data.known, R)
        drive = data.u @ model.B.T + np.einsum("tnl,tl->tn", gains, y - data.u @ model.D.T)
        return _trajectory(model.A - gains @ model.C, drive, start), inverse_deviations


def output_deviations(y: FloatArray) -> FloatArray:
    """Standard deviation of every output's known samples (ny,), one for an output that does not change."""
    deviations = np.ones(y.shape[1])
    for i, column in enumerate(y.T):
        samples = column[~np.isnan(column)]
        deviation = float(np.std(samples)) if len(samples) else 0.0
        if deviation > 0.0:
            deviations[i] = deviation
    return deviations


def _gains(model: StateSpace, observed: np.ndarray, R: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Gain (N, n, ny) and inverse deviation of the prediction (N, ny) at every sample, zero at missing outputs.

    The state covariance converges from any initial value, so that segments of the record can be filtered side by
    side, each with a warm-up; the warm-up is extended until every segment begins with the final covariance of the one
    before.
    """
    steps, ny = observed.shape
    R = R / np.trace(R) if np.trace(R) > 0.0 else np.eye(ny) / ny
    # innovations of unit variance: whatever the units of the outputs, the same directions count as noise-free
    units = np.sqrt(np.where(np.diag(R) > 0.0, np.diag(R), 1.0))
    scaled = (model.A, model.C / units[:, None], model.gain * units, R / np.outer(units, units))
    warm_up = WARM_UP
    while True:
        length = max(-(-steps // SEGMENTS), warm_up)
        segments = -(-steps // length)
        # nothing is missing before and after the record: there the covariance stays zero
        padded = np.ones((warm_up + segments * length, ny), dtype=bool)
        padded[warm_up : warm_up + steps] = observed
        gains, deviations, initial, final = _filter_segments(scaled, padded, warm_up, length)
        if segments == 1 or np.abs(initial[1:] - final[:-1]).max() <= SETTLED * (1.0 + np.abs(final).max()):
            break
        warm_up *= 4
    samples = segments * length
    return gains.reshape(samples, -1, ny)[:steps] / units, deviations.reshape(samples, ny)[:steps] / units


def _filter_segments(
    scaled: tuple[FloatArray, FloatArray, FloatArray, FloatArray], observed: np.ndarray, warm_up: int, length: int
) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """Run the Riccati recursion side by side over segments of a record, each after a warm-up from covariance zero.

    Args:
        scaled: A, C, K and R of the model, its innovations of about unit variance.
        observed: Mask of the known outputs, `warm_up` samples before the record included (warm_up + segments * length,
            ny).
        warm_up: Samples before each segment.
        length: Samples of a segment.

    Returns:
        Gains (segments, length, n, ny) and inverse deviations of the prediction (segments, length, ny), zero at missing
        outputs; covariance of the state at the begin and at the end of each segment (segments, n, n).
    """
    A, C, K, R = scaled
    n, ny = K.shape
    noise, cross = K @ R @ K.T, K @ R
    segments = (len(observed) - warm_up) // length
    P = np.zeros((segments, n, n))
    gains, deviations = np.empty((segments, length, n, ny)), np.empty((segments, length, ny))
    initial = P
    for t in range(-warm_up, length):
        if t == 0:
            initial = P
        mask = observed[warm_up + t :: length][:segments].astype(float)
        PC = P @ C.T
        S = mask[:, :, None] * (C @ PC + R) * mask[:, None, :]
        across = (A @ PC + cross) * mask[:, None, :]
        variances = np.diagonal(S, axis1=1, axis2=2)
        if ny == 1:
            # the floor keeps a missing output, of variance zero here, from dividing zero by zero
            L = across * (mask / np.maximum(S[:, 0], 1e-300))[:, None]
        else:
            L = np.matmul(across, np.linalg.pinv(S, hermitian=True))
        P = A @ P @ A.T + noise - np.matmul(L, across.transpose(0, 2, 1))
        # rounding would let the two halves drift apart
        P = 0.5 * (P + P.transpose(0, 2, 1))
        if t >= 0:
            gains[:, t] = L
            deviations[:, t] = mask / np.sqrt(np.maximum(variances, 1e-300))
    return gains, deviations, initial, P


def _trajectory(transitions: FloatArray, drive: FloatArray, start: FloatArray) -> FloatArray:
    """States of x+ = F(t) x + w(t), w acting on the first column alone, (N, n, columns)."""
    steps, n = drive.shape
    length = -(-steps // SEGMENTS)
    segments = -(-steps // length)
    F, w = np.zeros((segments * length, n, n)), np.zeros((segments * length, n))
    F[:steps], w[:steps] = transitions, drive
    F, w = F.reshape(segments, length, n, n), w.reshape(segments, length, n)
    # each segment from rest and from unit states first; then the segments are chained
    x = np.zeros((segments, n, 1 + n))
    x[:, :, 1:] = np.eye(n)
    inside = np.empty((length, segments, n, 1 + n))
    for t in range(length):
        inside[t] = x
        x = np.matmul(F[:, t], x)
        x[:, :, 0] += w[:, t]
    begin = np.empty((segments, n, start.shape[1]))
    state = start
    for k in range(segments):
        begin[k] = state
        state = x[k, :, 1:] @ state
        state[:, 0] += x[k, :, 0]
    out = np.matmul(inside[..., 1:], begin)
    out[..., 0] += inside[..., 0]
    return np.ascontiguousarray(out.transpose(1, 0, 2, 3).reshape(segments * length, n, -1)[:steps])
