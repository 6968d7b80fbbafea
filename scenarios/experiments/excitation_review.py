"""Review of an excitation before it is played: its numbers, and what it is not good for."""

import numpy as np

from hmtb_twin.control.data_acquisition import BOARD
from scenarios.experiments.excitation_computer import FILE, MISSES_POINTS, Excitation
from scenarios.experiments.model_structures import excitation_order_warning
from scenarios.files.errors import ScenarioError

LEAST_DENSITY = 1e-200
"""Density of the strongest line below which nothing is excited, V^2/Hz: no rounding to zero can be told from it."""


def check_excites(excitation: Excitation) -> None:
    """Refuse an excitation whose spectrum is zero.

    Raises:
        ScenarioError: It is.
    """
    wave = excitation.waveform()
    # Density, not amplitude: a sine sampled at its zeros excites nothing either.
    if wave.psd().density.max() < LEAST_DENSITY:
        word = FILE if excitation.kind == "points" else excitation.kind
        peak = np.abs(wave.points).max()
        raise ScenarioError(f"{word} of amplitude {peak:g} V excites nothing: expected a larger amplitude")


def excitation_summary(excitation: Excitation) -> dict[str, float | int]:
    """Return the numbers of one period by name: rates in Hz, times in s, voltages in V."""
    wave = excitation.waveform()
    return {
        "update_rate_hz": wave.update_rate,
        "period_s": wave.period,
        "order_of_excitation": wave.order_of_excitation(),
        "mean_v": float(wave.points.mean()),
        "rms_v": float(np.sqrt(np.mean(wave.points**2))),
    }


def excitation_rows(excitation: Excitation) -> list[tuple[str, str]]:
    """Return `excitation_summary` as rows of a table, each with its unit."""
    summary = excitation_summary(excitation)
    mean = round(summary["mean_v"], 12) + 0.0  # what rounding leaves of a sum that is zero is none, nor is its sign
    return [
        ("update rate / Hz", f"{summary['update_rate_hz']:.6g}"),
        ("period / s", f"{summary['period_s']:.6g}"),
        ("order of excitation", str(summary["order_of_excitation"])),
        ("mean / V", f"{mean:.6g}"),
        ("root mean square / V", f"{summary['rms_v']:.6g}"),
    ]


def excitation_warnings(excitation: Excitation) -> list[str]:
    """Return one line each for points beyond the converter, points missed, and an order that is too low."""
    wave = excitation.waveform()
    beyond = int(BOARD.exceeds_range(wave.points).sum())
    warnings = []
    if beyond:
        warnings.append(
            f"{beyond} of {len(wave.points)} points ask for more than the ±{BOARD.dac_range:g} V of the excitation "
            "computer's converter, which cuts them off"
        )
    if excitation.misses_points:
        warnings.append(MISSES_POINTS)
    order_warning = excitation_order_warning(wave.order_of_excitation())
    if order_warning:
        warnings.append(order_warning)
    return warnings
