"""Bandwidth of a joint recovered from one record by one method, and the reasons against it."""

import warnings
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

import sysid
from hmtb_twin.parameters.values import SAMPLE_RATE
from scenarios.experiments.model_structures import STRUCTURES, Structure, every_structure
from scenarios.experiments.scenario import Scenario
from scenarios.files.errors import ScenarioError, unknown
from scenarios.identification.identification import FittedModel, fit_model, gains_with_error, long_lag
from scenarios.identification.methods import ESTIMATORS
from scenarios.truth.published import published
from sysid import FrequencyResponse, IOData, SysidError, SysidWarning
from sysid.models.bandwidth import (
    DEGREE,
    HALF_POWER,
    REACH,
    gain_crossing,
    half_power_hz,
    response_bandwidth,
)
from sysid.records.excited_band import lowest_excited

ABOUT_1_HZ = (0.8, 1.25)
"""Range of bandwidths that count as about 1 Hz, Hz."""


def near_1_hz(hz: float) -> bool:
    """Whether a bandwidth is about 1 Hz."""
    low, high = ABOUT_1_HZ
    return low <= hz <= high


METHODS = {
    "arx": "ARX",
    "armax": "ARMAX",
    "iv4": "IV4",
    "oe": "OE",
    "okid": "OKID",
    "oe_high": "OE of higher order",
    "spa": "spectral analysis",
    "etfe": "empirical transfer function",
}
"""Names of the methods in sentences."""

NONPARAMETRIC = {"spa": "spectral analysis, Hamming window", "etfe": "empirical transfer function, mean over periods"}
"""Methods without a model, with their labels."""

REPEATS = 0.25
"""Largest difference of two periods of a command, over its spread, at which it counts as periodic.

Noise of the wires makes some, 0.15 at 1 V; stretches that have nothing in common differ by the root of two.
"""

NAN = float("nan")

Interval = tuple[float, float, float]
"""A bandwidth and the ends of its 95 % interval, Hz."""


@dataclass(frozen=True, eq=False)
class Recording:
    """A record of one joint and where it comes from.

    Attributes:
        joint: The joint.
        test: The test.
        seed: Seed of noise and waveform; None for the scenario's own.
        data: Settled record without means, rad.
        setting: The experiment.
    """

    joint: str
    test: str
    seed: int | None
    data: IOData
    setting: Scenario


def intervals_agree(first: Interval, second: Interval) -> bool:
    """Whether two bandwidths, each with the ends of its interval, differ by no more than both intervals allow together.

    Both are estimates with errors of their own: half-widths on the logarithmic scale, of the ends that face each other,
    add as squares; an interval that begins at 0 Hz excludes nothing. Unknown numbers never agree.
    """
    if not np.isfinite([*first, *second]).all():
        return False
    (hz, low, high), (other_hz, other_low, other_high) = first, second
    with np.errstate(divide="ignore"):  # an interval that begins at 0 Hz is infinitely wide
        if other_hz > hz:
            facing = np.divide((high, other_hz), (hz, other_low))
        else:
            facing = np.divide((hz, other_high), (low, other_hz))
    return bool(abs(np.log(hz / other_hz)) <= np.hypot(*np.log(facing)))


