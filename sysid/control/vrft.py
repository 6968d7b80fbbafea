"""Virtual reference feedback tuning: a model-following controller from one record, without a model of the plant."""

from collections.abc import Sequence
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
    terms, delay = whole_number("terms", terms, 1), whole_number("delay", delay, 1, len(record))
    instruments = whole_number("instruments", instruments, terms)
    pole = real_number("pole", pole, "lie in 0 <= pole < 1", lambda x: 0.0 <= x < 1.0)
    bound = real_number("sensitivity", sensitivity, "be above 1", lambda x: 1.0 < x < np.inf)
    corners = [*np.geomspace(FASTEST, SLOWEST, TRIED) / record.dt]
    allowed = real_number("correction", correction, "be above 0", lambda x: 0.0 < x < np.inf) * record.u.std(axis=0)
    if corner is not None:
        corners = [real_number("corner", corner, "be above 0, in Hz", lambda x: 0.0 < x < np.inf)]
    _check(record, reference, delay, instruments)
    m, first = reference.nu, len(record) // SETTLING
    regression = _Inverse(record, delay, terms, instruments, pole, first)
    plant = _long_model(record, instruments, pole, first)
    ahead, unexplained = _feedforward(regression, _own_responses(reference, first))
    # from the fastest feedback on: the first that keeps the sensitivity is the answer
    for corner_hz in corners:
        wanted = _LoopShape.of(corner_hz * record.dt, delay)
        feedback, _ = regression.fitted(wanted.gain * wanted.rest, np.convolve(wanted.lags, wanted.lags), range(m))
        controller = _controller(reference, ahead, feedback, wanted, delay, pole, allowed)
        peak = controller.sensitivity(plant) if controller.closed_loop(plant).is_stable() else np.inf
        if peak <= bound:
            return VirtualReferenceDesign(
                controller,
                ahead.reshape(m, m, terms),
                feedback.reshape(m, m, terms),
                float(corner_hz),
                peak,
                unexplained,
            )
    outcome = "is unstable" if np.isinf(peak) else f"peaks at {peak:.3g}"
    raise SysidError(
        f"sensitivity {bound:g} requested, but the loop {outcome} with a corner of {corner_hz:.3g} Hz: allow more, or "
        "change delay, terms or pole"
    )


@dataclass(frozen=True, eq=False)
class _Inverse:
    """Regression of filtered commands on Laguerre functions of filtered outputs, `delay` samples ahead.

    Attributes:
        record: Inputs and outputs without their means.
        delay: Samples by which the outputs are ahead of the commands.
        terms: Number of functions of each output.
        instruments: Number of functions of each input, the instruments.
        pole: Pole of the functions.
        first: First sample that counts, when filters have settled.
    """

    record: IOData
    delay: int
    terms: int
    instruments: int
    pole: float
    first: int

    def fitted(
        self, numerator: FloatArray, denominator: FloatArray, loops: Sequence[int]
    ) -> tuple[FloatArray, FloatArray]:
        """Coefficients (loops, m terms) from filtered outputs to commands of loops, and what is left unexplained."""
        u = _filtered(numerator, denominator, self.record.u)
        y = _filtered(numerator, denominator, self.record.y)
        # the instruments that are known when the command is given
        instruments = _bank(u, self.instruments, self.pole)[self.first + self.delay - 1 : -1]
        Z, _ = np.linalg.qr(instruments)
        Phi = _bank(y, self.terms, self.pole)[self.first + self.delay :]
        target = u[self.first : -self.delay, list(loops)]
        fit = solve(Z.T @ Phi, Z.T @ target)
        if fit.rank < Phi.shape[1]:
            # the constant is no coefficient of the inverse
            raise SysidError(
                f"the record determines {fit.rank - 1} of {self.record.nu * self.terms} coefficients per command: "
                "excite all inputs at more frequencies, or take fewer terms"
            )
        residual = target - Phi @ fit.solution
        return fit.solution[:-1].T, residual.std(axis=0) / target.std(axis=0)


