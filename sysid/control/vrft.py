"""Virtual reference feedback tuning: a model-following controller from one record, without a model of the plant."""

from dataclasses import dataclass

import numpy as np
import scipy

from sysid.control.controller import Controller, check_model
from sysid.models.state_space import StateSpace
from sysid.polynomial.least_squares import solve
from sysid.polynomial.orthonormal_basis import all_pass
from sysid.records.arguments import real_number, whole_number
from sysid.records.arrays import FloatArray, Locked
from sysid.records.data import IOData, as_record
from sysid.records.errors import SysidError

SETTLING = 10
"""Part of the record, one over it, in which filters settle and which enters no regression."""

SLOWEST, FASTEST, TRIED = 1e-4, 0.1, 100
"""Corner frequencies of the feedback, times the sampling interval, and how many are tried: 7 % apart."""

PREMATURE = 0.5
"""Largest part of a reference's step response that may come before the plant can answer."""

UNEXPLAINED = 0.5
"""Largest part of a command that the inverse may leave unexplained, rms."""


@dataclass(frozen=True, eq=False)
class VirtualReferenceDesign(Locked):
    """Design of a controller by virtual reference feedback tuning.

    Attributes:
        controller: The controller.
        feedforward: Coefficients of the inverse from wanted outputs to commands (m, m, terms): command, output, term.
        feedback: Those of the inverse in the feedback, likewise.
        corner: Corner frequency of the complementary sensitivity that is wanted, Hz.
        sensitivity: Largest singular value over frequency of the sensitivity at the plant's input, from the record.
        unexplained: Part of each command of the record that the inverse leaves unexplained (m,), rms.
    """

    controller: Controller
    feedforward: FloatArray
    feedback: FloatArray
    corner: float
    sensitivity: float
    unexplained: FloatArray