@dataclass(frozen=True, kw_only=True)
class RecoveredBandwidth:
    """A bandwidth that a method recovered, beside the truth.

    Attributes:
        joint: The joint.
        method: Key of the method.
        test: The test.
        seed: Seed of the record; None for the scenario's own.
        scenario: The experiment.
        label: Method and orders in words.
        orders: Orders by name; none without a model.
        hz: Bandwidth, Hz; NaN where the record cannot support one; the row counts all the same.
        ci95: Its 95 % interval from the parameters, Hz.
        distorted_ci95: The interval with nonlinear distortion and too low an order, Hz; NaN where the record cannot
            tell, or without a model.
        true_hz: Small-signal truth, Hz.
        best_linear: Best linear approximation under a command as strong as the test's; None where it was not measured.
        model_hz: Bandwidth of the model, whether it can be claimed or not, Hz.
        model_ci95: Its interval, Hz.
        dc_gain: Gain at 0 Hz, which the bandwidth is relative to; NaN without a model.
        half_power_hz: Where the gain is 0.707, whatever it is at 0 Hz, Hz; NaN where it never is.
        lowest_excited_hz: Lowest frequency at which the command has power, Hz.
        reasons: Reasons against the bandwidth, in words.
    """

    joint: str
    method: str
    test: str
    seed: int | None
    scenario: str = ""
    label: str = ""
    orders: Mapping[str, int] = field(default_factory=dict)
    hz: float = NAN
    ci95: tuple[float, float] = (NAN, NAN)
    distorted_ci95: tuple[float, float] = (NAN, NAN)
    true_hz: float
    best_linear: Interval | None = None
    model_hz: float = NAN
    model_ci95: tuple[float, float] = (NAN, NAN)
    dc_gain: float = NAN
    half_power_hz: float = NAN
    lowest_excited_hz: float = NAN
    reasons: tuple[str, ...] = ()

    @property
    def refused(self) -> bool:
        """Whether no bandwidth is claimed."""
        return not np.isfinite(self.hz)

    @property
    def near(self) -> bool:
        """Whether it is about 1 Hz; never where none is claimed."""
        return near_1_hz(self.hz)

    @property
    def covers(self) -> bool:
        """Whether the interval holds the small-signal truth."""
        return self.ci95[0] <= self.true_hz <= self.ci95[1]

    @property
    def covers_best_linear(self) -> bool | None:
        """Whether it differs from the best linear bandwidth by no more than both intervals together allow.

        See `intervals_agree`; None where there is no best linear bandwidth to compare with.
        """
        if self.best_linear is None or not np.isfinite(self.best_linear).all():
            return None
        return intervals_agree((self.hz, *self.ci95), self.best_linear)

    @property
    def published_hz(self) -> float:
        """Bandwidth of the thesis' printed model of the joint by this method, Hz; NaN where it prints none."""
        of_method = (model.bandwidth_hz for model in published(self.joint) if model.method == self.method)
        return next(of_method, NAN)

    def record(self) -> dict[str, object]:
        """Return what `hmtb bandwidth --json` prints of it."""
        best_linear_hz, *best_linear_ci95 = self.best_linear or (None, None, None)
        record = {}
        for name in ("joint", "method", "orders", "scenario", "test", "seed", "hz", "ci95", "true_hz"):
            record[name] = getattr(self, name)
        record |= {
            "ci95_with_distortion_and_order": self.distorted_ci95,
            "bla_hz": best_linear_hz,
            "bla_ci95": best_linear_ci95,
            "published_hz": self.published_hz,
            "near_1_hz": self.near,
            "covers": self.covers,
            "covers_bla": self.covers_best_linear,
            "refused": self.refused,
            "reason": "; ".join(self.reasons),
        }
        for name in ("model_hz", "model_ci95", "dc_gain", "half_power_hz", "lowest_excited_hz"):
            record[name] = getattr(self, name)
        return record


def structure(joint: str, method: str) -> Structure | None:
    """Return the structure of a method for a joint: the thesis' own, or one of sufficient order; None without a model.

    Raises:
        ScenarioError: Unknown joint or method.
    """
    if joint not in STRUCTURES:
        raise ScenarioError(unknown("joint", joint, STRUCTURES))
    if method not in METHODS:
        raise ScenarioError(unknown("method", method, METHODS))
    # `every_structure` adds the methods for which the thesis gives no orders.
    structures = {candidate.method: candidate for candidate in (*STRUCTURES[joint], *every_structure(joint))}
    return structures.get(method)


def recover(
    recording: Recording, method: str, true_hz: float, best_linear: Interval | None = None
) -> RecoveredBandwidth:
    """Recover the bandwidth of a joint by a method.

    Args:
        recording: The record.
        method: One of `METHODS`.
        true_hz: Small-signal truth, Hz.
        best_linear: Best linear bandwidth with its interval; None where it was not measured.

    Returns:
        The bandwidth; without one, where the record does not support it or the method fails, with the reason.
    """
    data = recording.data
    row: dict[str, Any] = {}
    with warnings.catch_warnings():
        # What they warn of, the claims of a bandwidth weigh.
        warnings.simplefilter("ignore", SysidWarning)
        lowest = lowest_excited(data)
        chosen = structure(recording.joint, method)
        try:
            if chosen is None:
                row["label"] = NONPARAMETRIC[method]
                row |= _of_response(_response(data, method, recording.setting.period), recording)
            else:
                row["label"] = chosen.label
                row["orders"] = ESTIMATORS[chosen.estimator].complete(chosen.orders)
                # The record is settled and without means already.
                row |= _of_model(fit_model([data], chosen.estimator, chosen.orders, keep_mean=True))
        except SysidError as error:
            row["reasons"] = (str(error),)
    return RecoveredBandwidth(
        joint=recording.joint,
        method=method,
        test=recording.test,
        seed=recording.seed,
        scenario=data.name,
        true_hz=true_hz,
        best_linear=best_linear,
        lowest_excited_hz=lowest,
        **row,
    )


