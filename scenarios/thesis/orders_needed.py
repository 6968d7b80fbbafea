"""Number of sufficient states, with and without detrending [Morris1996, sec. VI.6].

The thesis saw one model of each kind shrink when the record was detrended: a prediction-error model from third to
second order, an OKID model from fourth to second.
"""

import warnings
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from statistics import median
from types import MappingProxyType

import numpy as np

import sysid
from scenarios.experiments.campaign import Campaign
from scenarios.experiments.log_review import settled
from scenarios.experiments.model_structures import STRUCTURES
from scenarios.thesis.disturbances import biased
from sysid import Estimate, IOData, SysidError, SysidWarning, predict
from sysid.validation import fit_percent

ORDERS: Mapping[str, tuple[int, ...]] = MappingProxyType({"SysID": (1, 2, 3), "OKID": (1, 2, 3, 4)})
"""States that are tried, by kind of model: as many as the thesis speaks of."""

PART = 1000
"""Samples of the part that is used, 20 s from the start: larger orders than needed take long to fit."""

MARGIN = 1.0
"""An order suffices whose fit is at most so far below the best order's on the same record, percent points."""

BIAS = 0.5
"""Constant in the output of the biased record, standard deviations of the output."""

DETRENDED = "detrended"
"""The record as the study takes it."""

WITH_MEANS = "with its means"
"""The same with the joint's angle about which it moves, in the command as in the measurement."""

CONSTANT = "with a constant in the output"
"""The detrended record with a constant added to the output alone."""

METHODS: Mapping[str, Callable[[IOData, int, int], Estimate]] = MappingProxyType(
    {
        "SysID": lambda data, n, nk: sysid.oe(data, n, n, nk),
        "OKID": lambda data, n, _: sysid.okid(data, n, p=5),
    }
)
"""Output error with as many zeros' coefficients as poles, the one structure that has a single order; and OKID."""


@dataclass(frozen=True)
class OrderNeeded:
    """Number of sufficient states on one record.

    Attributes:
        joint: The joint.
        method: `SysID` or `OKID`.
        record: What the record is like.
        fits: In simulation to records of other waveforms, percent, median, by order; minus infinity where there is no
            stable model.
        needed: The smallest order that suffices.
    """

    joint: str
    method: str
    record: str
    fits: Mapping[int, float]
    needed: int


def orders_needed(joint: str, campaign: Campaign, data: IOData, judges: Sequence[IOData]) -> tuple[OrderNeeded, ...]:
    """Find the order that suffices on the detrended record and on two that are not.

    Args:
        joint: The joint.
        campaign: Holds the log that the record comes from, with its means.
        data: The record that models are identified from, without its means.
        judges: Records of other waveforms, not spoilt.

    Returns:
        One entry for each method and record.
    """
    nk = next(entry.orders[-1] for entry in STRUCTURES[joint] if entry.method == "oe")
    part = data[:PART].detrend()
    records = {
        DETRENDED: part,
        WITH_MEANS: settled(campaign.log(data.name), joint)[:PART],
        CONSTANT: biased(part, BIAS, np.random.default_rng(0)),
    }
    found = []
    for method in METHODS:
        for name, record in records.items():
            fits = {n: _fit(method, record, n, nk, judges) for n in ORDERS[method]}
            found.append(OrderNeeded(joint, method, name, fits, needed(fits)))
    return tuple(found)


def needed(fits: Mapping[int, float]) -> int:
    """The smallest order whose fit is within `MARGIN` of the best."""
    best = max(fits.values())
    return min(n for n, fit in fits.items() if fit >= best - MARGIN)


def _fit(method: str, record: IOData, n: int, nk: int, judges: Sequence[IOData]) -> float:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", SysidWarning)
        try:
            found = METHODS[method](record, n, nk)
        except SysidError:
            return float("-inf")
        return simulated_fit(found, judges) if found.model.is_stable() else float("-inf")


def simulated_fit(found: Estimate, judges: Sequence[IOData]) -> float:
    """Median fit in simulation of one output, percent; minus infinity where the model grows beyond all numbers."""
    return median(_simulated(found, judge) for judge in judges)


def _simulated(found: Estimate, judge: IOData) -> float:
    with np.errstate(all="ignore"):
        simulated = np.nan_to_num(predict(found, judge, steps=None), nan=np.inf, posinf=np.inf, neginf=-np.inf)
    return float(fit_percent(judge.y, simulated)[0])