def vrft(
    data: IOData,
    reference: StateSpace,
    *,
    delay: int = 2,
    terms: int = 8,
    pole: float = 0.5,
    sensitivity: float = 2.0,
    corner: float | None = None,
    correction: float = 0.85,
    instruments: int = 24,
) -> VirtualReferenceDesign:
    """Tune a controller of two degrees of freedom so that the plant answers like a reference model M.

    u = F yr + F' T/(1 - T) (yr - y), yr = M r. F and F' are z^delay times matrices of sums of Laguerre functions, and
    T = z^-delay ((1 - c)/(1 - c z^-1))^2 is the complementary sensitivity that is wanted [Lecchini2002].

    Two virtual experiments on the record are linear in the coefficients. If y answers a virtual request, then yr = y,
    the feedback rests and u = F y. If y answers a virtual error alone, that error is (1 - T)/T y and u = F' y. Weights
    make the errors of u those of the loop, as far as it is the wanted one: M and T (1 - T) [Campi2002]. The outputs of
    all loops enter each command [Formentin2012].

    As instruments against the noise of y serve Laguerre functions of the inputs [Soderstrom1989, ch. 8]. The same
    regression of y gives the long model of the record by which stability and sensitivity are tested before use.

    Args:
        data: Record in open loop, m inputs and m outputs.
        reference: Stable model from m requests to the m outputs that are wanted, no direct term. Its answer within the
            delay is predicted for requests that stay as they are, and must be small.
        delay: Delay of the plant in samples; a larger one lets F look ahead, and slows the feedback.
        terms: Number of coefficients per command and output.
        pole: Pole of the Laguerre functions; 0 makes them delays.
        sensitivity: Largest peak of the sensitivity, above 1.
        corner: Corner frequency of T in Hz; by default the highest with which the sensitivity is kept.
        correction: Largest difference between each command and its feedforward, in standard deviations of that command
            in the record. What asks for more than the record has tried is an obstacle: against it, integral action and
            an operator who steers by sight push in turn, harder and harder.
        instruments: Number of instruments per input, at least `terms`.

    Returns:
        The controller, and how its design came about.

    Raises:
        SysidError: Another number of inputs or outputs, a record too short, with too little excitation or too much
            noise, a reference that is unstable or answers before the plant can, or no feedback that keeps the
            sensitivity.
    """
    record = as_record(data).detrend(0)
    n, delay = whole_number("terms", terms, 1), whole_number("delay", delay, 1)
    instruments = whole_number("instruments", instruments, n)
    pole = real_number("pole", pole, "lie in 0 <= pole < 1", lambda x: 0.0 <= x < 1.0)
    bound = real_number("sensitivity", sensitivity, "be above 1", lambda x: 1.0 < x < np.inf)
    corners = [*np.geomspace(FASTEST, SLOWEST, TRIED) / record.dt]
    allowed = real_number("correction", correction, "be above 0", lambda x: 0.0 < x < np.inf) * record.u.std(axis=0)
    if corner is not None:
        corners = [real_number("corner", corner, "be above 0, in Hz", lambda x: 0.0 < x < np.inf)]
    _check(record, reference, delay, instruments)
    m, first = reference.nu, len(record) // SETTLING

    def inverse(numerator: FloatArray, denominator: FloatArray, rows: list[int]) -> tuple[FloatArray, FloatArray]:
        """Coefficients (rows, m n) from filtered outputs to filtered commands, and what they leave unexplained."""
        u, y = (_filtered(numerator, denominator, x) for x in (record.u, record.y))
        Z = np.linalg.qr(_bank(u, instruments, pole)[first + delay - 1 : -1])[0]
        Phi, target = _bank(y, n, pole)[first + delay :], u[first:-delay, rows]
        fit = solve(Z.T @ Phi, Z.T @ target)
        if fit.rank < Phi.shape[1]:
            raise SysidError(
                f"the record determines {fit.rank - 1} of {m * n} coefficients per command: excite all inputs at more "
                "frequencies, or take fewer terms"
            )
        left = (target - Phi @ fit.solution).std(axis=0) / target.std(axis=0)
        return fit.solution[:-1].T, left

    plant, wanted = _long_model(record, instruments, pole, first), _own_responses(reference, first)
    fits = [inverse(response, np.ones(1), [i]) for i, response in enumerate(wanted)]
    ahead, unexplained = np.vstack([one for one, _ in fits]), np.concatenate([left for _, left in fits])
    if unexplained.max() > UNEXPLAINED:
        raise SysidError(
            f"the outputs leave {unexplained.max():.0%} of a command unexplained, expected {UNEXPLAINED:.0%} at most: "
            "too much noise, or a delay or terms that do not fit the plant"
        )
    peak = np.inf
    for tried in corners:
        c = np.exp(-2.0 * np.pi * tried * record.dt)
        gain, lags = (1.0 - c) ** 2, np.array([1.0, -2.0 * c, c * c])
        # T/(1 - T) = gain z^-delay/rest, where rest has the root z = 1: integral action.
        rest = np.zeros(max(delay, 2) + 1)
        rest[:3] = lags
        rest[delay] -= gain
        back = inverse(gain * rest, np.convolve(lags, lags), list(range(m)))[0]
        lags_left = np.asarray(np.polydiv(rest, [1.0, -1.0])[0])
        controller = _controller(reference, ahead, back, (gain, lags_left), delay, pole, allowed)
        peak = controller.sensitivity(plant) if controller.closed_loop(plant).is_stable() else np.inf
        if peak <= bound:
            return VirtualReferenceDesign(
                controller, ahead.reshape(m, m, n), back.reshape(m, m, n), float(tried), peak, unexplained
            )
    outcome = "is unstable" if np.isinf(peak) else f"peaks at {peak:.3g}"
    raise SysidError(
        f"sensitivity {bound:g} requested, but the loop {outcome} with a corner of {tried:.3g} Hz: allow more, or "
        "change delay, terms or pole"
    )


def _check(record: IOData, reference: StateSpace, delay: int, instruments: int) -> None:
    if not np.isfinite(record.y).all() or not np.ptp(record.u, axis=0).all():
        raise SysidError("record: expected moving inputs, and no missing outputs")
    check_model("reference", reference, dt=record.dt)
    m = reference.nu
    if (record.nu, record.ny) != (m, m):
        raise SysidError(f"record: expected {m} inputs and outputs, got {record.nu} and {record.ny}")
    early = np.abs(reference.step_response(delay)[-1]).max()
    if early > PREMATURE:
        raise SysidError(
            f"reference: {early:.2g} of its step comes within the delay of {delay} samples (at most {PREMATURE:g} may)"
        )
    needed = 2 * m * instruments * SETTLING // (SETTLING - 1) + delay
    if len(record) < needed:
        raise SysidError(
            f"record: expected {needed} samples or more for {m * instruments} instruments, got {len(record)}"
        )


