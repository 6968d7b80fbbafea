"""Test for an unstable plant in its loop, which output errors of stable models do not show."""

import math
import warnings
from typing import cast

import numpy as np

from sysid.continuous.output_error_search import OutputFit
from sysid.models.polynomials import Polynomials
from sysid.polynomial.armax import armax
from sysid.records.arrays import FloatArray
from sysid.records.errors import SysidError, SysidWarning

POOR = 0.01  # sum of squares, relative to that of the output about its mean, from which on a fit is poor: 90 %
DEVIATIONS = 4.0  # of the modulus of a pole outside the unit circle, from which on a plant counts as unstable
GROWTH = 5.0  # logarithm of its growth over the record: a pole at one that a random walk has is estimated within 1/N
LONGEST = 10_000  # samples of each experiment that the test uses
MOST_POLES = 6  # of the ARMAX model
STEPS = 30  # of its search


def unstable_plant_messages(fit: OutputFit, output: str) -> list[str]:
    """Message where the fit is poor and an ARMAX model of the same order has a pole that is surely unstable.

    ARMAX predicts one step ahead from measured outputs: a pole outside the unit circle is a pole like others there.
    """
    criterion = fit.criterion
    about_mean = sum(float(np.nansum((e.y - np.nanmean(e.y)) ** 2)) for e in criterion.experiments)
    if fit.minimum.at.cost <= POOR * about_mean:
        return []
    order = sum(structure.poles for structure in criterion.structures)
    if not 1 <= order <= MOST_POLES:
        return []
    records = [experiment[:LONGEST] for experiment in criterion.experiments]
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", SysidWarning)
            estimate = armax(records, order, order, order, 1, max_iterations=STEPS)
    except SysidError:
        return []
    denominator = cast(Polynomials, estimate.polynomials).A
    pole, excess = _outermost(denominator, estimate.covariance)
    if excess < DEVIATIONS or max(map(len, records)) * math.log(abs(pole)) < GROWTH:
        return []
    rate = math.log(abs(pole)) / records[0].dt
    return [
        f"the plant may be unstable at output {output}: armax of order {order} has a pole of modulus {abs(pole):.6g}, "
        f"{excess:.3g} standard deviations outside the unit circle (it grows by {rate:.3g} 1/s), and this model, whose "
        "poles stay stable, fits poorly: use armax(data, ...) or arx(data, ...), and judge one step ahead"
    ]


def _outermost(a: FloatArray, covariance: FloatArray) -> tuple[complex, float]:
    """Outermost root of A (n + 1,), and its distance beyond the unit circle in standard deviations.

    The first parameters that the covariance (p, p) is of are the coefficients of A behind the leading one. A change of
    them moves a simple root p by -sum p^(n - i) da_i / A'(p).
    """
    n = len(a) - 1
    poles = np.roots(a)
    pole = complex(poles[np.argmax(np.abs(poles))]) if len(poles) else 0.0
    if abs(pole) <= 1.0:
        return pole, -math.inf
    movement = -(pole ** np.arange(n - 1, -1, -1)) / np.polyval(np.polyder(a), pole)
    of_modulus = (np.conj(pole) * movement).real / abs(pole)
    variance = float(of_modulus @ covariance[:n, :n] @ of_modulus)
    deviation = math.sqrt(max(variance, np.finfo(float).tiny))
    return pole, (abs(pole) - 1.0) / deviation
