"""Chapter V's analysis: Markov parameters, prediction errors, singular values and realisations of observers.

The observer has p = 5 Markov parameters and the model two states for every joint, as in the thesis [Morris1996, ch. V].
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from scenarios.record_figures.observer_errors import ObserverError, observer_errors
from scenarios.thesis.campaign import Campaign
from scenarios.thesis.estimates import estimate, fits
from sysid import Estimate, IOData, StateSpace

P = 5
"""Observer Markov parameters of the thesis [Morris1996, sec. V.2A]."""

ORDER = 2
"""States per joint of the thesis [Morris1996, sec. V.2B]."""


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
