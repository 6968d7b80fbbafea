"""Chapter V's analysis: Markov parameters, prediction errors, singular values and realisations of observers.

The observer has p = 5 Markov parameters and the model two states for every joint, as in the thesis [Morris1996, ch. V].
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from scenarios.thesis.campaign import Campaign
from scenarios.thesis.estimates import estimate, fits
from sysid import Estimate, IOData, StateSpace

P = 5
"""Observer Markov parameters of the thesis [Morris1996, sec. V.2A]."""

ORDER = 2
"""States per joint of the thesis [Morris1996, sec. V.2B]."""

NUMBERS = (1, 2, 3, 4, 5, 6, 8, 10)
"""Numbers of observer Markov parameters whose prediction errors are compared."""


@dataclass(frozen=True)
class ObserverError:
    """Standard deviations of an observer's errors, relative to that of the output.

    Attributes:
        p: Observer Markov parameters.
        prediction: Of the prediction from p samples before.
        smoothing: Of the estimate from p samples before and p after.
    """

    p: int
    prediction: float
    smoothing: float


@dataclass(frozen=True)
class Share:
    """Share of the response that a number of states carries, in three measures.

    Attributes:
        order: Number of states.
        squared: The thesis' measure: percent of the squared Hankel singular values.
        unsquared: Percent of the singular values themselves.
        simulation: Fit of the model of that order to the record in simulation, percent.
        one_step: The same one step ahead.
    """

    order: int
    squared: float
    unsquared: float
    simulation: float
    one_step: float


@dataclass(frozen=True, eq=False)
class JointObserver:
    """Observers of one joint from the PRBS test, beside that of the study, `JointResult.models["okid"]`.

    Attributes:
        shares: What one to five states hold.
        errors: Prediction errors over the number of observer Markov parameters; none unless the study is thorough.
    """

    shares: tuple[Share, ...]
    errors: tuple[ObserverError, ...]


def observe(joint: str, campaign: Campaign, *, thorough: bool = True) -> JointObserver:
    """Observers with one to five states from the estimation test and, if thorough, errors over the number p."""
    data = campaign.own(joint)
    # An observer with p Markov parameters realises at most p states.
    shares = tuple(_share(data, order) for order in range(1, P + 1))
    errors = observer_errors(data) if thorough else ()
    return JointObserver(shares, errors)


def observer_errors(data: IOData, numbers: tuple[int, ...] = NUMBERS) -> tuple[ObserverError, ...]:
    """Prediction and smoothing errors of observers, in parts of the output's standard deviation, a row for each number.

    The thesis does not say what its smoothing error is; it is read as that of the best linear estimate of a sample from
    p samples of input and output on both sides of it.
    """
    spread = float(np.std(data.y))
    errors = []
    for p in numbers:
        # The error is that of the observer: the order of the realisation does not enter it.
        prediction = float(np.sqrt(observer(data, 1, p).noise_variance[0, 0]))
        errors.append(ObserverError(p, prediction / spread, _smoothing_error(data, p) / spread))
    return tuple(errors)


def observer(data: IOData, order: int = ORDER, p: int = P) -> Estimate:
    """An observer model; its diagnostics hold its warnings."""
    return estimate(data, "okid", (order, p))


def hankel_share(model: Estimate, order: int, power: int = 2) -> float:
    """Share of the Hankel singular values, squared as in the thesis, in the first `order` of them, percent."""
    values = np.asarray(model.diagnostics["hankel_singular_values"], dtype=float) ** power
    return float(100.0 * values[:order].sum() / values.sum())


def observer_poles(model: StateSpace) -> NDArray[np.complex128]:
    """Eigenvalues of A + G C, largest modulus first; all at the origin for a deadbeat observer."""
    values = np.linalg.eigvals(model.A - model.gain @ model.C).astype(complex)
    # Stable: the two of a conjugate pair, equal in modulus, stay in the order of the solver.
    return values[np.argsort(-np.abs(values), kind="stable")]


def _share(data: IOData, order: int) -> Share:
    """What a number of states holds of the response, in the three measures."""
    model = observer(data, order)
    fit = fits(model, data)
    return Share(
        order=order,
        squared=hankel_share(model, order),
        unsquared=hankel_share(model, order, 1),
        simulation=fit.simulation,
        one_step=fit.one_step,
    )


def _smoothing_error(data: IOData, p: int) -> float:
    """Standard deviation of the best linear estimate's error from p samples of u and y on both sides, rad."""
    windows = np.lib.stride_tricks.sliding_window_view(np.hstack((data.u, data.y)), 2 * p + 1, axis=0)
    # The measurement that is estimated stands in the middle of the second half, the outputs: it must not help.
    columns = np.delete(windows.reshape(len(windows), -1), windows.shape[2] + p, axis=1)
    target = data.y[p : len(data) - p, 0]
    return float(np.std(target - columns @ np.linalg.lstsq(columns, target, rcond=None)[0]))