def _of_model(fitted: FittedModel) -> dict[str, Any]:
    """Numbers of a row from a model: its bandwidth, and what of it may be claimed."""
    claim, model = fitted.claims[0][0], fitted.estimate.model
    hz, *ci95 = fitted.band.path()
    reasons = claim.warnings
    if not claim.refused and not np.isfinite(claim.hz):
        reasons = ("the model's gain does not fall by 3 dB from its value at 0 Hz below half of the sampling rate",)
    return {
        "hz": claim.hz,
        "ci95": (claim.low, claim.high),
        "distorted_ci95": _with_distortion(fitted),
        "model_hz": hz,
        "model_ci95": tuple(ci95),
        "dc_gain": float(model.dc_gain()[0, 0]),
        "half_power_hz": half_power_hz(model),
        "reasons": reasons,
    }


def _with_distortion(fitted: FittedModel) -> tuple[float, float]:
    """Interval of a claimed bandwidth with distortion and order; the claim's own where noise explains all."""
    claim, error = fitted.claims[0][0], gains_with_error(fitted)
    if error is None or not np.isfinite(claim.hz) or np.isnan(error.p_values[0]):
        return NAN, NAN
    if not error.is_wider[0]:
        return claim.low, claim.high
    low, high = (float(end[0, 0]) for end in error.bandwidth().ci95)
    return low, high


def _of_response(response: FrequencyResponse, recording: Recording) -> dict[str, Any]:
    """Numbers of a row from a response without a model, if enough lines tell the gain at 0 Hz."""
    level = gain_crossing(response, HALF_POWER)
    lines = int(np.sum(response.frequencies <= REACH * level)) if np.isfinite(level) else 0
    if lines < DEGREE + 2:
        # With fewer, lines beyond the bandwidth would fix the gain at 0 Hz, with an interval that knows of noise alone.
        return {"half_power_hz": level, "reasons": (_too_few_lines(lines, recording),)}
    hz, *ci95 = response_bandwidth(response).path()
    reasons = () if np.isfinite(hz) else ("the response never falls to half of its power at 0 Hz",)
    return {
        "hz": hz,
        "ci95": tuple(ci95),
        "model_hz": hz,
        "model_ci95": tuple(ci95),
        "half_power_hz": level,
        "reasons": reasons,
    }


def _too_few_lines(lines: int, recording: Recording) -> str:
    reason = (
        f"too few lines of the response lie below {REACH:g} times the frequency of the gain 0.707 to tell the gain "
        f"at 0 Hz, {lines} where {DEGREE + 2} are needed"
    )
    if periodic(recording.data, recording.setting.period):
        window = recording.setting.period / SAMPLE_RATE
        reason += f": the command repeats every {window:g} s and excites a line every {1 / window:.2g} Hz"
    return reason


def _response(record: IOData, method: str, period: int) -> FrequencyResponse:
    """Estimate the response on the lines of the command, or on an even grid where it is not periodic."""
    if periodic(record, period):
        lines = np.arange(1, period // 2) * SAMPLE_RATE / period
        if method == "spa":
            return sysid.spa(record, lag=long_lag(record), frequencies=lines)
        starts = range(0, len(record) - period + 1, period)
        return sysid.etfe([record[start : start + period] for start in starts])
    if method == "etfe":
        raise SysidError(f"the command does not repeat every {period} samples; the mean over periods has none")
    # A held command has next to no power at half of the sampling rate.
    return sysid.spa(record, lag=long_lag(record)).determined()


def periodic(record: IOData, period: int) -> bool:
    """Whether the command repeats after a number of samples, but for noise of the wires."""
    u = record.u[:, 0]
    if len(u) < 2 * period:
        return False
    return float(np.std(u[period:] - u[:-period])) < REPEATS * float(np.std(u))
