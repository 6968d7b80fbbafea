"""Claims of the thesis with their criteria, the findings that test them, and the rules that give verdicts."""

import tomllib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from datetime import date
from importlib.resources import files
from types import MappingProxyType
from typing import Literal

from hmtb_twin import STUDIED_JOINTS

Verdict = Literal[
    "reproduced",
    "reproduced by construction",
    "partly",
    "depends on the reading",
    "not reproduced",
    "cannot be told",
]

Parts = Mapping[str, bool]
"""Parts of a claim by name, and whether each holds on the twin."""


@dataclass(frozen=True)
class Change:
    """A later change of a criterion.

    Attributes:
        date: Day of the change.
        what: The change.
        why: Its reason.
        after_results: Whether verdicts by the former criterion had been seen by then.
    """

    date: date
    what: str
    why: str
    after_results: bool


@dataclass(frozen=True)
class ThesisClaim:
    """A claim of the thesis and the criterion that decides it.

    Attributes:
        key: F1 to F26.
        claim: What it says.
        where: Where it says so.
        thesis: Its number or word for it.
        unit: Unit and meaning of the twin's numbers.
        criterion: What has to hold.
        date: Day on which the criterion was first written.
        limits: Thresholds of the criterion by name.
        by_construction: Why a success is no evidence; empty where it is some.
        changes: Later changes of the criterion.
    """

    key: str
    claim: str
    where: str
    thesis: str
    unit: str
    criterion: str
    date: date
    limits: Mapping[str, float]
    by_construction: str = ""
    changes: tuple[Change, ...] = ()

    @property
    def changed_after_results(self) -> bool:
        """Whether the criterion was changed after verdicts by a former one had been seen."""
        return any(change.after_results for change in self.changes)


def _claims() -> Mapping[str, ThesisClaim]:
    table = tomllib.loads((files("scenarios") / "data" / "criteria.toml").read_text(encoding="utf-8"))
    common = table.pop("common")
    claims = {}
    for key, entry in table.items():
        limits = {**common, **entry.pop("limits", {})}
        entry["criterion"] = entry["criterion"].format(**limits)
        changes = tuple(Change(**{**one, "what": one["what"].format(**limits)}) for one in entry.pop("changes", ()))
        claims[key] = ThesisClaim(key, **entry, limits=MappingProxyType(limits), changes=changes)
    return MappingProxyType(claims)


CLAIMS: Mapping[str, ThesisClaim] = _claims()
"""Every claim, in order; `scenarios/data/criteria.toml` holds the table."""


@dataclass(frozen=True)
class Finding:
    """A finding with its verdict and the numbers it rests on.

    Attributes:
        key: F1 to F26.
        verdict: Whether the twin shows the same.
        value: Numbers by name (joints, as a rule); empty where it cannot be told. One named `of`, or `of ...`, is the
            whole of which the number before it counts a part.
        why: What the verdict rests on, and the cause as far as an experiment shows it.
        parts: Parts of the claim, under every reading that counts, and whether each holds.
    """

    key: str
    verdict: Verdict
    value: Mapping[str, float]
    why: str
    parts: Parts = field(default_factory=dict)

    @property
    def claim(self) -> str:
        """What the thesis says."""
        return CLAIMS[self.key].claim

    @property
    def where(self) -> str:
        """Where it says so."""
        return CLAIMS[self.key].where

    @property
    def thesis(self) -> str:
        """Its number or word for it."""
        return CLAIMS[self.key].thesis

    @property
    def unit(self) -> str:
        """Unit and meaning of the numbers."""
        return CLAIMS[self.key].unit


def undecided_finding(key: str, why: str) -> Finding:
    """Return a finding that cannot be decided, and the reason."""
    return Finding(key, "cannot be told", {}, why)


def decided_finding(key: str, parts: Parts, value: Mapping[str, float], why: str, *, cause: str = "") -> Finding:
    """Decide a claim that can be read in one way; see `finding_by_reading`."""
    return finding_by_reading(key, {"": parts}, value, why, cause=cause)


def finding_by_reading(
    key: str, readings: Mapping[str, Parts], value: Mapping[str, float], why: str, *, cause: str = ""
) -> Finding:
    """Decide a claim by its parts under every reading.

    All parts hold: reproduced (by construction where the table says so); none: not reproduced; some: partly, and the
    reason names them. Readings that give different verdicts: it depends on the reading.

    Args:
        key: F1 to F26.
        readings: By reading, in words that follow a verdict, the parts of the claim; the name may be empty.
        value: Numbers by name.
        why: What the verdict rests on, sentences without the last full stop.
        cause: What an experiment shows of why a part fails; without one the finding says "not tried".

    Returns:
        The finding.
    """
    verdicts = {name: verdict(parts, key) for name, parts in readings.items()}
    agreed = set(verdicts.values())
    decision: Verdict = agreed.pop() if len(agreed) == 1 else "depends on the reading"
    decided = "; ".join(
        f"{verdicts[name]} {name}".strip() + _differing(parts)
        for name, parts in readings.items()
        if name or verdicts[name] == "partly"
    )
    sentences = [decided[:1].upper() + decided[1:], why[:1].upper() + why[1:]]
    if decision == "reproduced by construction":
        sentences.append(f"By construction: {CLAIMS[key].by_construction}")
    elif decision != "reproduced":
        sentences.append(f"Cause: {cause or 'not tried'}")
    flat = {f"{part} {name}".strip(): holds for name, parts in readings.items() for part, holds in parts.items()}
    return Finding(key, decision, value, ". ".join(filter(None, sentences)), flat)


def verdict(parts: Parts, key: str) -> Verdict:
    """Return the verdict on a claim from the parts that hold: all, some or none."""
    if all(parts.values()):
        return "reproduced by construction" if CLAIMS[key].by_construction else "reproduced"
    return "partly" if any(parts.values()) else "not reproduced"


def _differing(parts: Parts) -> str:
    """Name the parts that hold and those that do not, where some do."""
    holding, failing = ([name for name, holds in parts.items() if holds is kind] for kind in (True, False))
    if not holding or not failing:
        return ""
    return f" (holds: {_grouped(holding)}; fails: {_grouped(failing)})"


def _grouped(names: Sequence[str]) -> str:
    """List parts, the joints of one part together."""
    places: dict[str, list[str]] = {}
    for name in names:
        what, _, place = name.partition(" on ")
        places.setdefault(what, []).extend([place] if place else [])
    every = {what: "every joint" if len(on) == len(STUDIED_JOINTS) else " and ".join(on) for what, on in places.items()}
    return ", ".join(f"{what} on {on}" if on else what for what, on in every.items())


def words(name: str) -> str:
    """A name, of a joint as a rule, with spaces for underscores."""
    return name.replace("_", " ")
