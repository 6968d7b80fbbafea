"""One bandwidth recovered from one record, by any method, and what speaks against it."""

import warnings
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

import sysid
from hmtb_twin.parameters.values import SAMPLE_RATE
from scenarios.experiments.model_structures import STRUCTURES, Structure, every_structure
from scenarios.experiments.waveform import POINTS, WINDOW
from scenarios.files.errors import ScenarioError, unknown
from scenarios.identification.methods import ESTIMATORS
from scenarios.identification.one_hertz import METHODS, Interval, Recovered
from scenarios.truth.published import published
from sysid import FrequencyResponse, IOData, SysidError, SysidWarning
from sysid.models.bandwidth import (
    DEGREE,
    HALF_POWER,
    REACH,
    bandwidth_claim,
    gain_crossing,
    half_power_hz,
    lowest_excited,
    response_bandwidth,
)

NONPARAMETRIC = {"spa": "spectral analysis, Hamming window", "etfe": "empirical transfer function, mean over periods"}
"""Methods without a model, with their labels."""

REPEATS = 0.25
"""Difference of two periods of the command, over its spread, up to which it repeats.

Noise of the wires makes some, up to 0.05 at 1 V; stretches that have nothing in common differ by the root of two.
"""


@dataclass(frozen=True, kw_only=True)
class RecoveredBandwidth(Recovered):
    """A recovered bandwidth with all that belongs to it.

    Attributes:
        scenario: The experiment that it was recovered from.
        label: Method and orders in words.
        orders: Orders by name; none without a model.
        model_hz: What the model says, whether it can be claimed or not, Hz.
        model_ci95: Its interval, Hz.
        dc_gain: Gain at 0 Hz, which the bandwidth is relative to; NaN without a model.
        lowest_excited_hz: Lowest frequency at which the command has power, Hz.
        refused: Whether no bandwidth is claimed; the row counts all the same.
        reasons: Why not, and what else speaks against it, in words.
    """

    scenario: str
    label: str
    orders: Mapping[str, int]
    model_hz: float
    model_ci95: tuple[float, float]
    dc_gain: float
    lowest_excited_hz: float
    refused: bool
    reasons: tuple[str, ...]

    @property
    def published_hz(self) -> float:
        """Bandwidth of the thesis' printed model of the joint by this method, Hz; NaN where it prints none."""
        return next((one.bandwidth_hz for one in published(self.joint) if one.method == self.method), float("nan"))

    def record(self) -> dict[str, object]:
        """What `hmtb bandwidth --json` prints of it."""
        hz, low, high = self.best_linear or (None, None, None)
        return {
            "joint": self.joint,
            "method": self.method,
            "orders": dict(self.orders),
            "scenario": self.scenario,
            "test": self.test,
            "seed": self.seed,
            "hz": self.hz,
            "ci95": list(self.ci95),
            "true_hz": self.true_hz,
            "bla_hz": hz,
            "bla_ci95": [low, high],
            "published_hz": self.published_hz,
            "near_1_hz": self.near,
            "covers": self.covers,
            "covers_bla": self.covers_best_linear,
            "refused": self.refused,
            "reason": "; ".join(self.reasons),
            "model_hz": self.model_hz,
            "model_ci95": list(self.model_ci95),
            "dc_gain": self.dc_gain,
            "half_power_hz": self.half_power_hz,
            "lowest_excited_hz": self.lowest_excited_hz,
        }


@dataclass(frozen=True)
class Place:
    """What a bandwidth is recovered from, and what is true there.

    Attributes:
        joint: The joint.
        test: The test.
        scenario: The experiment.
        seed: Its seed; None for the scenario's own.
        true_hz: Small-signal truth, Hz.
        best_linear: Best linear bandwidth with its interval; None where it was not measured.
    """

    joint: str
    test: str
    scenario: str
    seed: int | None
    true_hz: float
    best_linear: Interval | None = None


def structure(joint: str, method: str) -> Structure:
    """The structure of a method for a joint: the thesis' own, or one of sufficient order.

    Raises:
        ScenarioError: Unknown joint or method.
    """
    check_joint(joint)
    every = {entry.method: entry for entry in (*STRUCTURES[joint], *every_structure(joint))}
    if method not in every:
        raise ScenarioError(unknown("method", method, METHODS))
    return every[method]


def check_joint(joint: str) -> None:
    """Refuse a joint that the thesis did not study.

    Raises:
        ScenarioError: It is another one, or none.
    """
    if joint not in STRUCTURES:
        raise ScenarioError(unknown("joint", joint, STRUCTURES))


def check_method(method: str) -> None:
    """Refuse what is no method.

    Raises:
        ScenarioError: It is none.
    """
    if method not in METHODS:
        raise ScenarioError(unknown("method", method, METHODS))