def _own_responses(reference: StateSpace, most: int) -> FloatArray:
    """Impulse responses of each output to its own request (m, samples), until they have decayed."""
    decay = np.log(1e-12) / np.log(max(abs(reference.poles()[0]), 1e-12))
    markov = reference.markov(min(most, int(decay) + 1) + 1)[1:]
    return np.diagonal(markov, axis1=1, axis2=2).T


def _filtered(numerator: FloatArray, denominator: FloatArray, x: FloatArray) -> FloatArray:
    if len(denominator) == 1:
        return np.asarray(scipy.signal.oaconvolve(x, numerator[:, None] / denominator, axes=0)[: len(x)])
    return np.asarray(scipy.signal.lfilter(numerator, denominator, x, axis=0))


def _bank(x: FloatArray, count: int, pole: float) -> FloatArray:
    """Laguerre functions of signals (N, m) and a constant: (N, m * count + 1), those of the first signal first."""
    one = scipy.signal.lfilter([np.sqrt(1.0 - pole**2)], [1.0, -pole], x, axis=0)
    functions = [one]
    for _ in range(count - 1):
        functions.append(scipy.signal.lfilter([-pole, 1.0], [1.0, -pole], functions[-1], axis=0))
    return np.column_stack([np.stack(functions, axis=2).reshape(len(x), -1), np.ones(len(x))])


def _laguerre(count: int, pole: float, signals: int) -> tuple[FloatArray, FloatArray]:
    """A and B of the functions in `_bank`: they are the next state, A x + B v."""
    one = all_pass(np.full(count, complex(pole)))
    eye = np.eye(signals)
    return np.asarray(np.kron(eye, one.F)), np.asarray(np.kron(eye, one.b[:, None]))


def _long_model(record: IOData, count: int, pole: float, first: int) -> StateSpace:
    """Regression of the outputs on Laguerre functions of the inputs."""
    fit = solve(_bank(record.u, count, pole)[first:-1], record.y[first + 1 :])
    A, B = _laguerre(count, pole, record.nu)
    return StateSpace(A, B, fit.solution[:-1].T, np.zeros((record.ny, record.nu)), None, record.dt)


def _controller(
    reference: StateSpace,
    ahead: FloatArray,
    back: FloatArray,
    error_filter: tuple[float, FloatArray],
    delay: int,
    pole: float,
    correction: FloatArray,
) -> Controller:
    """Controller u(t) = ua(t-1) + uf(t) - uf(t-1) + F' z^-delay w(t), where w is the error through gain/denominator."""
    m, terms = reference.nu, ahead.shape[1] // reference.nu
    A, B = _laguerre(terms, pole, m)
    gain, denominator = error_filter
    one = scipy.signal.tf2ss(np.append(gain, np.zeros(len(denominator) - 1)), denominator)
    Aw, Bw, Cw, Dw = (np.kron(np.eye(m), matrix) for matrix in one)
    sizes = (m * terms, m * terms, len(Aw), m, m, reference.order, m, m)
    total = sum(sizes[:-2])
    # Each signal as a matrix that gives it from [states, r, y].
    signals = np.split(np.eye(total + 2 * m), np.cumsum(sizes)[:-1])
    xf, xb, xw, applied, forward, xr, r, y = signals
    coming = reference.C @ np.linalg.matrix_power(reference.A, delay) @ xr + reference.step_response(delay + 1)[-1] @ r
    error = reference.C @ xr - y
    xf = A @ xf + B @ coming
    xb = A @ xb + B @ (Cw @ xw + Dw @ error)
    feedforward = ahead @ xf
    command = applied + feedforward - forward + back @ xb
    following = np.vstack(
        [xf, xb, Aw @ xw + Bw @ error, np.zeros((m, total + 2 * m)), feedforward, reference.A @ xr + reference.B @ r]
    )
    Bu = np.zeros((total, m))
    Bu[2 * m * terms + len(Aw) :][:m] = np.eye(m)
    (state, Br, By), (C, Dr, Dy) = (np.split(x, [total, total + m], axis=1) for x in (following, command))
    return Controller(state, Br, By, Bu, C, Dr, Dy, reference.dt, feedforward[:, :-m], correction)
