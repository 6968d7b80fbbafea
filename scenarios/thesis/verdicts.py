"""Rules on fits and residuals: the margin of a tie, whiteness, dependence and coupling of residuals."""

from collections.abc import Mapping

import numpy as np

import sysid
from hmtb_twin import STUDIED_JOINTS
from scenarios.thesis.finding import CLAIMS
from scenarios.thesis.multivariable import LAGS, LEVEL, ThreeJointModel, Way
from sysid import IOData, ResidualTest, StateSpace

MARGIN = CLAIMS["F11"].limits["tie"]
"""Fits that differ by less are tied, percentage points: the thesis reads fits off its plots to no more digits."""

WORDS: Mapping[Way, str] = {"simulation": "in simulation", "one_step": "one step ahead"}


def ahead(difference: float) -> bool:
    """Whether a fit, less another, percentage points, is ahead of it by more than a tie."""
    return difference >= MARGIN


def tied(difference: float) -> bool:
    """Whether two fits that differ by so many percentage points are tied."""
    return abs(difference) < MARGIN


def without_noise_model(model: ThreeJointModel) -> str:
    """Name the joints of a model that cannot predict."""
    without = [joint.replace("_", " ") for joint in model.blocks if not model.predicts(joint)]
    if not without:
        return f"every joint of the {model.name} has a noise model"
    return f"the {model.name} has K = 0 on {' and '.join(without)}, where one step ahead is simulation again"


def outside_share(test: ResidualTest) -> dict[str, float]:
    """Share of the lags of a joint's residual outside the bounds."""
    lags = len(test.lags) - 1
    return {joint: float(test.outside_whiteness[i]) / lags for i, joint in enumerate(STUDIED_JOINTS)}


def dependence(test: ResidualTest) -> tuple[float, float]:
    """Share of lags 1 to 14, and from 15 on, at which yaw's residual and its input correlate beyond the bounds."""
    outside = np.abs(test.cross_correlation[:, 0, 0]) > test.independence_bound[0, 0]
    # The thesis finds the correlation "at lags below 15" [Morris1996, sec. VI.4].
    early, late = (test.cross_lags >= 1) & (test.cross_lags < 15), test.cross_lags >= 15
    return float(outside[early].mean()), float(outside[late].mean())


def beyond_yaw(u: np.ndarray, inputs: list[int]) -> tuple[np.ndarray, float]:
    """Return what no filter of yaw's input over `LAGS` samples either way explains of the pitch inputs.

    Inputs are u (N, 3); the remainders are (N - 2 LAGS, n), beside the least share of an input's variance that remains.
    """
    lagged = np.lib.stride_tricks.sliding_window_view(u[:, 0], 2 * LAGS + 1)
    # Only these samples have all lags on both sides.
    middle = u[LAGS : len(u) - LAGS, inputs]
    # The best filter by least squares: shared waveforms differ between the axes by dynamics and noise only.
    remainder = middle - lagged @ np.linalg.lstsq(lagged, middle, rcond=None)[0]
    return remainder, float((remainder.var(axis=0) / middle.var(axis=0)).min())


def largest_correlation(errors: np.ndarray, u: np.ndarray, dt: float) -> tuple[float, float]:
    """Largest correlation of residuals (N,) with the past of inputs (M, n), and the 99 % bound of that input.

    The inputs are those of the middle of the N samples, dt seconds apart.
    """
    cut, inputs = (len(errors) - len(u)) // 2, u.shape[1]
    # A model that predicts zero: the "output" is itself the residual that is tested against these inputs.
    zero = StateSpace(np.zeros((0, 0)), np.zeros((0, inputs)), np.zeros((1, 0)), np.zeros((1, inputs)), None, dt)
    test = sysid.resid(zero, IOData(u, errors[cut : cut + len(u), None], dt), lags=LAGS, level=LEVEL)
    peaks = np.abs(test.cross_correlation[test.cross_lags >= 0, 0]).max(axis=0)
    # In proportion to its bound, which depends on the colour of each input.
    largest = int(np.argmax(peaks / test.independence_bound[0]))
    return float(peaks[largest]), float(test.independence_bound[0, largest])
