"""An estimate of a twin's problem as good as any: the best linear truth with the scatter of a measured response."""

import numpy as np
from scipy.linalg import block_diag

from scenarios.problems.twin_best_linear import BestLinear
from scenarios.problems.twin_name import TwinName
from sysid import StateSpace
from sysid.records.arrays import ComplexArray, FloatArray

FUNCTIONS = 8
"""Laguerre functions that are added to the small-signal truth."""

POLE = 0.85
"""Their pole: a time constant of 0.12 s, a bandwidth of about 1 Hz."""


def scattered_model(name: TwinName, truth: StateSpace, best: BestLinear, seed: int) -> StateSpace:
    """Draw one: the small-signal truth and a sum of Laguerre functions [Ljung1999, sec. 4.4].

    The sum is the least-squares fit to the difference of a response that is drawn line by line: the best linear truth,
    with nonlinear distortion that belongs to the waveform and noise that belongs to the record, as large as a response
    without a model has them at this length. What the fit smooths away is made up for: the scatter has the power of what
    was drawn, though on fewer directions.

    Args:
        name: The problem.
        truth: Its small-signal truth.
        best: Its best linear truth.
        seed: Of the draw.
    """
    network = _network(truth.dt)
    path = truth.input_path()
    columns = network.frequency_response(best.frequencies)[:, :, 0]
    basis = np.vstack([columns.real, columns.imag])
    inverse = np.linalg.pinv(basis)
    spacing = best.frequencies[1] - best.frequencies[0]
    periods = name.samples * truth.dt * spacing
    distortion = _drawn(name.waveform_seed(seed), best.distortion_variance)
    noise = _drawn(seed, best.noise_variance / periods)
    missing = best.response - path.frequency_response(best.frequencies)[:, 0, 0]
    # A projection of errors that are equal and independent onto few directions keeps their part of the power.
    factor = np.sqrt(len(basis) / FUNCTIONS)
    weights = inverse @ _parts(missing) + factor * (inverse @ _parts(distortion + noise))
    return StateSpace(
        block_diag(path.A, network.A),
        np.vstack([path.B, network.B]),
        np.hstack([path.C, weights[None, :]]),
        path.D,
        None,
        truth.dt,
        input_names=truth.input_names,
        output_names=truth.output_names,
        input_units=truth.input_units,
        output_units=truth.output_units,
    )


def _network(dt: float) -> StateSpace:
    """Laguerre functions of one input, an output each."""
    step = np.arange(FUNCTIONS)
    lag = step[:, None] - step[None, :]
    below = (1.0 - POLE**2) * (-POLE) ** np.maximum(lag - 1, 0)
    A = np.where(lag > 0, below, np.where(lag == 0, POLE, 0.0))
    B = np.sqrt(1.0 - POLE**2) * (-POLE) ** step
    return StateSpace(A, B[:, None], np.eye(FUNCTIONS), np.zeros((FUNCTIONS, 1)), None, dt)


def _drawn(seed: int, variance: FloatArray) -> ComplexArray:
    """Circular normal errors of these variances, line by line."""
    real, imaginary = np.random.default_rng(seed).standard_normal((2, len(variance)))
    return np.asarray(np.sqrt(0.5 * variance) * (real + 1j * imaginary))


def _parts(values: ComplexArray) -> FloatArray:
    return np.concatenate([values.real, values.imag])
