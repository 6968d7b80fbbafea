"""Findings of chapter V, on OKID."""

import warnings

import numpy as np

import sysid
from scenarios.preparation import settled
from scenarios.thesis.comparison import Comparison
from scenarios.thesis.finding import Finding, decided, verdict
from scenarios.thesis.held_out import held_out
from sysid import IOData, SysidWarning

LARGEST = 5
"""Most states that OKID can realise from p = 5 observer Markov parameters of one output."""


def percent_described(study: Comparison) -> Finding:
    """F14: order 2 describes 96 to 99.9 percent in OKID's own measure."""
    found = {
        name: _share(entry.models["okid"].estimate.diagnostics["percent_described"])
        for name, entry in study.joints.items()
    }
    printed = {"shoulder_yaw": 99.87, "shoulder_pitch": 96.11, "elbow_pitch": 98.88}
    fits = ", ".join(f"{held_out(study, entry.models['okid']):.1f} %" for entry in study.joints.values())
    return decided(
        "F14",
        verdict(sum(found[name] >= printed[name] - 0.5 for name in found), len(found)),
        found,
        "percent of the squared Hankel singular values that two states hold",
        "half a point below the printed share is allowed, any share above it passes; this measure says how "
        "much of the Hankel matrix two states hold and is no fit; median simulation fits to "
        f"tests not seen are {fits}",
    )


def _share(value: object) -> float:
    """The share at order 2, whether the estimator gives one number or one for each order."""
    entries = np.atleast_1d(np.asarray(value, dtype=float))
    return float(entries[1] if entries.size > 1 else entries[0])


def without_detrending(study: Comparison) -> Finding:
    """F15: OKID without detrending needs order 4 for yaw and leaves poor residuals."""
    entry = study.joints["shoulder_yaw"]
    without_mean = entry.data[study.estimation_test]
    with_mean = settled(study.logs[without_mean.name], entry.joint)
    wanted = _described(without_mean, 2)
    needed = next((n for n in range(1, LARGEST + 1) if _described(with_mean, n) >= wanted - 0.01), LARGEST + 1)
    fits = {n: _one_step(with_mean, n) for n in (2, 4)}
    best = _one_step(without_mean, 2)
    parts = [needed >= 4, fits[2] > 1.1 * best]
    return decided(
        "F15",
        verdict(sum(parts), len(parts)),
        {
            "order for the same percent": float(needed),
            "residual order 2": 1000 * fits[2],
            "residual order 4": 1000 * fits[4],
            "residual detrended order 2": 1000 * best,
        },
        "order that describes as large a share as order 2 does detrended (to 0.01 points); standard deviation of "
        "residuals about their mean, mrad, PRBS test",
        f"poor is taken as a tenth more than with detrending; order 2 describes {wanted:.4g} % detrended and "
        f"{_described(with_mean, 2):.4g} % with the mean of {with_mean.y.mean():.3g} rad left in. "
        "Command and measurement have the same mean here and the gain at 0 Hz is one, so a model without a constant "
        "carries it almost as it is; a bias of one of them alone is F25",
    )


def _described(data: IOData, order: int) -> float:
    """Percent of the squared Hankel singular values that some states hold."""
    return float(np.max(np.asarray(_okid(data, order).diagnostics["percent_described"], dtype=float)))


def _one_step(data: IOData, order: int) -> float:
    return float(np.std(_okid(data, order).residuals))


def _okid(data: IOData, order: int) -> sysid.Estimate:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", SysidWarning)
        return sysid.okid(data, order, p=5)
