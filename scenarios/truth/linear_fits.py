"""Linear systems fitted to one record: pulse responses, regressions, and models of low and of high order."""

import contextlib
import warnings
from collections.abc import Iterable
from dataclasses import replace

import numpy as np

from sysid import Estimate, IOData, StateSpace, SysidError, SysidWarning, oe, pem_ss, predict
from sysid.polynomial.least_squares import tall_least_squares
from sysid.polynomial.long_arx import long_arx_simulation
from sysid.records.arrays import FloatArray

MATTERS = 1e-4
"""States with a Hankel singular value below this part of the largest change no output beyond the resolver's noise."""

MOST_STEPS = 100
"""Steps after which a search ends, the minimum or not."""

DEPENDENT = 1e-12
"""Relative cut-off of dependent columns: a waveform that repeats within the memory has the same lags twice."""


def pulse_responses(commands: FloatArray, target: FloatArray, memory: int, first: int) -> FloatArray:
    """Fit y(t) = c + sum over j and k = 0 ... memory of g_j(k) u_j(t - k), and return the fitted output.

    Args:
        commands: Inputs u_j (N, m), at rest before the record.
        target: Output y (N,).
        memory: Length of the pulse responses g_j.
        first: First sample that is fitted; before it the output returned is the target itself.
    """
    regressors = np.hstack([*(_lagged(signal, memory, first=0) for signal in commands.T), np.ones((len(target), 1))])
    return _fitted(regressors, target, first)


def one_step_regression(offsets: IOData, target: FloatArray, memory: int, first: int) -> FloatArray:
    """Fit lags 0 to `memory` of the inputs and 1 to `memory` of the output to a target; see `pulse_responses`."""
    input_lags = [_lagged(signal, memory, first=0) for signal in offsets.u.T]
    output_lags = _lagged(offsets.y[:, 0], memory, first=1)
    return _fitted(np.hstack([*input_lags, np.ones((len(target), 1)), output_lags]), target, first)


def high_order_simulations(noise_free: IOData, orders: Iterable[int]) -> list[FloatArray]:
    """Simulate ARX models of high orders fitted to noise-free angles (N,); those that grow without bound are left out.

    They remember longer than pulse responses of as many coefficients, and their fit needs no search.
    """
    simulations = [long_arx_simulation(noise_free.u, noise_free.y[:, 0], order) for order in orders]
    return [simulation for simulation in simulations if simulation is not None]


def right_order_fits(model: StateSpace, noise_free: IOData, steps: int | None) -> tuple[int, list[FloatArray]]:
    """Simulate output-error models of the truth's order fitted to noise-free angles.

    Args:
        model: The small-signal truth.
        noise_free: Commands and noise-free angle of one joint, without means.
        steps: Most steps of the first search, which then is the only one; None lets every search go to its end.

    Returns:
        The order, and an output (N,) of each search that did not fail.
    """
    # States that the output does not show would give the search parameters without effect.
    start = replace(model, K=None).minimal(MATTERS)
    max_iterations = steps or MOST_STEPS

    def search_from_truth() -> Estimate:
        return pem_ss(noise_free, start, direct=False, gain=False, search=False, max_iterations=max_iterations)

    def search_from_estimates() -> Estimate:
        return oe(noise_free, start.order, start.order, 1, max_iterations=max_iterations, coloured=False)

    # The criterion has several minima where the record is distorted, so the search begins at several places.
    searches = [search_from_truth]
    if noise_free.nu == 1:
        # It has initial estimates of its own, which often lead further down than the truth does.
        searches.insert(0, search_from_estimates)
    outputs: list[FloatArray] = []
    with warnings.catch_warnings():
        # Warnings of poor excitation are about parameters; here only the output counts.
        warnings.simplefilter("ignore", SysidWarning)
        for search in searches:
            with contextlib.suppress(SysidError):
                outputs.append(predict(search(), noise_free, steps=None)[:, 0])
                # With few steps asked for, speed matters more than the last percent.
                if steps is not None:
                    break
    return start.order, outputs


def _lagged(signal: FloatArray, memory: int, *, first: int) -> FloatArray:
    """Columns signal(t - first), ..., signal(t - memory); zero before the record."""
    padded = np.concatenate([np.zeros(memory), signal])
    windows = np.lib.stride_tricks.sliding_window_view(padded, memory + 1)[:, ::-1]
    return windows[:, first:]


def _fitted(regressors: FloatArray, target: FloatArray, first: int) -> FloatArray:
    """Least squares from a sample on; the prediction of all, before that sample the target itself."""
    solution = tall_least_squares(regressors[first:], target[first:], cond=DEPENDENT)
    return np.concatenate([target[:first], regressors[first:] @ solution])
