"""Findings of chapter V, F14 and F15, on OKID."""

from dataclasses import replace

import numpy as np

from scenarios.experiments.campaign import single_joint_test
from scenarios.experiments.log_review import settled
from scenarios.thesis.comparison import Comparison
from scenarios.thesis.finding import CLAIMS, Finding, decided_finding, words
from scenarios.thesis.observer_analysis import ORDER, P, hankel_share, observer
from scenarios.truth.published import PERCENT_DESCRIBED
from sysid import IOData


def percent_described(study: Comparison) -> Finding:
    """F14: order 2 describes 96 to 99.9 percent in OKID's own measure."""
    entries = study.observers
    shares = {name: hankel_share(entry.estimate, ORDER) for name, entry in entries.items()}
    factor = CLAIMS["F14"].limits["factor"]
    left = {name: (100 - value, 100 - PERCENT_DESCRIBED[name]) for name, value in shares.items()}
    plain = ", ".join(f"{hankel_share(entry.estimate, ORDER, power=1):.1f}" for entry in entries.values())
    single = ", ".join(f"{hankel_share(entry.estimate, 1):.1f}" for entry in entries.values())
    return decided_finding(
        "F14",
        {words(name): printed / factor <= own <= printed * factor for name, (own, printed) in left.items()},
        shares,
        f"What two states leave is {', '.join(f'{own:.2g} (printed {printed:.2g})' for own, printed in left.values())} "
        f"% of the squares. One state alone holds {single} %, two hold {plain} % of the values unsquared; with p = {P} "
        f"there are no more than {P}",
    )


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
    parameters = {
        "with": max(_markov_parameters_needed(with_mean), order),
        "without": max(_markov_parameters_needed(without_mean), ORDER),
    }
    reached = [what for what, does in (("an order", bias_needs >= order), ("residuals", bias_ratio >= poor)) if does]
    return decided_finding(
        "F15",
        {
            f"order {order}": needed >= order,
            "extremely poor residuals": ratio >= poor,
            "fewer observer parameters": parameters["with"] < parameters["without"],
        },
        {
            "order for the same percent": float(needed),
            f"residual of order {order} over detrended order {ORDER}": ratio,
            "observer parameters needed": float(parameters["with"]),
            "observer parameters needed, detrended": float(parameters["without"]),
            "order with a bias of one channel": float(bias_needs),
            f"residual of order {order} with it": bias_ratio,
        },
        f"Command and measurement have means of {with_mean.u.mean():.4g} and {with_mean.y.mean():.4g} rad; what the "
        "thesis' data held is not known",
        cause=f"with a bias of {limits['bias']:g} standard deviations added to the measurement "
        f"{f'order {bias_needs}' if bias_needs <= P else f'an order above {P}'} is needed and the residual of order "
        f"{order} is {bias_ratio:.3g} times that detrended, so such a bias gives "
        f"{' and '.join(reached) or 'neither order nor residuals'} as the thesis reports",
    )


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
