"""Conversion between discrete and continuous time."""

import warnings
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import chain
from typing import TYPE_CHECKING, Any, Literal, overload

import numpy as np
import scipy

from sysid.models.continuous_estimate import ContinuousEstimate, continuous_estimate, estimate_fields
from sysid.models.continuous_model import ContinuousModel
from sysid.models.estimate import Estimate
from sysid.models.model_forms import as_model, chosen_model
from sysid.models.reduction import split_delay
from sysid.models.state_space import StateSpace
from sysid.models.zero_pole_gain import ZeroPoleGain, zero_pole_gain
from sysid.records.arguments import sampling_interval, shown
from sysid.records.arrays import ComplexArray, FloatArray
from sysid.records.errors import SysidError, SysidWarning
from sysid.records.optional import optional

if TYPE_CHECKING:
    import control

AT_ZERO = 1e-9  # modulus of a pole below which it counts as a sample of delay
AT_INFINITY = 30.0  # modulus of a zero, times dt, from which exp(s dt) is lost in floating-point rounding
ON_AXIS = 1e-9  # imaginary part of a root, relative to it, below which it counts as real
SAME_RESPONSE = 1e-9  # error of the response at the samples, relative to its largest value, that pairs may add
AT_ONE = 1e-9  # distance from z = 1 below which a pole counts as an integrator


Hold = Literal["zoh", "foh"]


@overload
def d2c(model: Estimate, *, intersample: Hold | None = None) -> ContinuousEstimate: ...
@overload
def d2c(model: StateSpace, *, intersample: Hold | None = None) -> "control.StateSpace": ...
def d2c(model: StateSpace | Estimate, *, intersample: Hold | None = None) -> "control.StateSpace | ContinuousEstimate":
    """Convert to the continuous-time system of which `model` is the discretisation.

    A = exp(F dt), by the principal logarithm: frequencies are taken to lie below Nyquist. With phi the mean of
    exp(F s) over 0 <= s <= dt, an input that is held gives B = phi G dt, a linear one phi^2 G dt [Franklin1998]. Of an
    estimate the noise model is converted too, its innovation taken as held, and delays beyond one sample become those
    of the continuous-time model; its parameters and their covariance stay, so that poles (`damp`), response and
    bandwidth have intervals.

    No real system has exp(s dt) = -a < 0 with one pole. Each pole on the negative real axis becomes a complex pair
    s = (log(a) +- i pi) / dt at the Nyquist frequency, as in MATLAB, which raises the order; the response at the
    samples stays the same, and `c2d` gives it back, with the pole twice and one of them cancelled.

    Args:
        model: An estimate, or a model, whose noise model is ignored.
        intersample: Behaviour of the input between samples: held (`zoh`) or linear (`foh`). By default that of the data
            of an estimate, and held of a model.

    Returns:
        Of an estimate the same estimate with a continuous-time model; of a model a continuous-time python-control
        system with its names.

    Raises:
        SysidError: A pole at zero, which is a delay: exp(s dt) is zero of no s. Poles on the negative real axis so
            close to others that they cannot be separated.

    Warns:
        SysidWarning: Data whose input is band-limited, which no hold describes: it is taken as held. Poles on the
            negative real axis, which become pairs. The noise model of an estimate has a pole at zero, and is left out.
    """
    model = chosen_model(model)
    if isinstance(model, ContinuousEstimate):
        return model
    hold_of_data = model.data.intersample if isinstance(model, Estimate) else "zoh"
    hold = hold_of_data
    if intersample is not None:
        hold = "foh" if _is_linear(intersample) else "zoh"
    if hold == "bl":
        message = (
            "the input of the data is band-limited: taken as held, which is exact only far below Nyquist; "
            "intersample='zoh' or 'foh' chooses"
        )
        warnings.warn(message, SysidWarning, stacklevel=2)
        hold = "zoh"
    _is_linear(hold)
    if not isinstance(model, Estimate):
        path = replace(as_model(model).input_path(), K=None)
        continuous = _unsampled(path, hold)
        _warn_of_pairs(continuous, path.poles())
        return continuous.to_control()
    realise = Unsampled(model.realise, hold, noise=True)
    # one trial run tells whether the noise model can be converted: its poles alone may have no continuous counterpart
    try:
        continuous = realise(model.parameters)
    except SysidError:
        realise = Unsampled(model.realise, hold, noise=False)
        continuous = realise(model.parameters)
        message = "the noise model has a pole that no continuous-time model has, at zero, and is left out"
        warnings.warn(message, SysidWarning, stacklevel=2)
    converted = model.model if realise.noise else model.model.input_path()
    _warn_of_pairs(continuous, converted.poles())
    return continuous_estimate(model, realise)


