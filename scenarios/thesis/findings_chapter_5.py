"""Findings of chapter V, on OKID."""

from dataclasses import replace

import numpy as np

from scenarios.experiments.campaign import single_joint_test
from scenarios.experiments.log_review import settled
from scenarios.files.errors import MissingRecordError
from scenarios.thesis.comparison import Comparison, ModelResult
from scenarios.thesis.finding import Finding, decided_finding, verdict
from scenarios.thesis.observer_analysis import ORDER, P, hankel_share, observer
from scenarios.thesis.verdicts import held_out
from scenarios.truth.published import PERCENT_DESCRIBED
from sysid import IOData

SLACK = 0.5
"""Tolerance below the printed share, percentage points."""

SAME = 0.01
"""Largest difference of two equal shares, percentage points."""

POOR = 2.0
"""Residuals that are this many times those with detrending are called extremely poor."""

ENOUGH = 1.05
"""An observer has enough Markov parameters where its prediction error is at most this times that with `MOST`."""

MOST = 10

THESIS_ORDER = 4
"""Order that the thesis needs without detrending [Morris1996, sec. V.2C]."""

OFFSET = 0.1
"""Constant added to the measurement to show the effect of a bias of one channel, rad."""


def percent_described(study: Comparison) -> Finding:
    """F14: order 2 describes 96 to 99.9 percent in OKID's own measure."""
    entries = study.observers.joints
    shares = {name: hankel_share(entry.estimate, ORDER) for name, entry in entries.items()}
    parts = [shares[name] >= PERCENT_DESCRIBED[name] - SLACK for name in shares]
    plain = ", ".join(f"{hankel_share(entry.estimate, ORDER, power=1):.1f}" for entry in entries.values())
    single = ", ".join(f"{hankel_share(entry.estimate, 1):.1f}" for entry in entries.values())
    fits = ", ".join(_held_out(study, entry.models["okid"]) for entry in study.joints.values())
    remainders = ", ".join(
        f"{100 - value:.2g} (printed {100 - PERCENT_DESCRIBED[name]:.2g})" for name, value in shares.items()
    )
    return decided_finding(
        "F14",
        verdict(sum(parts), len(parts)),
        shares,
        "percent of the squared Hankel singular values that two states hold; read as: at least so much, and passed "
        f"from {SLACK:g} points below the printed share on",
        f"what two states do not describe is {remainders} % of them. The measure is lenient: with p = {P} there are no "
        f"more "
        f"than {P} singular values, and squaring hides the small ones; one state alone holds {single} %, two hold "
        f"{plain} % of the values unsquared, and models of two states fit the tests of other waveforms by {fits} % "
        "(median, in simulation)",
    )


def _held_out(study: Comparison, model: ModelResult) -> str:
    """Fit reported beside the verdict; the verdict does not depend on it."""
    try:
        return f"{held_out(study, model):.1f}"
    except MissingRecordError:
        return "(no such test)"


def without_detrending(study: Comparison) -> Finding:
    """F15: without detrending yaw needs order 4, with extremely poor residuals but fewer observer parameters.

    Orders are chosen as the thesis chooses them, by the share of the squared singular values.
    """
    without_mean = study.campaign.single(study.estimation_test, "shoulder_yaw")
    with_mean = settled(study.campaign.log(single_joint_test(study.estimation_test, "shoulder_yaw")), "shoulder_yaw")
    reference = hankel_share(observer(without_mean), ORDER)
    needed = _order_for(with_mean, reference)
    best = _one_step(without_mean, ORDER)
    ratio = _one_step(with_mean, THESIS_ORDER) / best
    parameters = {
        "with": max(_markov_parameters_needed(with_mean), THESIS_ORDER),
        "without": max(_markov_parameters_needed(without_mean), ORDER),
    }
    parts = [needed >= THESIS_ORDER, ratio >= POOR, parameters["with"] < parameters["without"]]
    biased = replace(with_mean, y=with_mean.y + OFFSET)
    bias_needs, bias_ratio = _order_for(biased, reference), _one_step(biased, THESIS_ORDER) / best
    reached = [
        what
        for what, does in (("the order", bias_needs >= THESIS_ORDER), ("the residuals", bias_ratio >= POOR))
        if does
    ]
    gain = float(study.joints["shoulder_yaw"].truth.model.dc_gain()[0, 0])
    spare = abs(float(with_mean.y.mean() - gain * with_mean.u.mean()))
    return decided_finding(
        "F15",
        verdict(sum(parts), len(parts)),
        {
            "order for the same percent": float(needed),
            "residual of order 4 over detrended order 2": ratio,
            "observer parameters needed": float(parameters["with"]),
            "observer parameters needed, detrended": float(parameters["without"]),
            "order with a bias of one channel": float(bias_needs),
            "residual of order 4 with it": bias_ratio,
        },
        f"order with the share of order {ORDER} detrended, to {SAME:g} points ({THESIS_ORDER} expected); root mean "
        f"square of one-step residuals ({POOR:g} times or more expected); observer parameters for an error within "
        f"{100 * (ENOUGH - 1):.0f} % of that with {MOST} (fewer expected); PRBS test. Beside the verdict: the same two "
        f"numbers with {OFFSET:g} rad added to the measurement",
        f"command and measurement have means of {with_mean.u.mean():.4g} and {with_mean.y.mean():.4g} rad here and the "
        f"true gain at 0 Hz is {gain:.3g}, so that {spare:.2g} rad is all that further states have to carry; "
        f"order {ORDER} leaves {_one_step(with_mean, ORDER) / best:.3g} times the residual. With {OFFSET:g} rad added "
        f"to the measurement, {_ordinal(bias_needs)} is needed and the residual of order {THESIS_ORDER} is "
        f"{bias_ratio:.3g} times that with detrending: in this study such a bias leads to "
        f"{' and '.join(reached) or 'neither of the two'} that the thesis reports. Its range over the seeds "
        "says how far that can be relied on; what the thesis' data held is not known",
    )


def _order_for(data: IOData, percent: float) -> int:
    """Smallest order with this share; one more than can be realised if no order reaches it."""
    estimate = observer(data, P)
    return next((n for n in range(1, P + 1) if hankel_share(estimate, n) >= percent - SAME), P + 1)


def _ordinal(order: int) -> str:
    return f"order {order}" if order <= P else f"an order above {P}"


def _one_step(data: IOData, order: int) -> float:
    return float(np.sqrt(np.mean(observer(data, order).residuals ** 2)))


def _markov_parameters_needed(data: IOData) -> int:
    """Smallest number of observer Markov parameters with an error near that of `MOST`."""
    errors = [float(np.sqrt(observer(data, 1, p).noise_variance[0, 0])) for p in range(1, MOST + 1)]
    return next(p for p, error in enumerate(errors, start=1) if error <= ENOUGH * errors[-1])
