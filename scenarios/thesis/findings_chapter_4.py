"""Findings of chapter IV, on the prediction-error models."""

import numpy as np

from scenarios.thesis.comparison import Comparison
from scenarios.thesis.finding import Finding, decided, verdict
from scenarios.thesis.held_out import held_out
from scenarios.thesis.probability import p_value


def yaw_armax(study: Comparison) -> Finding:
    """F9: the yaw ARMAX has white, independent residuals and a near cancellation."""
    model = study.joints["shoulder_yaw"].models["armax"]
    poles, zeros = model.estimate.model.poles(), model.estimate.model.zeros()
    poles, zeros = poles[np.abs(poles) > 1e-6], zeros[np.abs(zeros) > 1e-6]
    nearest = float(np.abs(poles[:, None] - zeros[None, :]).min(initial=np.inf))
    test = model.residual_test
    parts = [bool(test.white[0]), bool(test.independent[0, 0]), nearest < 0.1]
    return decided(
        "F9",
        verdict(sum(parts), len(parts)),
        {
            "whiteness p": float(test.whiteness_p[0]),
            "independence p": float(test.independence_p[0, 0]),
            "nearest pole and zero": nearest,
        },
        "p-values at 25 lags (below 0.01: rejected); distance in the z plane (below 0.1: near)",
        "the tests grow sharper with every sample; how much of the departure is friction is not told apart here",
    )


def yaw_oe(study: Comparison) -> Finding:
    """F10: the yaw OE has residuals that are not white."""
    test = study.joints["shoulder_yaw"].models["oe"].residual_test
    return decided(
        "F10",
        "not reproduced" if test.white[0] else "partly",
        float(test.whiteness_p[0]),
        "p-value of whiteness at 25 lags",
        "an output-error model leaves all disturbance dynamics in its residuals; that more poles turn unstable cannot "
        "be told here, because the estimator keeps every model stable",
    )


def shoulder_oe(study: Comparison) -> Finding:
    """F11: on the shoulder pitch OE is best, its residuals independent of the input."""
    models = study.joints["shoulder_pitch"].models
    fits = {name.upper(): held_out(study, models[name]) for name in ("oe", "armax")}
    test = models["oe"].residual_test
    independent, p = bool(test.independent[0, 0]), float(test.independence_p[0, 0])
    return decided(
        "F11",
        verdict(int(fits["OE"] >= fits["ARMAX"]) + int(independent), 2),
        fits,
        "percent, median simulation fit to the seven tests not seen",
        f"its residuals are {'' if independent else 'not '}independent of the input ({p_value(p)}; below 0.01: "
        "rejected)",
    )


def elbow_armax(study: Comparison) -> Finding:
    """F12: on the elbow pitch ARMAX is best, and whiter than OE."""
    models = study.joints["elbow_pitch"].models
    fits = {name.upper(): held_out(study, models[name]) for name in ("armax", "oe")}
    outside = {name: int(models[name].residual_test.outside_whiteness[0]) for name in ("armax", "oe")}
    return decided(
        "F12",
        verdict(int(fits["ARMAX"] >= fits["OE"]) + int(outside["armax"] < outside["oe"]), 2),
        fits,
        "percent, median simulation fit to the seven tests not seen",
        f"{outside['armax']} of 25 lags lie outside the whiteness bounds for ARMAX, {outside['oe']} for OE; white "
        "residuals would leave 0.25 outside by chance, 1 % of the lags",
    )


def stable(study: Comparison) -> Finding:
    """F13: all models are stable."""
    radius = {
        name: max(float(np.abs(m.estimate.model.poles()).max()) for m in entry.models.values())
        for name, entry in study.joints.items()
    }
    return decided(
        "F13",
        verdict(sum(value < 1 for value in radius.values()), len(radius)),
        radius,
        "largest modulus of a pole over all models",
        "OE keeps its F stable by construction; ARMAX and OKID are free to be unstable and are not",
    )
