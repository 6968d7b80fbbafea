"""How far a response is from the best linear truth of a joint, or from another response."""

from collections.abc import Mapping

import numpy as np

from scenarios.thesis.comparison import JointResult
from sysid import StateSpace


def best_linear_at(result: JointResult, frequencies: np.ndarray) -> np.ndarray:
    """Return the best linear truth of a joint at frequencies in Hz (n,), complex.

    It was measured on lines: in between the small-signal truth is corrected by the ratio of the two, which varies
    slowly; below and above the lines the ratio is held.
    """
    lines = result.best_linear.response.frequencies
    ratio = result.best_linear.response.response[:, 0, 0] / response_of(result.truth.model, lines)
    interpolated = np.interp(frequencies, lines, ratio.real) + 1j * np.interp(frequencies, lines, ratio.imag)
    return np.asarray(response_of(result.truth.model, frequencies) * interpolated)


def response_of(model: StateSpace, frequencies: np.ndarray) -> np.ndarray:
    """Return the response of a model of one input and one output at frequencies in Hz (n,), complex."""
    return np.asarray(model.frequency_response(frequencies)[:, 0, 0])


def logarithmic_grid(low: float, high: float) -> np.ndarray:
    """Return frequencies between two, Hz, with the same weight for every octave (100,)."""
    # A Bode plot is read on such an axis, and it is Bode plots that the thesis calls comparable.
    return np.geomspace(low, high, 100)


def largest_differences(response: np.ndarray, reference: np.ndarray) -> tuple[float, float]:
    """Return the largest difference of gain, dB, and of phase, degrees, between two responses (n,)."""
    # The angle of the ratio lies within half a turn, where the difference of two unwrapped phases may be off by turns.
    ratio = response / reference
    decibel = float(20 * np.abs(np.log10(np.abs(ratio))).max())
    degrees = float(np.abs(np.degrees(np.angle(ratio))).max())
    return decibel, degrees


def agree(differences: tuple[float, float], limits: Mapping[str, float]) -> bool:
    """Whether differences of gain and phase are both below a claim's limits `decibel` and `degrees`."""
    decibel, degrees = differences
    return decibel < limits["decibel"] and degrees < limits["degrees"]


def differences_by_name(name: str, differences: tuple[float, float]) -> dict[str, float]:
    """Name differences of gain and phase for the numbers of a finding."""
    decibel, degrees = differences
    return {f"{name}, dB": decibel, f"{name}, degrees": degrees}


def error_percent(response: np.ndarray, truth: np.ndarray) -> float:
    """Return the distance of a response (n,) from the true one over the norm of the true one, percent."""
    return float(100 * np.linalg.norm(response - truth) / np.linalg.norm(truth))
