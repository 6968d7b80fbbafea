"""Claims of the thesis with their criteria, the findings that test them, and the rules that give verdicts."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from datetime import date
from string import Formatter
from types import MappingProxyType
from typing import Literal

import numpy as np

from hmtb_twin import STUDIED_JOINTS
from scenarios.files.toml_file import package_table

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
    """A later change of a criterion, and whether verdicts by the former one had been seen by then."""

    date: date
    what: str
    why: str
    after_results: bool


@dataclass(frozen=True)
class ThesisClaim:
    """A claim of the thesis, its criterion and its sentences; `scenarios/data/criteria.toml` explains the fields."""

    key: str
    claim: str
    where: str
    thesis: str
    unit: str
    criterion: str
    date: date
    why: str
    limits: Mapping[str, float]
    cause: str = ""
    by_construction: str = ""
    changes: tuple[Change, ...] = ()

    @property
    def changed_after_results(self) -> bool:
        """Whether the criterion was changed after verdicts by a former one had been seen."""
        return any(change.after_results for change in self.changes)


class _Sentences(Formatter):
    """Formatter of sentences: several numbers become a list, or a range where the format begins with `to`."""

    def format_field(self, value: object, spec: str) -> str:
        """Format one field; numbers have the minus sign of print."""
        if isinstance(value, Sequence) and not isinstance(value, str):
            if spec.startswith("to"):
                return " to ".join(dict.fromkeys(self.format_field(end(value), spec[2:]) for end in (min, max)))
            return ", ".join(self.format_field(one, spec) for one in value)
        if isinstance(value, str):
            return value
        return "nothing" if value != value else format(value, spec).replace("-", "−")


def _claims() -> Mapping[str, ThesisClaim]:
    table = package_table("criteria.toml")
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
    def about(self) -> ThesisClaim:
        """The claim that it tests."""
        return CLAIMS[self.key]


def decided_finding(key: str, parts: Parts, value: Mapping[str, float], facts: Mapping[str, object]) -> Finding:
    """Decide a claim that can be read in one way; see `finding_by_reading`."""
    return finding_by_reading(key, {"": parts}, value, facts)


def finding_by_reading(
    key: str, readings: Mapping[str, Parts], value: Mapping[str, float], facts: Mapping[str, object]
) -> Finding:
    """Decide a claim by its parts under every reading.

    All parts hold: reproduced (by construction where the table says so); none: not reproduced; some: partly, and the
    reason names them. Readings that give different verdicts: it depends on the reading.

    Args:
        key: F1 to F26.
        readings: By reading, in words that follow a verdict, the parts of the claim; the name may be empty.
        value: Numbers by name; those that are not finite are left out.
        facts: Fields of the claim's sentences `why` and `cause`, which have those of its limits too. Several numbers
            become a list, or a range where the format begins with `to`.

    Returns:
        The finding; where a part fails and nothing is known of the cause, it says "not tried".
    """
    claim = CLAIMS[key]
    why, cause = (_Sentences().format(text, **{**claim.limits, **facts}) for text in (claim.why, claim.cause))
    named = {name: {words(part): bool(holds) for part, holds in parts.items()} for name, parts in readings.items()}
    verdicts = {name: _verdict(parts, claim) for name, parts in named.items()}
    agreed = set(verdicts.values())
    decision: Verdict = agreed.pop() if len(agreed) == 1 else "depends on the reading"
    decided = "; ".join(
        f"{verdicts[name]} {name}".strip() + _differing(parts)
        for name, parts in named.items()
        if name or verdicts[name] == "partly"
    )
    sentences = [text[:1].upper() + text[1:] for text in (decided, why)]
    if decision == "reproduced by construction":
        sentences.append(f"By construction: {claim.by_construction}")
    elif decision != "reproduced":
        sentences.append(f"Cause: {cause or 'not tried'}")
    flat = {f"{part} {name}".strip(): holds for name, parts in named.items() for part, holds in parts.items()}
    numbers = {name: float(number) for name, number in value.items() if np.isfinite(number)}
    return Finding(key, decision, numbers, ". ".join(filter(None, sentences)), flat)


def _verdict(parts: Parts, claim: ThesisClaim) -> Verdict:
    if all(parts.values()):
        return "reproduced by construction" if claim.by_construction else "reproduced"
    return "partly" if any(parts.values()) else "not reproduced"


def _differing(parts: Parts) -> str:
    """Name the parts that hold and those that do not, where some do."""
    holding, failing = ([name for name, holds in parts.items() if holds is kind] for kind in (True, False))
    return f" (holds: {_grouped(holding)}; fails: {_grouped(failing)})" if holding and failing else ""


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
