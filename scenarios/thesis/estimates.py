"""Estimates and fits of a study, each computed once: a result is kept as long as the record that it belongs to."""

import warnings
from collections.abc import Callable, Hashable, Sequence
from dataclasses import dataclass
from statistics import median
from typing import Any, TypeVar
from weakref import WeakKeyDictionary

import numpy as np

import sysid
from scenarios.identification import methods
from sysid import Estimate, IOData, StateSpace, SysidWarning
from sysid.validation import fit_percent

T = TypeVar("T")

_RESULTS: WeakKeyDictionary[IOData, dict[Hashable, Any]] = WeakKeyDictionary()


@dataclass(frozen=True)
class Fits:
    """Fits of a model to a record, always both ways.

    Attributes:
        simulation: 100 (1 - |y - yhat| / |y - mean y|) of the simulated output, percent.
        one_step: The same of the one-step prediction, percent; with K = 0 the simulation again.
    """

    simulation: float
    one_step: float


def estimate(record: IOData, estimator: str, orders: Sequence[int]) -> Estimate:
    """Estimate a structure from a record, once per record.

    Args:
        record: The record.
        estimator: Name of the estimator, see `scenarios.identification.methods`.
        orders: Its orders in their usual sequence.

    Raises:
        SysidError: The record gives no such model.
        ScenarioError: No such estimator, or orders that do not fit it.
    """
    key = (estimator, tuple(orders))
    return _once(record, key, lambda: methods.estimate(record, estimator, orders))


def fits(model: Estimate | StateSpace, record: IOData) -> Fits:
    """Compare a model of one output with a record, once per model and record; see `sysid.compare`."""

    def compared() -> Fits:
        # What an unstable model simulates grows beyond all numbers; its fit is minus infinity then.
        with np.errstate(over="ignore", invalid="ignore"):
            (score,) = sysid.compare(model, record)
        return Fits(float(score.simulation[0]), float(score.one_step[0]))

    return _once(record, model.model if isinstance(model, Estimate) else model, compared)


def simulation_fit(model: Estimate, records: Sequence[IOData]) -> float:
    """Median fit in simulation to records of one output, percent; minus infinity where it grows without bound."""
    scores = []
    for record in records:
        with np.errstate(all="ignore"):
            simulated = np.nan_to_num(
                sysid.predict(model, record, steps=None), nan=np.inf, posinf=np.inf, neginf=-np.inf
            )
        scores.append(float(fit_percent(record.y, simulated)[0]))
    return median(scores)


def _once(record: IOData, key: Hashable, compute: Callable[[], T]) -> T:
    results = _RESULTS.setdefault(record, {})
    if key not in results:
        with warnings.catch_warnings():
            # The diagnostics of an estimate hold them too; what is wrong with a model shows in its fits.
            warnings.simplefilter("ignore", SysidWarning)
            results[key] = compute()
    return results[key]
