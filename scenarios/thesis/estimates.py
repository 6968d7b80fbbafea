"""Estimates and fits of a study, each computed once: a result is kept as long as its record."""

import warnings
from collections.abc import Callable, Hashable, Mapping, Sequence
from dataclasses import dataclass
from statistics import median
from types import MappingProxyType
from typing import Any, TypeVar
from weakref import WeakKeyDictionary

import numpy as np

import sysid
from scenarios.experiments.model_structures import Structure
from scenarios.identification import methods
from sysid import Estimate, IOData, ResidualTest, StateSpace, SysidWarning
from sysid.models.bandwidth import half_power_hz
from sysid.validation import fit_percent

T = TypeVar("T")

WHITE = {"coloured": False}
"""Intervals of output-error models for a white disturbance: those whose spread over twenty seeds is recorded."""

# Weak keys: what was computed from a record is freed with it.
_RESULTS: WeakKeyDictionary[IOData, dict[Hashable, Any]] = WeakKeyDictionary()


@dataclass(frozen=True)
class Fits:
    """Fits of a model to a record, in simulation and one step ahead: a model without a noise model cannot predict.

    Attributes:
        simulation: 100 (1 - |y - yhat| / |y - mean y|) of the simulated output, percent.
        one_step: The same of the one-step prediction, percent; with K = 0 the simulation again.
    """

    simulation: float
    one_step: float


def estimate(record: IOData, estimator: str, orders: Sequence[int]) -> Estimate:
    """Estimate a structure, by name of the estimator and its orders in their usual sequence, once per record.

    Raises:
        SysidError: The record gives no such model.
        ScenarioError: No such estimator, or orders that do not fit it.
    """
    # A tuple: orders that come as a list have no hash.
    key = (estimator, tuple(orders))
    options = WHITE if estimator == "oe" else {}
    return _computed_once(record, key, lambda: methods.estimate(record, estimator, orders, **options))


def fits(model: Estimate | StateSpace, record: IOData) -> Fits:
    """Compare a model of one output with a record, once per model and record; see `sysid.compare`."""

    def computed_fits() -> Fits:
        # What an unstable model simulates grows beyond all numbers; its fit is minus infinity then.
        with np.errstate(over="ignore", invalid="ignore"):
            (score,) = sysid.compare(key, record)
        return Fits(float(score.simulation[0]), float(score.one_step[0]))

    # By the state-space model: a printed model and an estimate are looked up alike.
    key = model.model if isinstance(model, Estimate) else model
    return _computed_once(record, key, computed_fits)


@dataclass(frozen=True, eq=False)
class IdentifiedModel(Structure):
    """A structure identified from a record.

    Attributes:
        estimate: The estimate.
        bandwidth_hz: Recovered bandwidth, Hz; NaN where the gain does not fall by 3 dB below Nyquist.
        ci95: Its 95 % interval, Hz.
        dc_gain: Gain at 0 Hz, which the bandwidth is relative to.
        half_power_hz: Frequency at which the gain is 0.707, whatever it is at 0 Hz, Hz.
        radius: Largest modulus of a pole.
        residual_test: Whiteness and independence of the residuals on the record.
        fits: Fits to records, by number of the test or by name.
    """

    estimate: Estimate
    bandwidth_hz: float
    ci95: tuple[float, float]
    dc_gain: float
    half_power_hz: float
    radius: float
    residual_test: ResidualTest
    fits: Mapping[Any, Fits]

    # Models of one structure are not equal because their structures are.
    __eq__, __hash__ = object.__eq__, object.__hash__

    @property
    def stable(self) -> bool:
        """Whether every pole lies inside the unit circle."""
        return self.radius < 1.0

    @property
    def residual(self) -> float:
        """Standard deviation of the residuals, output units."""
        return float(np.std(self.estimate.residuals))


def identified(record: IOData, structure: Structure, judges: Mapping[Any, IOData]) -> IdentifiedModel:
    """Identify a structure from a record and compare the model with the records that judge; see `estimate`."""
    model = estimate(record, structure.estimator, structure.orders)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", SysidWarning)
        bandwidth_hz, lower_hz, upper_hz = model.bandwidth().path()
        # `initial`: a model of order 0 has no pole, and is stable.
        radius = float(np.abs(model.poles()).max(initial=0.0))
        fits_by_record = {name: fits(model, judge) for name, judge in judges.items()}
        return IdentifiedModel(
            **vars(structure),
            estimate=model,
            bandwidth_hz=bandwidth_hz,
            ci95=(lower_hz, upper_hz),
            dc_gain=float(model.model.dc_gain()[0, 0]),
            half_power_hz=half_power_hz(model.model),
            radius=radius,
            residual_test=sysid.resid(model, record),
            fits=MappingProxyType(fits_by_record),
        )


def simulation_fit(model: Estimate, records: Sequence[IOData]) -> float:
    """Median fit in simulation to records of one output, percent; minus infinity where it grows without bound."""
    scores = []
    for record in records:
        with np.errstate(all="ignore"):
            simulated = sysid.predict(model, record, steps=None)
            # An unbounded simulation ends as inf - inf = NaN. Infinity instead gives a fit of minus infinity, which a
            # median can rank.
            simulated = np.nan_to_num(simulated, nan=np.inf, posinf=np.inf, neginf=-np.inf)
        scores.append(float(fit_percent(record.y, simulated)[0]))
    return median(scores)


def _computed_once(record: IOData, key: Hashable, compute: Callable[[], T]) -> T:
    """Return the result that was computed from a record under a key; compute it if there is none."""
    results = _RESULTS.setdefault(record, {})
    if key not in results:
        with warnings.catch_warnings():
            # The diagnostics of an estimate hold them too; what is wrong with a model shows in its fits.
            warnings.simplefilter("ignore", SysidWarning)
            results[key] = compute()
    return results[key]