def _feedforward(regression: _Inverse, responses: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Coefficients of the inverse (m, m terms), each command weighted by its response, and what is unexplained (m,)."""
    coefficients, unexplained = [], []
    for i, response in enumerate(responses):
        of_loop, unexplained_of_loop = regression.fitted(response, np.ones(1), [i])
        coefficients.append(of_loop)
        unexplained.append(unexplained_of_loop)
    shares = np.concatenate(unexplained)
    if shares.max() > UNEXPLAINED:
        raise SysidError(
            f"the outputs leave {shares.max():.0%} of a command unexplained, expected {UNEXPLAINED:.0%} at most: "
            "too much noise, or a delay or terms that do not fit the plant"
        )
    return np.vstack(coefficients), shares


@dataclass(frozen=True, eq=False)
class _LoopShape:
    """The complementary sensitivity that is wanted, T = z^-delay gain / lags, and T/(1 - T) = z^-delay gain / rest.

    Attributes:
        gain: (1 - c)^2, so that T is 1 at 0 Hz.
        lags: (1 - c z^-1)^2, coefficients of rising powers of 1/z.
        rest: lags - gain z^-delay; it has the root z = 1: integral action.
        without_integrator: rest over 1 - 1/z.
    """

    gain: float
    lags: FloatArray
    rest: FloatArray
    without_integrator: FloatArray

    @staticmethod
    def of(corner: float, delay: int) -> "_LoopShape":
        """Shape with a corner frequency in cycles per sample."""
        c = np.exp(-2.0 * np.pi * corner)
        gain, lags = (1.0 - c) ** 2, np.array([1.0, -2.0 * c, c * c])
        rest = np.zeros(max(delay, 2) + 1)
        rest[:3] = lags
        rest[delay] -= gain
        quotient, _ = np.polydiv(rest, [1.0, -1.0])
        return _LoopShape(gain, lags, rest, np.asarray(quotient))


def _check(record: IOData, reference: StateSpace, delay: int, instruments: int) -> None:
    """Refuse a record or a reference that the design cannot use."""
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
    # twice as many samples as instruments after the filters have settled
    needed = 2 * m * instruments * SETTLING // (SETTLING - 1) + delay
    if len(record) < needed:
        raise SysidError(
            f"record: expected {needed} samples or more for {m * instruments} instruments, got {len(record)}"
        )


def _own_responses(reference: StateSpace, longest: int) -> FloatArray:
    """Impulse responses of each output to its own request (m, samples), until they have decayed to 1e-12."""
    decay = np.log(1e-12) / np.log(max(abs(reference.poles()[0]), 1e-12))
    markov = reference.markov(min(longest, int(decay) + 1) + 1)[1:]
    return np.diagonal(markov, axis1=1, axis2=2).T


def _filtered(numerator: FloatArray, denominator: FloatArray, x: FloatArray) -> FloatArray:
    """Signals (N, m) through one filter from rest; long impulse responses by fast transforms."""
    if len(denominator) == 1:
        return np.asarray(scipy.signal.oaconvolve(x, numerator[:, None] / denominator, axes=0)[: len(x)])
    return np.asarray(scipy.signal.lfilter(numerator, denominator, x, axis=0))


def _bank(x: FloatArray, count: int, pole: float) -> FloatArray:
    """Laguerre functions of signals (N, m) and a constant: (N, m * count + 1), those of the first signal first."""
    functions = [scipy.signal.lfilter([np.sqrt(1.0 - pole**2)], [1.0, -pole], x, axis=0)]
    for _ in range(count - 1):
        functions.append(scipy.signal.lfilter([-pole, 1.0], [1.0, -pole], functions[-1], axis=0))
    return np.column_stack([np.stack(functions, axis=2).reshape(len(x), -1), np.ones(len(x))])


def _laguerre(count: int, pole: float, signals: int) -> tuple[FloatArray, FloatArray]:
    """State matrices A and B of the Laguerre functions in `_bank`, which are the state x(t+1) = A x(t) + B v(t)."""
    of_signal = all_pass(np.full(count, complex(pole)))
    eye = np.eye(signals)
    return np.asarray(np.kron(eye, of_signal.F)), np.asarray(np.kron(eye, of_signal.b[:, None]))


def _long_model(record: IOData, count: int, pole: float, first: int) -> StateSpace:
    """Regression of the outputs on Laguerre functions of the inputs."""
    fit = solve(_bank(record.u, count, pole)[first:-1], record.y[first + 1 :])
    A, B = _laguerre(count, pole, record.nu)
    # the last coefficient is that of the constant
    return StateSpace(A, B, fit.solution[:-1].T, np.zeros((record.ny, record.nu)), None, record.dt)


def _controller(
    reference: StateSpace,
    ahead: FloatArray,
    back: FloatArray,
    wanted: _LoopShape,
    delay: int,
    pole: float,
    correction: FloatArray,
) -> Controller:
    """Controller u(t) = ua(t-1) + uf(t) - uf(t-1) + F' z^-delay w(t), w the error through gain/without_integrator.

    The integrator is the difference to the command that was applied, ua, so it cannot wind up.
    """
    m, terms = reference.nu, ahead.shape[1] // reference.nu
    A, B = _laguerre(terms, pole, m)
    denominator = wanted.without_integrator
    numerator = np.append(wanted.gain, np.zeros(len(denominator) - 1))
    # one filter of the error for each loop
    Aw, Bw, Cw, Dw = (np.kron(np.eye(m), matrix) for matrix in scipy.signal.tf2ss(numerator, denominator))
    sizes = (m * terms, m * terms, len(Aw), m, m, reference.order, m, m)
    total = sum(sizes[:-2])
    # Each signal as a matrix that gives it from [states, r, y].
    signals = np.split(np.eye(total + 2 * m), np.cumsum(sizes)[:-1])
    xf, xb, xw, applied, forward, xr, r, y = signals
    # the reference model's output at t + delay, for a request that stays as it is
    by_state = reference.C @ np.linalg.matrix_power(reference.A, delay)
    by_request = reference.step_response(delay + 1)[-1]
    coming = by_state @ xr + by_request @ r
    error = reference.C @ xr - y
    next_f = A @ xf + B @ coming
    next_b = A @ xb + B @ (Cw @ xw + Dw @ error)
    next_w = Aw @ xw + Bw @ error
    feedforward = ahead @ next_f
    command = applied + feedforward - forward + back @ next_b
    next_reference = reference.A @ xr + reference.B @ r
    # the next state `applied` is the applied command alone, which comes by Bu
    from_applied = np.zeros((m, total + 2 * m))
    following = np.vstack([next_f, next_b, next_w, from_applied, feedforward, next_reference])
    Bu = np.zeros((total, m))
    Bu[2 * m * terms + len(Aw) :][:m] = np.eye(m)
    state, Br, By = np.split(following, [total, total + m], axis=1)
    C, Dr, Dy = np.split(command, [total, total + m], axis=1)
    return Controller(state, Br, By, Bu, C, Dr, Dy, reference.dt, feedforward[:, :-m], correction)
