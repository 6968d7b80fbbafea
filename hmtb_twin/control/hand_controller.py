"""Hand-controller interface: from noisy volts to held and quantised counts."""

from dataclasses import dataclass

import numpy as np
from scipy.signal import lfilter

from hmtb_twin.control.experiment import Chain
from hmtb_twin.parameters.values import SAMPLE_TIME, HandController


def quantise(signal: np.ndarray, step: float) -> np.ndarray:
    """Round a signal of any shape to whole converter counts of size `step`, integers as float64."""
    return np.rint(signal / step)


def low_pass(noise: np.ndarray, corner: float, sample_time: float = SAMPLE_TIME) -> np.ndarray:
    """Return white noise (N, n) behind a first-order low-pass of a corner in Hz, of equal variance from the start.

    A corner of 0 leaves it white.
    """
    if corner == 0.0:
        return noise
    pole = np.exp(-2.0 * np.pi * corner * sample_time)
    # The first sample has the full variance, so that the noise is stationary from the first tick on.
    driven = np.concatenate([noise[:1], np.sqrt(1.0 - pole**2) * noise[1:]])
    return np.asarray(lfilter([1.0], [1.0, -pole], driven, axis=0))


def pickup(
    ticks: int,
    axes: int,
    parameters: HandController,
    rng: np.random.Generator,
    chain: Chain,
    sample_time: float = SAMPLE_TIME,
) -> np.ndarray:
    """Return the disturbance that bias and wires add to the excitation.

    The noise is white, or a first-order low-pass of white noise where a corner is given, with the same standard
    deviation; hum is a sinusoid of random phase, which the position loop sees at its alias.

    Args:
        ticks: Length N.
        axes: Number of axes n.
        parameters: The interface.
        rng: Source of bias, noise and phase; the number of draws does not depend on the chain.
        chain: Imperfections that are switched on.
        sample_time: Length of a tick, s.

    Returns:
        Disturbance (N, n), V.
    """
    # All draws are made whatever the chain: switching off one imperfection must not change the others.
    bias = (1.0 - parameters.compensation) * parameters.bias * rng.standard_normal(axes)
    noise = rng.standard_normal((ticks, axes))
    phase = 2.0 * np.pi * rng.random(axes)
    noise = low_pass(noise, parameters.noise_corner, sample_time)
    disturbance = np.zeros((ticks, axes))
    if chain.bias:
        disturbance += bias
    if chain.noise:
        time = np.arange(ticks)[:, None] * sample_time
        disturbance += parameters.noise * noise
        disturbance += parameters.hum * np.sin(2.0 * np.pi * parameters.hum_frequency * time + phase)
    return disturbance


@dataclass(frozen=True)
class HandControllerInterface:
    """The interface of one experiment: volts of the excitation computer to stick deflections.

    The wires add bias and noise, the converter saturates and rounds, the processor holds each sample and suppresses
    small deflections [Morris1996, III.2A, III.2C and III.4].

    Attributes:
        parameters: The interface.
        chain: Imperfections that are switched on.
        disturbance: Disturbance by bias and wires at each tick (N, n), V.
    """

    parameters: HandController
    chain: Chain
    disturbance: np.ndarray

    @property
    def hold(self) -> int:
        """Ticks of the position loop that each sample lasts."""
        return self.parameters.hold if self.chain.hold else 1

    def receive(self, volts: np.ndarray, first: int = 0) -> np.ndarray:
        """Return the voltage at the converter for excitation volts (m, n) from tick `first` on, (m, n) V."""
        return volts + self.disturbance[first : first + len(volts)]

    def convert(self, received: np.ndarray) -> np.ndarray:
        """Return converter counts of voltages, same shape; fractions if the converter does not round."""
        # Two's complement: the upper end of the range is one count short.
        step, limit = self.parameters.adc_step, self.parameters.adc_limit
        counts = quantise(received, step) if self.chain.adc else received / step
        return np.clip(counts, -limit, limit - 1)

    def read(self, volts: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Pass a whole record through the interface.

        Args:
            volts: Output of the excitation computer (N, n), V.

        Returns:
            Voltage at the converter (N, n), V, and counts after sample and hold (N, n).
        """
        received = self.receive(volts)
        # All ticks of a hold show the sample of its first one.
        ticks = np.arange(len(volts))
        return received, self.convert(received[ticks - ticks % self.hold])


def deflection(counts: np.ndarray, parameters: HandController) -> np.ndarray:
    """Return stick deflections in volts at the converter: counts, less the deadband.

    Args:
        counts: Converter counts, any shape.
        parameters: The interface. Deflections within its deadband are zero, larger ones start from zero there.

    Returns:
        Deflections, same shape, V.
    """
    volts = parameters.adc_step * counts
    if parameters.deadband == 0.0:
        return volts
    return np.sign(volts) * np.maximum(np.abs(volts) - parameters.deadband, 0.0)
