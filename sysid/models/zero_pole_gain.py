"""Zeros, poles and gain of a channel, and transfer functions."""

from dataclasses import dataclass
from itertools import zip_longest
from typing import TYPE_CHECKING

import numpy as np
import scipy
from numpy.typing import ArrayLike

from sysid.models.estimate import Estimate
from sysid.models.model_forms import as_model
from sysid.models.state_space import StateSpace
from sysid.records.arguments import real_number, sampling_interval, whole_number
from sysid.records.arrays import ComplexArray, FloatArray, Locked, complex_array, lock, real_array
from sysid.records.errors import SysidError
from sysid.records.optional import optional

if TYPE_CHECKING:
    import control


@dataclass(frozen=True, eq=False, repr=False)
class ZeroPoleGain(Locked):
    """G(z) = gain prod(z - zeros) / prod(z - poles).

    Attributes:
        zeros: Finite zeros (m,), m <= n.
        poles: Poles (n,).
        gain: Leading coefficient: the first value of the pulse response that is not zero.
        dt: Sampling interval in s.

    Raises:
        SysidError: More zeros than poles, or complex ones without their conjugates.
    """

    zeros: ComplexArray
    poles: ComplexArray
    gain: float
    dt: float

    def __post_init__(self) -> None:
        """Check and lock."""
        roots = {name: complex_array(name, getattr(self, name)) for name in ("zeros", "poles")}
        for name, values in roots.items():
            if values.ndim != 1:
                raise SysidError(f"{name}: expected complex numbers (n,), got shape {values.shape}")
        if len(roots["zeros"]) > len(roots["poles"]):
            raise SysidError(f"a causal system has at most as many zeros as poles, got {len(roots['zeros'])} zeros")
        object.__setattr__(self, "gain", real_number("gain", self.gain, "be a finite number", np.isfinite))
        object.__setattr__(self, "dt", sampling_interval(self.dt))
        for name, values in roots.items():
            # conjugates may differ by rounding
            polynomial = np.atleast_1d(np.poly(values))
            if np.abs(np.imag(polynomial)).max() > 1e-8 * np.abs(polynomial).max():
                raise SysidError(f"{name}: complex values must come with their conjugates, got {values}")
            object.__setattr__(self, name, lock(values))

    def frequency_response(self, f_hz: ArrayLike) -> ComplexArray:
        """Response at frequencies in Hz (nf,)."""
        z = np.exp(2j * np.pi * self.dt * np.atleast_1d(real_array("f_hz", f_hz)))[:, None]
        return np.asarray(self.gain * np.prod(z - self.zeros, axis=1) / np.prod(z - self.poles, axis=1))

    def to_control(self) -> "control.TransferFunction":
        """As a python-control transfer function."""
        with optional("control"):
            import control

        return control.zpk(self.zeros, self.poles, self.gain, dt=self.dt)

    def to_state_space(self) -> StateSpace:
        """As a chain of second-order sections, which keeps digits that one polynomial in z would lose."""
        with optional("control"):
            import control

        chain = control.ss([], [], [], [[self.gain]], self.dt)
        for poles, zeros in zip_longest(_pairs(self.poles), _pairs(self.zeros), fillvalue=np.zeros(0)):
            matrices = scipy.signal.tf2ss(_monic(zeros), _monic(poles))
            chain = control.series(chain, control.ss(*matrices, self.dt))
        return StateSpace(chain.A, chain.B, chain.C, chain.D, None, self.dt)


def _pairs(roots: ComplexArray) -> list[ComplexArray]:
    """Pairs of roots, conjugates together; a single one comes last, so that zeros never outnumber poles in a pair."""
    # sorted, so that neighbours share a section
    real = np.sort_complex(roots[np.abs(roots.imag) <= 1e-12 * np.abs(roots)])
    upper = roots[roots.imag > 1e-12 * np.abs(roots)]
    pairs = [np.array([root, root.conjugate()]) for root in upper]
    return pairs + [real[k : k + 2] for k in range(0, len(real), 2)]


def zero_pole_gain(model: StateSpace | Estimate, *, input: int = 0, output: int = 0) -> ZeroPoleGain:
    """Zeros, poles and gain of one channel.

    Poles of the model that are structurally decoupled from the channel, such as those of a separate noise model, are
    omitted; other poles that the channel does not have are cancelled by a zero.

    Args:
        model: A model or estimate; of a time series its innovations take the place of inputs.
        input: Index of the input.
        output: Index of the output.

    Returns:
        The channel's zeros, poles and gain.

    Raises:
        SysidError: No such channel, or one without any response.
    """
    model = as_model(model)
    model = model if model.nu else model.input_path()
    input, output = whole_number("input", input, 0), whole_number("output", output, 0)
    if not (0 <= input < model.nu and 0 <= output < model.ny):
        raise SysidError(
            f"no channel from input {input} to output {output}: the model has {model.nu} input(s) and {model.ny} "
            "output(s), counted from 0"
        )
    channel = model.channel(input, output).input_path()
    leading = _leading(channel)
    if leading == 0.0:
        raise SysidError(f"input {input} does not reach output {output}: there is no gain")
    return ZeroPoleGain(channel.zeros(), channel.poles(), leading, model.dt)


def transfer_function(model: StateSpace | Estimate) -> "control.TransferFunction":
    """The path from u to y as a python-control transfer function, numerators and denominators in z.

    Polynomials of high order lose digits: compute with the state space instead.

    Args:
        model: A model or estimate; its noise model is ignored, but for a time series, whose innovations are its inputs.

    Returns:
        One numerator and denominator per channel, with the names of the model.

    Raises:
        SysidError: Neither a model nor an estimate.
    """
    with optional("control"):
        import control

    model = as_model(model)
    model = model if model.nu else model.input_path()
    numerators: list[list[FloatArray]] = []
    denominators: list[list[FloatArray]] = []
    for i in range(model.ny):
        channels = [model.channel(j, i).input_path() for j in range(model.nu)]
        numerators.append([_leading(channel) * _monic(channel.zeros()) for channel in channels])
        denominators.append([_monic(channel.poles()) for channel in channels])
    input_names, output_names = list(model.input_names or ()), list(model.output_names or ())
    return control.tf(numerators, denominators, model.dt, inputs=input_names, outputs=output_names)


def _monic(roots: ComplexArray | FloatArray) -> FloatArray:
    """Coefficients of the polynomial with these roots, of falling powers."""
    # numpy's polynomial without roots is the number 1.0
    return np.atleast_1d(np.poly(roots).real)


def _leading(channel: StateSpace) -> float:
    """First nonzero value of the pulse response; 0 if there is none."""
    # a pulse response that is zero up to the order stays zero
    pulse = channel.markov(channel.order + 1)[:, 0, 0]
    nonzero = np.flatnonzero(np.abs(pulse) > 1e-12 * np.abs(pulse).max())
    return float(pulse[nonzero[0]]) if len(nonzero) else 0.0