@dataclass(frozen=True)
class Unsampled:
    """Pure function from the parameters of a discrete-time estimate to its continuous-time model; can be pickled.

    Attributes:
        realise: From parameters to the discrete-time model.
        intersample: Input between samples, held or linear.
        noise: Whether to convert the noise model.
    """

    realise: Callable[[FloatArray], StateSpace]
    intersample: str
    noise: bool

    def __call__(self, theta: FloatArray) -> ContinuousModel:
        """Model for parameters (p,)."""
        model = self.realise(theta)
        path, delays = split_delay(model)
        if not (self.noise and model.gain.any()):
            path = replace(path, innovation_covariance=model.innovation_covariance)
            return _unsampled(path, self.intersample, delays)
        if path.order == model.order and not any(delays):
            return _unsampled(model, self.intersample)
        # a noise model of its own, or states that only delay the input
        return _unsampled(_with_separate_noise(path, model), self.intersample, delays)


def _with_separate_noise(path: StateSpace, model: StateSpace) -> StateSpace:
    """The input path beside the noise model of `model`, with states of their own."""
    noise = replace(model, B=model.gain, D=np.eye(model.ny), input_names=None, input_units=None).input_path()
    no_drive = np.zeros((noise.order, model.nu))
    no_gain = np.zeros((path.order, model.ny))
    return replace(
        model,
        A=scipy.linalg.block_diag(path.A, noise.A),
        B=np.vstack((path.B, no_drive)),
        C=np.hstack((path.C, noise.C)),
        D=path.D,
        K=np.vstack((no_gain, noise.B)),
    )


def _unsampled(model: StateSpace, intersample: str, delays: Sequence[int] = (0,)) -> ContinuousModel:
    """Model in continuous time, its innovation held; delays in samples, one for all inputs or one each."""
    poles = model.poles()
    _check_no_delay(poles)
    if _without_match(poles).any():
        model, F, rates_of_drive = _with_pairs(model)
    else:
        F, rates_of_drive = _rates(model.A, np.hstack((model.B, model.gain)), model.dt)
    n, nu = model.order, model.nu
    G, K, D = rates_of_drive[:, :nu], rates_of_drive[:, nu:], model.D
    if intersample == "foh":
        blocks = np.eye(3 * n, k=n)
        blocks[:n, :n] = F * model.dt
        _, phi, ramp = np.split(scipy.linalg.expm(blocks)[:n], 3, axis=1)
        G = np.linalg.solve(phi, G)
        D = D - model.C @ ramp @ G * model.dt
    gain = K if model.gain.any() else None
    states = replace(model, A=F, B=G, D=D, K=gain)
    delays_in_seconds = model.dt * np.broadcast_to(np.asarray(delays, dtype=float), D.shape)
    return ContinuousModel(states, delays_in_seconds, intersample)


def _rates(A: FloatArray, drive: FloatArray, dt: float) -> tuple[FloatArray, FloatArray]:
    """F and the effect of held inputs per s, of which A = exp(F dt) and `drive` are the samples."""
    n, held_inputs = drive.shape
    # held inputs are states that do not change, so that one logarithm gives F, G and K [Franklin1998]
    augmented = np.block([[A, drive], [np.zeros((held_inputs, n)), np.eye(held_inputs)]])
    rates = np.real(scipy.linalg.logm(augmented)) / dt
    return rates[:n, :n], rates[:n, n:]


