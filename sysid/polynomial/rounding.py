"""Warning where outputs are rounded so coarsely that least squares is biased."""

from collections.abc import Sequence

import numpy as np

from sysid.polynomial.orders import Orders
from sysid.records.arrays import FloatArray
from sysid.records.data import IOData
from sysid.records.resolution import FEWEST_LEVELS, resolution

BIASED = 0.5  # bias in standard deviations from which intervals are known to fail: 95 % ones hold in 92 % of records
LOOKED_AT = 64  # samples that show whether an output is rounded at all: sorting a long record costs as much as the fit


def rounding_messages(
    experiments: Sequence[IOData], orders: Orders, theta: FloatArray, covariance: FloatArray, variance: float
) -> list[str]:
    """Describe the bias that rounded outputs give an estimate of A by least squares.

    Rounding to steps q is about white noise of variance q^2 / 12 in every output [Widrow2008], which the equations do
    not allow for in past ones: with R the sum of the regressors' squares, variance / covariance, the estimate is off by
    -R^-1 N q^2 / 12 (a1, ..., an, 0, ...)'.

    Args:
        experiments: The records of the fit, with one output.
        orders: Orders; others than of A and B are zero.
        theta: Parameters (p,).
        covariance: Of white errors (p, p).
        variance: Of the errors.
    """
    if not orders.na or not variance > 0.0 or not np.isfinite(covariance).all():
        return []
    step = max(_step(e.y[:, 0]) for e in experiments)
    if not step > 0.0:
        return []
    samples = sum(int(np.isfinite(e.y[e.window :, 0]).sum()) for e in experiments)
    of_a = slice(0, orders.na)
    bias = covariance[:, of_a] @ theta[of_a] * samples * (step**2 / 12.0) / variance
    deviations = np.sqrt(np.diag(covariance))
    in_deviations = np.abs(bias[deviations > 0.0]) / deviations[deviations > 0.0]
    worst = float(in_deviations.max(initial=0.0))
    if not worst > BIASED:
        return []
    return [
        f"the output is rounded to steps of {step:.3g}, which biases least squares by up to {worst:.2g} standard "
        "deviations: intervals do not hold; an estimate of the noise as well, with as many coefficients of C as of A, "
        "has no such bias (armax, arma), nor have iv4 and oe"
    ]


def _step(y: FloatArray) -> float:
    """Step of an output, 0 where there is none."""
    beginning = y[:LOOKED_AT]
    if len(np.unique(beginning[np.isfinite(beginning)])) >= FEWEST_LEVELS and not resolution(beginning):
        return 0.0
    return resolution(y)
