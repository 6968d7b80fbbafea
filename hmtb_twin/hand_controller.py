"""The hand-controller interface: noisy volts in, held and quantised counts out."""

from dataclasses import dataclass

import numpy as np

from hmtb_twin.parameters import HandController


def quantise(signal: np.ndarray, step: float) -> np.ndarray:
    """Round a signal to whole converter counts.

    Args:
        signal: Any shape, in the unit of `step`.
        step: Size of one count.

    Returns:
        The counts, integers held as float64, same shape.
    """
    return np.rint(signal / step)


@dataclass(frozen=True)
class StickRecord:
    """What passes through the hand controller, per excited axis.

    Attributes:
        volts: Voltage at the converter, noise and bias included, (N, n) V.
        counts: Converter counts after sample and hold, (N, n).
        angle: Commanded offset from the operating pose, (N, n) rad.
    """

    volts: np.ndarray
    counts: np.ndarray
    angle: np.ndarray


def read_stick(
    volts: np.ndarray,
    parameters: HandController,
    rng: np.random.Generator,
    *,
    noise: bool,
    quantisation: bool,
) -> StickRecord:
    """Pass volts through the hand-controller interface.

    Noise and bias are picked up by the wires, the converter saturates and rounds, its processor holds each sample,
    and a small gain makes the commanded angle [Morris1996, III.2A, III.2C and III.4].

    Args:
        volts: Output of the excitation computer, (N, n) V.
        parameters: The interface.
        rng: Source of noise and bias; the same number of draws is made whether noise is on or off.
        noise: Whether noise and bias act.
        quantisation: Whether the converter rounds; it saturates either way.

    Returns:
        The signals along the way.
    """
    bias = parameters.bias * rng.standard_normal(volts.shape[1])
    pickup = parameters.noise * rng.standard_normal(volts.shape)
    received = volts + bias + pickup if noise else volts.copy()
    ticks = np.arange(len(volts))
    held = received[ticks - ticks % parameters.hold]
    step = parameters.adc_step
    limit = 2 ** (parameters.adc_bits - 1)
    counts = np.clip(quantise(held, step) if quantisation else held / step, -limit, limit - 1)
    return StickRecord(received, counts, parameters.gain * step * counts)
