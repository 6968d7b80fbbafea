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
    estimates = {joint: result.models["okid"].estimate for joint, result in study.joints.items()}
    shares = {joint: hankel_share(estimate, ORDER) for joint, estimate in estimates.items()}
    factor = CLAIMS["F14"].limits["factor"]
    verdict_parts = {}
    rests = []
    for joint, share in shares.items():
        # The remainder is compared, not the share, so that one a thousand times smaller than the print does not pass.
        rest, printed_rest = 100 - share, 100 - PERCENT_DESCRIBED[joint]
        verdict_parts[joint] = printed_rest / factor <= rest <= printed_rest * factor
        rests.append(f"{rest:.2g} (printed {printed_rest:.2g})")
    facts = {
        "left": rests,
        "plain": [hankel_share(estimate, ORDER, power=1) for estimate in estimates.values()],
        "single": [hankel_share(estimate, 1) for estimate in estimates.values()],
        "p": P,
    }
    return decided_finding("F14", verdict_parts, shares, facts)


def without_detrending(study: Comparison) -> Finding:
    """F15: without detrending yaw needs order 4, with extremely poor residuals but fewer observer parameters.

    Orders are chosen as the thesis chooses them, by the share of the squared singular values.
    """
    limits = CLAIMS["F15"].limits
    order, poor = int(limits["order"]), limits["poor"]
    without_mean = study.campaign.single(study.estimation_test, "shoulder_yaw")
    with_mean = settled(study.campaign.log(single_joint_test(study.estimation_test, "shoulder_yaw")), "shoulder_yaw")
    # What means the data of the thesis had is not known: a bias of the measurement alone is tried as a cause.
    biased = replace(with_mean, y=with_mean.y + limits["bias"] * np.std(with_mean.y))
    share = hankel_share(observer(without_mean), ORDER)
    residual = _one_step(without_mean, ORDER)
    order_needed, order_needed_biased = _order_for(with_mean, share), _order_for(biased, share)
    ratio, ratio_biased = _one_step(with_mean, order) / residual, _one_step(biased, order) / residual
    # An observer needs at least as many Markov parameters as the model has states.
    parameters = max(markov_parameters_needed(with_mean), order)
    parameters_detrended = max(markov_parameters_needed(without_mean), ORDER)
    verdict_parts = {
        f"order {order}": order_needed >= order,
        "extremely poor residuals": ratio >= poor,
        "fewer observer parameters": parameters < parameters_detrended,
    }
    values = {
        "order for the same percent": order_needed,
        f"residual of order {order} over detrended order {ORDER}": ratio,
        "observer parameters needed": parameters,
        "observer parameters needed, detrended": parameters_detrended,
        "order with a bias of one channel": order_needed_biased,
        f"residual of order {order} with it": ratio_biased,
    }
    reached = []
    if order_needed_biased >= order:
        reached.append("an order")
    if ratio_biased >= poor:
        reached.append("residuals")
    needed_text = f"order {order_needed_biased}" if order_needed_biased <= P else f"an order above {P}"
    facts = {
        "means": [with_mean.u.mean(), with_mean.y.mean()],
        "needed": needed_text,
        "ratio": ratio_biased,
        "reached": " and ".join(reached) or "neither order nor residuals",
    }
    return decided_finding("F15", verdict_parts, values, facts)


def _order_for(data: IOData, percent: float) -> int:
    """Smallest order with this share; one more than can be realised if no order reaches it."""
    estimate = observer(data, P)
    needed = percent - CLAIMS["F15"].limits["same"]
    # With p observer Markov parameters OKID realises at most p states of one joint.
    for order in range(1, P + 1):
        if hankel_share(estimate, order) >= needed:
            return order
    return P + 1


def _one_step(data: IOData, order: int) -> float:
    """Root mean square of the one-step residuals of OKID, rad."""
    return float(np.sqrt(np.mean(observer(data, order).residuals ** 2)))


def markov_parameters_needed(data: IOData) -> int:
    """Smallest number of observer Markov parameters with an error near that of the largest."""
    limits = CLAIMS["F15"].limits
    candidates = range(1, int(limits["most"]) + 1)
    # The error belongs to the observer: the order of the realisation does not enter it.
    errors = [float(np.sqrt(observer(data, 1, p).noise_variance[0, 0])) for p in candidates]
    sufficient_error = limits["enough"] * errors[-1]
    return next(p for p, error in zip(candidates, errors, strict=True) if error <= sufficient_error)
