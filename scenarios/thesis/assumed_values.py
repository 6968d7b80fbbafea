"""Thesis values used to build the twin: finding them again is no independent evidence on the real arm."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from math import degrees

from hmtb_twin import STUDIED_JOINTS
from hmtb_twin.parameters.drives import Friction
from hmtb_twin.parameters.values import BUS, HAND_CONTROLLER, MOTIONS, SERVOS
from scenarios.thesis.finding import Finding
from scenarios.truth.published import published


@dataclass(frozen=True)
class AssumedValue:
    """A value of the twin that comes from the thesis.

    Attributes:
        what: The value.
        why: Its origin, and what follows.
        findings: Findings that it affects.
    """

    what: str
    why: str
    findings: tuple[str, ...]


def assumed_values() -> tuple[AssumedValue, ...]:
    """Return every such value, as it is in the nominal arm."""
    servos = [SERVOS[name] for name in STUDIED_JOINTS]
    delays = sorted({BUS[name].delay for name in STUDIED_JOINTS})
    limits = [degrees(MOTIONS[name].velocity_limit) for name in STUDIED_JOINTS]
    printed = [model for name in STUDIED_JOINTS for model in published(name)]
    return (
        AssumedValue(
            f"servo poles: a slow one at {_span(s.slow_pole for s in servos)} rad/s, fast ones at "
            f"{_span(s.fast_pole for s in servos)} rad/s",
            f"after the dominant poles of the {len(printed)} printed models: a bandwidth near 1 Hz is put in",
            ("F1", "F16", "F22"),
        ),
        AssumedValue(
            f"bus delays of {_span(delays)} samples",
            "nk - 1 of the printed models of each joint",
            ("F3",),
        ),
        AssumedValue(
            f"seal friction: {100 * Friction().coulomb:g} % of the greatest torque",
            "gains of the printed pitch models near one allow little more; it bears on every interval that misses",
            ("F7", "F9"),
        ),
        AssumedValue(
            f"gain of the hand controller: {HAND_CONTROLLER.gain:g} rad/V",
            f"from the printed OKID matrices; with the assumed limit of {_span(limits)} deg/s it decides how much of a "
            "test is spent at the velocity limit",
            ("F4", "F5"),
        ),
    )


def assumed_values_of(findings: Sequence[Finding]) -> dict[str, tuple[AssumedValue, ...]]:
    """Return the assumed values that affect each finding; findings without one are left out."""
    known = assumed_values()
    found = {entry.key: tuple(part for part in known if entry.key in part.findings) for entry in findings}
    return {key: parts for key, parts in found.items() if parts}


def _span(values: Iterable[float]) -> str:
    """The value, or the ends of their range from the smallest amount on."""
    shown = [f"{value:g}".replace("-", "−") for value in sorted(set(values), key=abs)]
    return shown[0] if len(shown) == 1 else f"{shown[0]} to {shown[-1]}"
