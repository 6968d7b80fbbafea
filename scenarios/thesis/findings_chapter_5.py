"""Findings of chapter V, F14 and F15, on OKID."""

from dataclasses import replace

import numpy as np

from scenarios.experiments.campaign import single_joint_test
from scenarios.experiments.log_review import settled
from scenarios.thesis.comparison import Comparison
from scenarios.thesis.finding import CLAIMS, Finding, decided_finding
from scenarios.thesis.observer_analysis import ORDER, P, hankel_share, observer
from scenarios.truth.published import PERCENT_DESCRIBED
from sysid import IOData


def percent_described(study: Comparison) -> Finding:
    """F14: order 2 describes 96 to 99.9 percent in OKID's own measure."""
    estimates = {joint: entry.models["okid"].estimate for joint, entry in study.joints.items()}
    shares = {joint: hankel_share(model, ORDER) for joint, model in estimates.items()}
    factor = CLAIMS["F14"].limits["factor"]
    left = {joint: (100 - share, 100 - PERCENT_DESCRIBED[joint]) for joint, share in shares.items()}
    facts = {
        "left": [f"{own:.2g} (printed {printed:.2g})" for own, printed in left.values()],
        "plain": [hankel_share(model, ORDER, power=1) for model in estimates.values()],
        "single": [hankel_share(model, 1) for model in estimates.values()],
        "p": P,
    }
    parts = {joint: printed / factor <= own <= printed * factor for joint, (own, printed) in left.items()}
    return decided_finding("F14", parts, shares, facts)


def without_detrending(study: Comparison) -> Finding:
    """F15: without detrending yaw needs order 4, with extremely poor residuals but fewer observer parameters.

    Orders are chosen as the thesis chooses them, by the share of the squared singular values.
    """
    limits = CLAIMS["F15"].limits
    order, poor = int(limits["order"]), limits["poor"]
    without_mean = study.campaign.single(study.estimation_test, "shoulder_yaw")
    with_mean = settled(study.campaign.log(single_joint_test(study.estimation_test, "shoulder_yaw")), "shoulder_yaw")
    reference = hankel_share(observer(without_mean), ORDER)
    best = _one_step(without_mean, ORDER)
    biased = replace(with_mean, y=with_mean.y + limits["bias"] * np.std(with_mean.y))
    needed, bias_needs = (_order_for(data, reference) for data in (with_mean, biased))
    ratio, bias_ratio = (_one_step(data, order) / best for data in (with_mean, biased))
    own, detrended = (
        max(_markov_parameters_needed(data), least) for data, least in ((with_mean, order), (without_mean, ORDER))
    )
    parts = {
        f"order {order}": needed >= order,
        "extremely poor residuals": ratio >= poor,
        "fewer observer parameters": own < detrended,
    }
    value = {
        "order for the same percent": needed,
        f"residual of order {order} over detrended order {ORDER}": ratio,
        "observer parameters needed": own,
        "observer parameters needed, detrended": detrended,
        "order with a bias of one channel": bias_needs,
        f"residual of order {order} with it": bias_ratio,
    }
    reached = [what for what, does in (("an order", bias_needs >= order), ("residuals", bias_ratio >= poor)) if does]
    facts = {
        "means": [with_mean.u.mean(), with_mean.y.mean()],
        "needed": f"order {bias_needs}" if bias_needs <= P else f"an order above {P}",
        "ratio": bias_ratio,
        "reached": " and ".join(reached) or "neither order nor residuals",
    }
    return decided_finding("F15", parts, value, facts)


def _order_for(data: IOData, percent: float) -> int:
    """Smallest order with this share; one more than can be realised if no order reaches it."""
    estimate, same = observer(data, P), CLAIMS["F15"].limits["same"]
    return next((n for n in range(1, P + 1) if hankel_share(estimate, n) >= percent - same), P + 1)


def _one_step(data: IOData, order: int) -> float:
    return float(np.sqrt(np.mean(observer(data, order).residuals ** 2)))


def _markov_parameters_needed(data: IOData) -> int:
    """Smallest number of observer Markov parameters with an error near that of the largest."""
    limits = CLAIMS["F15"].limits
    numbers = range(1, int(limits["most"]) + 1)
    errors = [float(np.sqrt(observer(data, 1, p).noise_variance[0, 0])) for p in numbers]
    return next(p for p, error in zip(numbers, errors, strict=True) if error <= limits["enough"] * errors[-1])
