"""Findings of chapter V, on OKID."""

from dataclasses import replace

import numpy as np

from scenarios.preparation import settled
from scenarios.published import PERCENT_DESCRIBED
from scenarios.thesis.campaign import single_joint_test
from scenarios.thesis.comparison import Comparison
from scenarios.thesis.finding import Finding, decided, verdict
from scenarios.thesis.held_out import held_out
from scenarios.thesis.observer_analysis import ORDER, P, described, observer
from sysid import IOData

SLACK = 0.5
"""Percent below the printed share that is still counted as it."""

SAME = 0.01
"""Percent by which two shares may differ and be called the same."""

POOR = 2.0
"""Residuals that are this many times those with detrending are called extremely poor."""

ENOUGH = 1.05
"""An observer has enough Markov parameters where its prediction error is at most this times that with `MOST`."""

MOST = 10

THESIS_ORDER = 4
"""Order that the thesis needs without detrending [Morris1996, sec. V.2C]."""

OFFSET = 0.1
"""Constant added to the measurement to see what a bias of one channel alone would do, rad."""


def percent_described(study: Comparison) -> Finding:
    """F14: order 2 describes 96 to 99.9 percent in OKID's own measure."""
    entries = study.observers.joints
    found = {name: described(entry.estimate, ORDER) for name, entry in entries.items()}
    parts = [found[name] >= PERCENT_DESCRIBED[name] - SLACK for name in found]
    plain = ", ".join(f"{described(entry.estimate, ORDER, power=1):.1f}" for entry in entries.values())
    single = ", ".join(f"{described(entry.estimate, 1):.1f}" for entry in entries.values())
    fits = ", ".join(f"{held_out(study, entry.models['okid']):.1f}" for entry in study.joints.values())
    return decided(
        "F14",
        verdict(sum(parts), len(parts)),
        found,
        "percent of the squared Hankel singular values that two states hold; passes from half a point below the "
        "printed share on",
        f"the measure is lenient: with p = {P} there are no more than {P} singular values, and squaring hides the "
        f"small ones; one state alone holds {single} %, two hold {plain} % of the values unsquared, and models of two "
        f"states fit the tests not seen by {fits} % (median, in simulation)",
    )


def without_detrending(study: Comparison) -> Finding:
    """F15: without detrending yaw needs order 4, with extremely poor residuals but fewer observer parameters.

    Orders are chosen as the thesis chooses them, by the share of the squared singular values.
    """
    without_mean = study.campaign.single(study.estimation_test, "shoulder_yaw")
    with_mean = settled(study.campaign.log(single_joint_test(study.estimation_test, "shoulder_yaw")), "shoulder_yaw")
    wanted = described(observer(without_mean), ORDER)
    needed = _order_for(with_mean, wanted)
    best = _one_step(without_mean, ORDER)
    ratio = _one_step(with_mean, THESIS_ORDER) / best
    parameters = {
        "with": max(_enough(with_mean), THESIS_ORDER),
        "without": max(_enough(without_mean), ORDER),
    }
    parts = [needed >= THESIS_ORDER, ratio >= POOR, parameters["with"] < parameters["without"]]
    biased = replace(with_mean, y=with_mean.y + OFFSET)
    bias_needs, bias_ratio = _order_for(biased, wanted), _one_step(biased, THESIS_ORDER) / best
    explained = {
        (True, True): "such a bias would explain both the order and the residuals",
        (True, False): "such a bias would explain the order, not the residuals",
        (False, True): "such a bias would explain the residuals, not the order",
        (False, False): "not even such a bias would explain what the thesis saw",
    }[bias_needs >= THESIS_ORDER, bias_ratio >= POOR]
    return decided(
        "F15",
        verdict(sum(parts), len(parts)),
        {
            "order for the same percent": float(needed),
            "residual of order 4 over detrended order 2": ratio,
            "observer parameters needed": float(parameters["with"]),
            "observer parameters needed, detrended": float(parameters["without"]),
        },
        f"order with the share of order {ORDER} detrended, to {SAME:g} points ({THESIS_ORDER} expected); root mean "
        f"square of one-step residuals ({POOR:g} times or more expected); observer parameters for an error within "
        f"{100 * (ENOUGH - 1):.0f} % of that with {MOST} (fewer expected); PRBS test",
        f"command and measurement have the same mean of {with_mean.y.mean():.3g} rad here and the gain at 0 Hz is one, "
        f"so little is left for further states to carry, though order {ORDER} leaves "
        f"{_one_step(with_mean, ORDER) / best:.3g} times the residual. With the measurement {OFFSET:g} rad off the "
        f"command, {_ordinal(bias_needs)} is needed and the residual of order {THESIS_ORDER} is {bias_ratio:.3g} times "
        f"that with detrending: {explained}",
    )


def _order_for(data: IOData, percent: float) -> int:
    """Smallest order that describes so much; one more than can be realised if none does."""
    found = observer(data, P)
    return next((n for n in range(1, P + 1) if described(found, n) >= percent - SAME), P + 1)


def _ordinal(order: int) -> str:
    return f"order {order}" if order <= P else f"an order above {P}"


def _one_step(data: IOData, order: int) -> float:
    return float(np.sqrt(np.mean(observer(data, order).residuals ** 2)))


def _enough(data: IOData) -> int:
    """Smallest number of observer Markov parameters with an error near that of `MOST`."""
    errors = [float(np.sqrt(observer(data, 1, p).noise_variance[0, 0])) for p in range(1, MOST + 1)]
    return next(p for p, error in enumerate(errors, start=1) if error <= ENOUGH * errors[-1])