def recover(record: IOData, method: str, place: Place) -> RecoveredBandwidth:
    """Recover the bandwidth of a joint by a method.

    Args:
        record: Settled record without means, rad.
        method: One of `METHODS`.
        place: Where it comes from, and what is true.

    Returns:
        The bandwidth; without one, where the record does not bear it or the method fails, with the reason.
    """
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", SysidWarning)
        if method in NONPARAMETRIC:
            return _without_model(record, method, place)
        return _with_model(record, structure(place.joint, method), place)


def _with_model(record: IOData, chosen: Structure, place: Place) -> RecoveredBandwidth:
    estimator = ESTIMATORS[chosen.estimator]
    orders = estimator.complete(chosen.estimator, chosen.orders)
    try:
        found = estimator.run(record, list(orders.values()))
    except SysidError as error:
        return _row(record, chosen.method, place, chosen.label, orders, reasons=(str(error),))
    band = found.bandwidth()
    said = bandwidth_claim(found, record, band=band)
    reasons = said.warnings
    if not said.refused and not np.isfinite(said.hz):
        reasons = ("the model's gain does not fall by 3 dB from its value at 0 Hz below half of the sampling rate",)
    return _row(
        record,
        chosen.method,
        place,
        chosen.label,
        orders,
        claimed=(said.hz, said.low, said.high),
        model=(float(band.hz[0, 0]), float(band.ci95[0][0, 0]), float(band.ci95[1][0, 0])),
        dc_gain=float(found.model.dc_gain()[0, 0]),
        level=half_power_hz(found.model),
        reasons=reasons,
    )


def _without_model(record: IOData, method: str, place: Place) -> RecoveredBandwidth:
    label = NONPARAMETRIC[method]
    try:
        response = _response(record, method)
    except SysidError as error:
        return _row(record, method, place, label, {}, reasons=(str(error),))
    level = gain_crossing(response, HALF_POWER)
    within = int(np.sum(response.frequencies <= REACH * level)) if np.isfinite(level) else 0
    if within < DEGREE + 2:
        # Of fewer, lines beyond the bandwidth would tell the gain at 0 Hz, with an interval that knows of noise alone.
        every = f": the command repeats every {WINDOW:g} s and excites a line every {1 / WINDOW:g} Hz"
        reason = (
            f"too few lines of the response lie below {REACH:g} times the frequency of the gain 0.707 to tell the gain "
            f"at 0 Hz, {within} where {DEGREE + 2} are needed{every if _repeats(record) else ''}"
        )
        return _row(record, method, place, label, {}, level=level, reasons=(reason,))
    band = response_bandwidth(response)
    hz, low, high = (float(part[0, 0]) for part in (band.hz, *band.ci95))
    reasons = () if np.isfinite(hz) else ("the response never falls to half of its power at 0 Hz",)
    found = (hz, low, high)
    return _row(record, method, place, label, {}, claimed=found, model=found, level=level, reasons=reasons)


def _response(record: IOData, method: str) -> FrequencyResponse:
    """The response on the lines of a file of 100 points, or, where the command does not repeat, on an even grid."""
    if _repeats(record):
        lines = np.arange(1, POINTS // 2) * SAMPLE_RATE / POINTS
        if method == "spa":
            return sysid.spa(record, frequencies=lines)
        return sysid.etfe([record[start : start + POINTS] for start in range(0, len(record) - POINTS + 1, POINTS)])
    if method == "etfe":
        raise SysidError(f"the command does not repeat every {POINTS} samples; the mean over periods has none")
    return _heard(sysid.spa(record))


def _heard(response: FrequencyResponse) -> FrequencyResponse:
    """The lines at which the command has power: a held one has next to none at half of the sampling rate."""
    kept = np.isfinite(response.response[:, 0, 0])
    return FrequencyResponse(
        response.frequencies[kept],
        response.response[kept],
        response.dt,
        response.method,
        None if response.covariance is None else response.covariance[kept],
        degrees_of_freedom=response.degrees_of_freedom,
    )


def _repeats(record: IOData) -> bool:
    u = record.u[:, 0]
    return len(u) >= 2 * POINTS and float(np.std(u[POINTS:] - u[:-POINTS])) < REPEATS * float(np.std(u))


def _row(
    record: IOData,
    method: str,
    place: Place,
    label: str,
    orders: Mapping[str, int],
    *,
    claimed: Interval = (np.nan,) * 3,
    model: Interval = (np.nan,) * 3,
    dc_gain: float = np.nan,
    level: float = np.nan,
    reasons: tuple[str, ...],
) -> RecoveredBandwidth:
    return RecoveredBandwidth(
        joint=place.joint,
        method=method,
        test=place.test,
        seed=place.seed,
        hz=claimed[0],
        ci95=(claimed[1], claimed[2]),
        true_hz=place.true_hz,
        best_linear=place.best_linear,
        scenario=place.scenario,
        label=label,
        orders=orders,
        model_hz=model[0],
        model_ci95=(model[1], model[2]),
        dc_gain=dc_gain,
        half_power_hz=level,
        lowest_excited_hz=lowest_excited(record),
        refused=not np.isfinite(claimed[0]),
        reasons=reasons,
    )
