"""Findings on what OKID and the prediction-error models make of a mean, a bias and outliers in the record."""

import warnings
from collections.abc import Callable
from dataclasses import replace

import numpy as np

import sysid
from scenarios.comparison import Comparison, JointResult
from scenarios.estimators import estimate
from scenarios.finding import Finding, verdict
from scenarios.preparation import settled
from scenarios.study import STRUCTURES
from sysid import IOData, SysidWarning

BIAS = 0.5
"""Constant added to the output after its mean was removed, in standard deviations of the output."""

OUTLIERS = (0.005, 5.0)
"""Share of the output's samples that are moved, and by how many of its standard deviations, up or down by chance."""

LARGEST = 5
"""Most states that OKID can realise from p = 5 observer Markov parameters of one output."""

SEED = 25
"""Draws the outliers."""


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
    return Finding(
        "F15",
        "without detrending, OKID needs order 4 for yaw and its residuals are poor",
        "V.2",
        verdict(sum(parts), len(parts)),
        {
            "order for the same percent": float(needed),
            "residual order 2": 1000 * fits[2],
            "residual order 4": 1000 * fits[4],
            "residual detrended order 2": 1000 * best,
        },
        "order that describes as large a share as order 2 does detrended (to 0.01 points); standard deviation of "
        "residuals about their mean, mrad, PRBS test",
        "4; poor",
        f"poor is taken as a tenth more than with detrending; order 2 describes {wanted:.4g} % detrended and "
        f"{_described(with_mean, 2):.4g} % with the mean of {with_mean.y.mean():.3g} rad left in. "
        "Command and measurement have the same mean here and the gain at 0 Hz is one, so a model without a constant "
        "carries it almost as it is; a bias of one of them alone is F25",
    )


def bias_and_outliers(study: Comparison) -> Finding:
    """F25: the prediction-error models are robust to bias and outliers, OKID is sensitive."""
    kinds = {"bias": _biased, "outliers": _spiked}
    found: dict[str, float] = {}
    better = dict.fromkeys(kinds, 0)
    for kind, spoil in kinds.items():
        own = [_moved(study, entry, entry.chosen.method, spoil) for entry in study.joints.values()]
        okid = [_moved(study, entry, "okid", spoil) for entry in study.joints.values()]
        found[f"{kind}: SysID"], found[f"{kind}: OKID"] = max(own), max(okid)
        better[kind] = sum(one < other for one, other in zip(own, okid, strict=True))
    joints = len(study.joints)
    return Finding(
        "F25",
        "SysID is robust to bias and outliers, OKID is sensitive",
        "VI.6",
        verdict(sum(better.values()), 2 * joints),
        found,
        "percent that the bandwidth moves, largest over the joints, PRBS test",
        "robust; sensitive",
        f"SysID moves less than OKID on {better['outliers']} of {joints} joints with outliers of {OUTLIERS[1]:g} "
        f"standard deviations on {100 * OUTLIERS[0]:g} % of the output's samples, and on {better['bias']} of {joints} "
        f"with a constant of {BIAS:g} standard deviations left in the output: a model without a constant of its own "
        "makes one with a pole near z = 1, what detrending would have removed. The thesis gives no size of "
        "its bias and outliers",
    )


def _moved(study: Comparison, entry: JointResult, method: str, spoil: Callable[[IOData], IOData]) -> float:
    """Percent by which a method's bandwidth moves when its record is spoilt."""
    structure = next(known for known in STRUCTURES[entry.joint] if known.method == method)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", SysidWarning)
        spoilt, _ = estimate(spoil(entry.data[study.estimation_test]), structure.estimator, structure.orders)
    return 100 * abs(float(spoilt.model.bandwidth()[0, 0]) / entry.models[method].bandwidth_hz - 1)


def _biased(data: IOData) -> IOData:
    return replace(data, y=data.y + BIAS * np.std(data.y))


def _spiked(data: IOData) -> IOData:
    share, size = OUTLIERS
    rng = np.random.default_rng(SEED)
    hit = rng.random(data.y.shape) < share
    return replace(data, y=data.y + hit * rng.choice([-1.0, 1.0], data.y.shape) * size * np.std(data.y))


def _described(data: IOData, order: int) -> float:
    """Percent of the squared Hankel singular values that some states hold."""
    return float(np.max(np.asarray(_okid(data, order).diagnostics["percent_described"], dtype=float)))


def _one_step(data: IOData, order: int) -> float:
    return float(np.std(_okid(data, order).residuals))


def _okid(data: IOData, order: int) -> sysid.Estimate:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", SysidWarning)
        return sysid.okid(data, order, p=5)