def _with_pairs(model: StateSpace) -> tuple[StateSpace, FloatArray, FloatArray]:
    """The model with every state of a negative real pole twice, and its F and the effect of held inputs per s.

    With N the block of these poles and w = pi / dt, exp(F dt) = diag(N, N) for F = [[L, w I], [-w I, L]],
    L = log(-N) / dt, since L and w I commute and the rotation by pi is -I. Only the first copy is driven and seen.
    """
    T, Z, m = scipy.linalg.schur(model.A, output="real", sort=_is_negative)
    negative, rest = T[:m, :m], T[m:, m:]
    # T11 X - X T22 = -T12 makes the two groups of states independent
    X = scipy.linalg.solve_sylvester(negative, -rest, -T[:m, m:])
    to_states = Z @ np.block([[np.eye(m), X], [np.zeros((len(rest), m)), np.eye(len(rest))]])
    drive = np.linalg.solve(to_states, np.hstack((model.B, model.gain)))
    C = model.C @ to_states
    rotation = np.pi / model.dt * np.eye(m)
    L = np.real(scipy.linalg.logm(-negative)) / model.dt
    pairs = np.block([[L, rotation], [-rotation, L]])
    twice = np.vstack((drive[:m], np.zeros((m, drive.shape[1]))))
    # the mean of exp(F s) over an interval takes the held input to the next sample
    exponents = np.block([[pairs, np.eye(2 * m)], [np.zeros((2 * m, 4 * m))]]) * model.dt
    of_pairs = np.linalg.solve(scipy.linalg.expm(exponents)[: 2 * m, 2 * m :], twice)
    F_rest, of_rest = _rates(rest, drive[m:], model.dt)
    sampled = replace(
        model,
        A=scipy.linalg.block_diag(negative, negative, rest),
        B=np.vstack((twice, drive[m:]))[:, : model.nu],
        C=np.hstack((C[:, :m], np.zeros((model.ny, m)), C[:, m:])),
        K=np.vstack((twice, drive[m:]))[:, model.nu :] if model.gain.any() else None,
    )
    _check_same_samples(model, sampled)
    return sampled, scipy.linalg.block_diag(pairs, F_rest), np.vstack((of_pairs, of_rest))


def _is_negative(real: float, imaginary: float) -> bool:
    return real < 0.0 and abs(imaginary) <= ON_AXIS * abs(complex(real, imaginary))


def _check_same_samples(model: StateSpace, sampled: StateSpace) -> None:
    """Refuse a split of the states that costs the response more than its ninth digit."""
    f = np.linspace(0.0, 0.5, 33)[1:] / model.dt
    expected, got = model.frequency_response(f), sampled.frequency_response(f)
    if not np.abs(got - expected).max() <= SAME_RESPONSE * np.abs(expected).max():
        raise SysidError(
            "the model has poles on the negative real axis so close to others that they cannot be converted to pairs "
            "without loss of digits; fit a lower order"
        )


def _warn_of_pairs(continuous: ContinuousModel, poles: ComplexArray) -> None:
    """Warn that poles on the negative real axis have become pairs, which raises the order."""
    negative = poles[_without_match(poles)]
    if len(negative):
        listed_poles = ", ".join(f"{pole.real:.4g}" for pole in negative)
        message = (
            f"{len(negative)} pole(s) on the negative real axis, {listed_poles}, become complex pairs at the Nyquist "
            f"frequency: the continuous-time model has order {continuous.order}, and its response is the same at the "
            "samples and oscillates between them"
        )
        warnings.warn(message, SysidWarning, stacklevel=3)


