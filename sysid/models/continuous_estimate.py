"""Estimates of continuous-time models, and natural frequencies, damping and time constants with intervals."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, fields
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from sysid.models.confidence_bands import Band, matched_roots, normal_band
from sysid.models.continuous_model import ContinuousModel
from sysid.models.delta_method import spread
from sysid.models.estimate import Estimate, as_estimate
from sysid.models.frequency_response import NORMAL_95
from sysid.models.state_space import StateSpace
from sysid.records.arguments import function
from sysid.records.arrays import ComplexArray, FloatArray, Locked
from sysid.records.printing import Part, Table, number

if TYPE_CHECKING:
    import control


@dataclass(frozen=True, eq=False, repr=False)
class ContinuousEstimate(Estimate):
    """An estimate of a continuous-time model.

    Poles, zeros, gain, frequency response and bandwidth are those of `continuous`. `model` is its exact sampling at the
    interval of the data: it predicts, simulates and is compared; `band`, `poles_band` and `step_response` are of it.

    Attributes:
        realise_continuous: Pure function from parameters to the continuous-time model.
    """

    realise_continuous: Callable[[FloatArray], ContinuousModel]

    @cached_property
    def continuous(self) -> ContinuousModel:
        """The continuous-time model."""
        return self.realise_continuous(self.parameters)

    def continuous_band(self, quantity: Callable[[ContinuousModel], FloatArray]) -> Band:
        """95 % interval of any real quantity of the continuous-time model, by the delta method [Ljung1999, ch. 9]."""
        quantity = function("quantity", quantity, "from a continuous-time model to real numbers")
        value = np.asarray(quantity(self.continuous), dtype=float)
        moves = spread(lambda theta: quantity(self.realise_continuous(theta)), self.parameters, self.covariance)
        return normal_band(value, moves)

    def _dynamics(self) -> Sequence[Part]:
        """Transfer functions and modes, for the printed text."""
        return [*self.continuous.fractions(), damp(self).table()]

    @property
    def _responding(self) -> ContinuousModel:
        """The model whose frequency response and bandwidth are reported."""
        return self.continuous

    def _response_of(self, theta: FloatArray) -> ContinuousModel:
        """The continuous-time model at other parameters."""
        return self.realise_continuous(theta)

    def poles(self) -> ComplexArray:
        """Poles of the path from input to output in rad/s, largest modulus first; with intervals: `damp`."""
        return self.continuous.poles()

    def zeros(self) -> ComplexArray:
        """Finite transmission zeros of the dynamics without delays in rad/s, largest modulus first."""
        return self.continuous.zeros()

    def to_control(self, pade: int | None = None) -> "control.StateSpace":
        """The path from u to y as a python-control system in continuous time; see `ContinuousModel`."""
        return self.continuous.to_control(pade)


def continuous_estimate(
    estimate: Estimate, realise_continuous: Callable[[FloatArray], ContinuousModel]
) -> ContinuousEstimate:
    """The estimate with a continuous-time model of the same parameters."""
    return ContinuousEstimate(**estimate_fields(estimate), realise_continuous=realise_continuous)


def sampled_poles(estimate: Estimate) -> ComplexArray:
    """Poles in the z plane from input to output, of a continuous-time model those of its sampling."""
    if isinstance(estimate, ContinuousEstimate):
        return estimate.model.input_path().poles()
    return estimate.poles()


def estimate_fields(estimate: Estimate) -> dict[str, Any]:
    """Fields of `Estimate` by name, without those of a continuous-time model."""
    return {field.name: getattr(estimate, field.name) for field in fields(Estimate)}


@dataclass(frozen=True, eq=False, repr=False)
class Modes(Locked):
    """Poles with what they mean in time, each with its 95 % interval.

    Attributes:
        poles: Poles in rad/s, those with a positive imaginary part for their pairs, slowest first (m,).
        natural_frequency: Modulus of the pole in Hz (m,).
        damping: Damping ratio: 1 for a decaying real pole, negative for an unstable one (m,).
        time_constant: Time in s to decay to 1/e; infinite for an integrator, negative for an unstable pole (m,).
    """

    poles: ComplexArray
    natural_frequency: Band
    damping: Band
    time_constant: Band

    def _parts(self) -> list[Part]:
        return ["Poles with 95 % intervals", self.table()]

    def table(self) -> Table:
        """A row per pole or pair."""
        return Table(
            [
                ("pole / (rad/s)", [_pole_text(pole) for pole in self.poles]),
                ("natural frequency / Hz", _texts_with_intervals(self.natural_frequency)),
                ("damping", _texts_with_intervals(self.damping)),
                ("time constant / s", _texts_with_intervals(self.time_constant)),
            ]
        )


def _pole_text(pole: complex) -> str:
    """A real pole, or a pair of conjugate ones by its member with positive imaginary part."""
    return f"{number(pole.real)} ± {number(pole.imag)}j" if pole.imag else number(pole.real)


def _texts_with_intervals(band: Band) -> list[str]:
    """Every value with its interval, as text."""
    low, high = band.ci95
    return [_with_interval(*row) for row in zip(band.value, low, high, strict=True)]


def _with_interval(value: float, low: float, high: float) -> str:
    """Value and interval to the second digit of its width, at least three."""
    # an interval without end says no more than none
    if not (low < high and np.isfinite([value, low, high]).all()):
        return number(value)
    relative_width = (high - low) / max(abs(value), high - low)
    digits = int(np.clip(2 - np.floor(np.log10(relative_width)), 3, 12))
    # adding 0.0 turns -0.0 into 0.0
    shown = [f"{end + 0.0:#.{digits}g}".rstrip(".") for end in (value, low, high)]
    return f"{shown[0]} ({shown[1]} to {shown[2]})"


def damp(estimate: Estimate | StateSpace | ContinuousModel) -> Modes:
    """Natural frequencies, damping ratios and time constants of an estimate, with 95 % intervals by the delta method.

    Intervals of frequency and time constant are symmetric on a logarithmic scale, those of damping end at -1 and 1.
    Poles of discrete-time estimates are taken to continuous time by s = log(z) / dt; those at z = 0, which are delays,
    are left out, as are those of the noise model.

    Args:
        estimate: Any parametric estimate; a model, without intervals.

    Returns:
        Poles, slowest first, and their natural frequency, damping and time constant.

    Raises:
        SysidError: Something other than an estimate or a model.
    """
    parameters, covariance = np.zeros(0), np.full((1, 1), np.nan)
    if not isinstance(estimate, StateSpace | ContinuousModel):
        estimate = as_estimate(estimate)
        parameters, covariance = estimate.parameters, estimate.covariance
    all_poles = _continuous_poles(estimate, parameters)
    # a double real pole may be computed with an imaginary part of rounding, of either sign
    upper = all_poles.imag >= -1e-9 * np.abs(all_poles)
    slowest = np.argsort(np.abs(all_poles[upper]), kind="stable")
    nominal = all_poles[upper][slowest]
    nominal = np.where(np.abs(nominal.imag) <= 1e-9 * np.abs(nominal), nominal.real, nominal)

    def modal_quantities(theta: FloatArray) -> FloatArray:
        # all poles are matched before halves of pairs are dropped: a pair may become two real poles
        matched = matched_roots(_continuous_poles(estimate, theta), all_poles)
        return _modal_quantities(matched[upper][slowest])

    with np.errstate(invalid="ignore"):  # integrators stay such
        moves = spread(modal_quantities, parameters, covariance)
    value = _modal_quantities(nominal)
    frequency, damping, time = (normal_band(value[k], moves[:, k]) for k in range(3))
    low, high = (np.clip(end, -1.0, 1.0) for end in damping.ci95)
    bounded_damping = Band(damping.value, damping.deviation, (low, high))
    return Modes(nominal, _logarithmic(frequency), bounded_damping, _logarithmic(time))


def _continuous_poles(estimate: Estimate | StateSpace | ContinuousModel, theta: FloatArray) -> ComplexArray:
    """Poles of the path from input to output at the parameters, in rad/s; a model has no parameters."""
    if isinstance(estimate, ContinuousEstimate):
        return estimate.realise_continuous(theta).poles()
    if isinstance(estimate, ContinuousModel):
        return estimate.poles()
    model = estimate if isinstance(estimate, StateSpace) else estimate.realise(theta)
    path = model.input_path()
    z = path.poles()
    return np.asarray(np.log(z[np.abs(z) > AT_ZERO]) / path.dt)


AT_ZERO = 1e-6  # modulus of a discrete pole that counts as a delay: multiple ones at zero scatter


def _logarithmic(band: Band) -> Band:
    """The band with an interval that cannot contain zero."""
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        factor = np.exp(NORMAL_95 * band.deviation / np.abs(band.value))
        ends = np.stack((band.value / factor, band.value * factor))
    return Band(band.value, band.deviation, (ends.min(axis=0), ends.max(axis=0)))


def _modal_quantities(poles: ComplexArray) -> FloatArray:
    """Natural frequency, damping and time constant of each pole (3, m)."""
    size = np.abs(poles)
    with np.errstate(divide="ignore", invalid="ignore"):
        damping = -poles.real / size
        # an integrator, -0.0, must get the time constant plus infinity
        time_constant = 1.0 / np.where(size, -poles.real, 0.0)
        return np.stack((size / (2.0 * np.pi), damping, time_constant))
