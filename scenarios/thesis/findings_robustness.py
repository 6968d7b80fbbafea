"""Findings on what OKID and the prediction-error models make of a mean, a bias and outliers in the record."""

import warnings
from collections.abc import Callable
from dataclasses import replace

import numpy as np

from scenarios.estimators import estimate
from scenarios.thesis.comparison import Comparison, JointResult
from scenarios.thesis.finding import Finding, decided, verdict
from scenarios.thesis.structures import STRUCTURES
from sysid import IOData, SysidWarning

BIAS = 0.5
"""Constant added to the output after its mean was removed, in standard deviations of the output."""

OUTLIERS = (0.005, 5.0)
"""Share of the output's samples that are moved, and by how many of its standard deviations, up or down by chance."""


SEED = 25
"""Draws the outliers."""


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
    return decided(
        "F25",
        verdict(sum(better.values()), 2 * joints),
        found,
        "percent that the bandwidth moves, largest over the joints, PRBS test",
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