@overload
def c2d(system: ContinuousEstimate, dt: float, *, intersample: Hold | None = None) -> Estimate: ...
@overload
def c2d(system: "control.LTI | ContinuousModel", dt: float, *, intersample: Hold | None = None) -> StateSpace: ...
def c2d(
    system: "control.LTI | ContinuousModel | ContinuousEstimate", dt: float, *, intersample: Hold | None = None
) -> StateSpace | Estimate:
    """Discretise a continuous-time system whose input is held, or linear, between samples.

    An estimate keeps its parameters and their covariance, residuals and data; its model is sampled at `dt`.

    Args:
        system: A continuous-time estimate or its model, or a continuous-time python-control system.
        dt: Sampling interval in s.
        intersample: Behaviour of the input between samples: held (`zoh`) or linear (`foh`). By default that of an
            estimate's data, and held for a system.

    Returns:
        The discrete-time model; of an estimate the discrete-time estimate.

    Raises:
        SysidError: The system is not continuous, has more zeros than poles, or dt is not positive.
    """
    dt = sampling_interval(dt)
    method = "foh" if intersample is not None and _is_linear(intersample) else "zoh"
    if isinstance(system, ContinuousModel):
        return _with_hold(system, intersample).sampled(dt)
    if isinstance(system, ContinuousEstimate):
        realise = Resampled(system.realise_continuous, dt, intersample)
        resampled = {"model": realise(system.parameters), "polynomials": None, "realise": realise}
        return Estimate(**estimate_fields(system) | resampled)
    with optional("control"):
        import control

    system = _continuous(system)
    if isinstance(system, control.TransferFunction):
        for numerator, denominator in zip(chain(*system.num), chain(*system.den), strict=True):
            _check_proper(_degree(numerator), _degree(denominator))
    states = control.ss(system)
    if not states.nstates:
        # python-control samples nothing without a state
        B, C = np.zeros((0, states.ninputs)), np.zeros((states.noutputs, 0))
        return StateSpace(np.zeros((0, 0)), B, C, states.D, None, dt)
    return StateSpace.from_control(control.sample_system(states, dt, method=method))


def _with_hold(model: ContinuousModel, intersample: str | None) -> ContinuousModel:
    """The model for an input that is held or linear between samples; None leaves it as it is."""
    return model if intersample is None else replace(model, intersample=intersample)


def _degree(coefficients: FloatArray) -> int:
    """Degree of a polynomial, its leading zeros not counted."""
    return len(np.trim_zeros(coefficients, "f")) - 1


@dataclass(frozen=True)
class Resampled:
    """Pure function from the parameters of a continuous-time estimate to its model, sampled; can be pickled.

    Attributes:
        realise_continuous: From parameters to the continuous-time model.
        dt: Sampling interval in s; None is that of the data.
        intersample: Input between samples; None is as the model has it.
    """

    realise_continuous: Callable[[FloatArray], ContinuousModel]
    dt: float | None = None
    intersample: str | None = None

    def __call__(self, theta: FloatArray) -> StateSpace:
        """Model for parameters (p,)."""
        return _with_hold(self.realise_continuous(theta), self.intersample).sampled(self.dt)


def d2c_matched(model: StateSpace | Estimate) -> "control.TransferFunction":
    """Convert to the continuous-time system whose poles and zeros s map to those of `model` by z = exp(s dt).

    Zeros at zero and on the negative real axis, which sampling makes [Astrom1984], belong to infinite frequency and are
    dropped. The gain is matched at 0 Hz, or where that is zero or infinite at a tenth of the Nyquist frequency.

    Args:
        model: A model or estimate with one input and one output; its noise model has no part in this.

    Returns:
        A continuous-time python-control transfer function.

    Raises:
        SysidError: Several channels, or poles at zero or on the negative real axis.
    """
    with optional("control"):
        import control

    model = as_model(model).input_path()
    z = zero_pole_gain(model)
    # a multiple zero at -1 is computed as a small circle around it
    finite = z.zeros[~_without_match(z.zeros) & (np.abs(z.zeros + 1.0) > 1e-6)]
    _check_match(z.poles)
    zeros, poles = np.log(finite) / model.dt, np.log(z.poles) / model.dt
    unscaled = control.zpk(zeros, poles, 1.0)
    f = 0.0 if _regular_at_zero(z) else 0.05 / model.dt
    target = model.frequency_response([f])[0, 0, 0]
    gain = target / complex(unscaled(2j * np.pi * f))
    # both gains are real at 0 Hz; elsewhere only the magnitude can be matched, with the sign of the nearer phase
    return control.zpk(zeros, poles, float(np.copysign(abs(gain), gain.real)))


