"""Outcome of one seed: verdicts with their numbers, and bandwidths, without the records."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from scenarios.thesis.comparison import Comparison, Cost
from scenarios.thesis.finding import Finding, Verdict

ALONE = "value"
"""Name of a finding's number where it has only one."""


@dataclass(frozen=True)
class MethodBandwidth:
    """The bandwidth that one method recovered.

    Attributes:
        hz: Bandwidth, Hz.
        ci95: Its 95 % interval, Hz.
        covers: Whether the interval holds the small-signal truth.
        half_power_hz: Frequency at which the gain is 0.707, whatever it is at 0 Hz, Hz.
    """

    hz: float
    ci95: tuple[float, float]
    covers: bool
    half_power_hz: float


@dataclass(frozen=True)
class SeedOutcome:
    """Conclusions of a study with one seed.

    Attributes:
        seed: Of the study, None for the scenarios' own seeds.
        duration: Length of the records where it was shortened, s; None for the thesis' 240 s.
        verdicts: By finding.
        numbers: By finding the numbers that its verdict rests on, by name.
        true_hz: Small-signal bandwidth by joint, Hz.
        recovered: Recovered bandwidths by joint and method.
        failed: Experiments that failed, with the reason.
        cost: Time spent.
        versions: Of what it was made with.
    """

    seed: int | None
    duration: float | None
    verdicts: Mapping[str, Verdict]
    numbers: Mapping[str, Mapping[str, float]]
    true_hz: Mapping[str, float]
    recovered: Mapping[str, Mapping[str, MethodBandwidth]]
    failed: Mapping[str, str]
    cost: Cost
    versions: Mapping[str, str]

    def record(self) -> dict[str, Any]:
        """The outcome as plain mappings for JSON; non-finite numbers become the strings nan, inf, -inf."""
        return {
            "seed": self.seed,
            "duration": self.duration,
            "findings": {
                key: {"verdict": verdict, "value": {name: _json_number(x) for name, x in self.numbers[key].items()}}
                for key, verdict in self.verdicts.items()
            },
            "bandwidth": {
                joint: {
                    "true_hz": self.true_hz[joint],
                    "recovered": {
                        method: {
                            "hz": _json_number(entry.hz),
                            "ci95": [_json_number(end) for end in entry.ci95],
                            "covers": entry.covers,
                            "half_power_hz": _json_number(entry.half_power_hz),
                        }
                        for method, entry in methods.items()
                    },
                }
                for joint, methods in self.recovered.items()
            },
            "failed": dict(self.failed),
            "cost": {
                "physics_s": self.cost.physics_s,
                "simulation_s": self.cost.simulation_s,
                "total_s": self.cost.total_s,
            },
            "versions": dict(self.versions),
        }


def outcome(study: Comparison, findings: Sequence[Finding]) -> SeedOutcome:
    """Return the conclusions of a study.

    Args:
        study: The study.
        findings: Its findings, decided.

    Returns:
        Verdicts, numbers and bandwidths.
    """
    return SeedOutcome(
        seed=study.seed,
        duration=study.duration,
        verdicts={entry.key: entry.verdict for entry in findings},
        numbers={entry.key: numbers(entry) for entry in findings},
        true_hz={name: float(entry.truth.bandwidth_hz) for name, entry in study.joints.items()},
        recovered={
            name: {
                model.method: MethodBandwidth(model.bandwidth_hz, model.ci95, model.covers, model.half_power_hz)
                for model in entry.models.values()
            }
            for name, entry in study.joints.items()
        },
        failed=dict(study.failed),
        cost=study.cost,
        versions=dict(study.provenance),
    )


def numbers(finding: Finding) -> dict[str, float]:
    """The numbers of a finding by name."""
    value = finding.value
    return {name: float(x) for name, x in value.items()} if isinstance(value, Mapping) else {ALONE: float(value)}


def outcome_from(record: Mapping[str, Any]) -> SeedOutcome:
    """Rebuild an outcome from a mapping that `SeedOutcome.record` wrote.

    Args:
        record: The plain mappings.

    Returns:
        The outcome, its numbers the same to the last bit.

    Raises:
        KeyError: An entry is missing.
    """
    return SeedOutcome(
        seed=record["seed"],
        duration=record["duration"],
        verdicts={key: entry["verdict"] for key, entry in record["findings"].items()},
        numbers={
            key: {name: float(x) for name, x in entry["value"].items()} for key, entry in record["findings"].items()
        },
        true_hz={joint: entry["true_hz"] for joint, entry in record["bandwidth"].items()},
        recovered={
            joint: {
                method: MethodBandwidth(
                    float(recovery["hz"]),
                    (float(recovery["ci95"][0]), float(recovery["ci95"][1])),
                    recovery["covers"],
                    float(recovery["half_power_hz"]),
                )
                for method, recovery in entry["recovered"].items()
            }
            for joint, entry in record["bandwidth"].items()
        },
        failed=record["failed"],
        cost=Cost(**record["cost"]),
        versions=record["versions"],
    )


def _json_number(value: float) -> float | str:
    return value if math.isfinite(value) else str(value)
