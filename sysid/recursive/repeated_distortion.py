"""Intervals of bandwidth and delay where the input repeats: with nonlinear distortion and too low an order."""

import numpy as np

from sysid.records.arrays import FloatArray
from sysid.records.data import IOData
from sysid.records.repetition import Repetition
from sysid.recursive.servo_quantities import ServoQuantities
from sysid.recursive.stretch_fit import StretchFit, gradient_rows
from sysid.validation.misfit_posterior import Hypotheses, Lines
from sysid.validation.model_error import HIGHEST, LOWEST, REACH, lines_needed, posterior_at
from sysid.validation.simulation_lines import lines_of_mean_periods


def half_widths(
    fit: StretchFit,
    stretch: tuple[FloatArray, FloatArray, int],
    group: Repetition,
    quantities: ServoQuantities,
) -> FloatArray | None:
    """Half-widths of the 95 % intervals of log bandwidth and delay (2,) for the best linear system of a stretch.

    One period has few lines, and a nonlinearity leaves an error at each of them that no further period averages away.
    The errors of the simulation in the mean period tell its size, as in `sysid.model_error` [Goodwin1992].

    Args:
        fit: The model of the stretch, with a bandwidth.
        stretch: Input and output (N,) with the samples before it, and the number of its first sample.
        group: The periods of the input in the stretch.
        quantities: Bandwidth and delay of a model.

    Returns:
        The half-widths; None where the period has too few lines to tell.
    """
    u, y, begin = stretch
    n = fit.order
    columns, errors = gradient_rows(u, y, begin, quantities.nk, fit.B, fit.F)
    errors = errors - columns[:, 2 * n :] @ fit.nuisance
    record = IOData(u[begin:], errors, quantities.dt)
    spectra = lines_of_mean_periods([record], [errors], [group])
    responses, changes = quantities.relative_changes(fit.B, fit.F, spectra.frequencies)
    steps = fit.directions[: 2 * n]
    # All relative to the model's gain: what passes through the model has that of the input.
    turned = spectra.inputs[:, 0] * responses / np.abs(responses)
    relative_errors = spectra.errors / np.abs(responses)
    lines = Lines(
        spectra.frequencies,
        turned[:, None],
        relative_errors,
        changes @ steps * turned[:, None],
        variances=None,
        freedom=0.0,
    )
    if len(lines) < lines_needed(lines):
        return None

    def at(hz: float) -> Hypotheses:
        """The posterior at a frequency."""
        _, of_model = quantities.relative_changes(fit.B, fit.F, np.array([hz]))
        return posterior_at(lines, hz, of_model @ steps)

    (log_hz, delay), _ = quantities(fit.B, fit.F)
    hz = float(np.exp(log_hz))
    there = at(hz)
    of_gain = _half_width(there.log_gain_quantile(0, LOWEST), there.log_gain_quantile(0, HIGHEST))
    if not quantities.knows_gain:
        # the level follows the gain at 0 Hz, of which the lowest line tells most
        lowest = at(float(lines.frequencies.min()) / REACH)
        of_level = _half_width(lowest.log_gain_quantile(0, LOWEST), lowest.log_gain_quantile(0, HIGHEST))
        of_gain = float(np.hypot(of_gain, of_level))
    of_phase = _half_width(there.phase_quantile(0, LOWEST), there.phase_quantile(0, HIGHEST))
    slope, turn = quantities.along(fit.B, fit.F, hz)
    of_log_hz = of_gain / abs(slope)
    # the delay changes with the phase, and with the frequency at which it is taken
    angular = 2.0 * np.pi * hz
    of_delay = np.hypot(of_phase / angular, (turn / angular + delay) * of_log_hz)
    return np.array([of_log_hz, of_delay])


def _half_width(low: float, high: float) -> float:
    """Half the width of an interval."""
    return 0.5 * (high - low)