def c2d_matched(system: "control.LTI", dt: float) -> StateSpace:
    """The discrete-time system whose poles and zeros are z = exp(s dt) of those of a continuous one.

    Zeros at infinity, all but one, go to z = -1, so that the output follows a sample later. The gain is matched at
    0 Hz, or where that is zero or infinite at a tenth of the Nyquist frequency.

    Args:
        system: A continuous-time python-control system with one input and one output.
        dt: Sampling interval in s.

    Returns:
        The discrete-time model, without noise model.

    Raises:
        SysidError: Several channels, not continuous, dt not positive, more zeros than poles.
    """
    dt = sampling_interval(dt)
    system = _continuous(system)
    if system.ninputs != 1 or system.noutputs != 1:
        raise SysidError(f"matching takes one input and one output, got {system.ninputs} and {system.noutputs}")
    poles, zeros = np.asarray(system.poles(), complex), np.asarray(system.zeros(), complex)
    # a leading coefficient of rounding gives a zero far beyond the frequencies that samples can show
    zeros = zeros[np.abs(zeros) * dt < AT_INFINITY]
    _check_proper(len(zeros), len(poles))
    extra = max(len(poles) - len(zeros) - 1, 0)
    discrete_zeros = np.concatenate((np.exp(zeros * dt), -np.ones(extra)))
    unscaled = ZeroPoleGain(discrete_zeros, np.exp(poles * dt), 1.0, dt)
    f = 0.0 if _regular_at_zero(unscaled) else 0.05 / dt
    gain = complex(system(2j * np.pi * f)) / unscaled.frequency_response([f])[0]
    scaled = float(np.copysign(abs(gain), gain.real))
    return ZeroPoleGain(unscaled.zeros, unscaled.poles, scaled, dt).to_state_space()


def _is_linear(intersample: str) -> bool:
    """Whether the input is linear between samples (`foh`) instead of held (`zoh`); anything else is refused."""
    if not isinstance(intersample, str) or intersample not in ("zoh", "foh"):
        raise SysidError(f"intersample must be 'zoh' (held) or 'foh' (linear), got {shown(intersample)}")
    return intersample == "foh"


def _continuous(system: "control.LTI") -> "control.LTI":
    """Check that a python-control system is continuous in time."""
    with optional("control"):
        import control

    if not isinstance(system, control.StateSpace | control.TransferFunction):
        raise SysidError(f"expected a continuous-time python-control system, got {type(system).__name__}")
    # python-control gives a static gain neither continuous nor discrete time
    static = system.dt is None and not len(system.poles())
    if not static and not system.isctime(strict=True):
        raise SysidError(f"expected a continuous-time python-control system, got one with dt = {system.dt!r}")
    return system


def _check_proper(zeros: int, poles: int) -> None:
    """Refuse more zeros than poles: such a response grows with frequency without bound."""
    if zeros > poles:
        raise SysidError(f"the system has {zeros} zeros and only {poles} poles: its response grows with frequency")


def _without_match(roots: ComplexArray) -> np.ndarray[Any, np.dtype[np.bool_]]:
    """Mask of the roots z that are no exp(s dt) on the principal branch: at zero, or on the negative real axis."""
    on_axis = np.abs(roots.imag) <= ON_AXIS * np.abs(roots)
    return (np.abs(roots) < AT_ZERO) | ((roots.real < 0.0) & on_axis)


def _check_no_delay(poles: ComplexArray) -> None:
    """Refuse discrete poles at zero: exp(s dt) is zero of no s."""
    at_zero = int((np.abs(poles) < AT_ZERO).sum())
    if at_zero:
        raise SysidError(
            f"the model has {at_zero} pole(s) at zero, samples of delay, which no continuous-time model without delay "
            "has, as exp(s dt) is never zero: split_delay removes whole samples of delay; where B has more "
            "coefficients than F has poles, fit fewer, or tfest(data, np, nz, delay=None), whose delay may be a part "
            "of a sample"
        )


def _check_match(poles: ComplexArray) -> None:
    """Refuse discrete poles that no continuous-time system of the same order has."""
    unmatched = poles[_without_match(poles)]
    if len(unmatched):
        listed = ", ".join(f"{pole.real:.4g}" for pole in unmatched)
        raise SysidError(
            f"the model has {len(unmatched)} pole(s) at zero or on the negative real axis, {listed}, which no "
            "continuous-time system of the same order has; remove delays by split_delay, or fit a lower order"
        )


def _regular_at_zero(z: ZeroPoleGain) -> bool:
    """Whether the gain at 0 Hz is neither zero nor infinite."""
    roots = np.concatenate((z.zeros, z.poles))
    return bool((np.abs(roots - 1.0) > AT_ONE).all())
