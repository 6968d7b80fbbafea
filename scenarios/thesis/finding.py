"""Claims of the thesis with their criteria, findings on them, and the rules that give verdicts."""

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
    constructed: tuple[str, ...] = ()
    known: str = ""
    changes: tuple[Change, ...] = ()

    def constructs(self, name: str) -> bool:
        """Whether a part holds by construction while others are tested: named whole, or without its joint."""
        statement, _, _ = name.partition(" on ")
        return name in self.constructed or statement in self.constructed

    @property
    def changed_after_results(self) -> bool:
        """Whether the criterion was changed after verdicts by a former one had been seen."""
        return any(change.after_results for change in self.changes)


class _Sentences(Formatter):
    """Formatter of sentences: several numbers become a list, or a range where the format begins with `to`."""

    def format_field(self, value: object, spec: str) -> str:
        """Format one field; numbers have the minus sign of print."""
        if isinstance(value, str):
            return value
        if isinstance(value, Sequence):
            if spec.startswith("to"):
                number_spec = spec.removeprefix("to")
                ends = [self.format_field(end, number_spec) for end in (min(value), max(value))]
                # Once, where both ends read the same: no "1.0 to 1.0".
                return " to ".join(dict.fromkeys(ends))
            return ", ".join(self.format_field(item, spec) for item in value)
        # NaN, which alone differs from itself.
        if value != value:
            return "nothing"
        return format(value, spec).replace("-", "−")


def _read_claims() -> Mapping[str, ThesisClaim]:
    """Read the table of claims; criteria and their changes get the numbers of the claim's limits."""
    table = package_table("criteria.toml")
    common_limits = table.pop("common")
    claims = {}
    for key, row in table.items():
        limits = {**common_limits, **row.pop("limits", {})}
        changes = []
        for change in row.pop("changes", ()):
            changes.append(Change(**{**change, "what": change["what"].format(**limits)}))
        row["criterion"] = row["criterion"].format(**limits)
        row["constructed"] = tuple(row.get("constructed", ()))
        # What is left of the row has the names of fields.
        claims[key] = ThesisClaim(key, **row, limits=MappingProxyType(limits), changes=tuple(changes))
    return MappingProxyType(claims)


CLAIMS: Mapping[str, ThesisClaim] = _read_claims()
"""Every claim, in order; `scenarios/data/criteria.toml` holds the table."""


@dataclass(frozen=True)
class UndecidedClaim:
    """A claim of the thesis that the twin cannot decide, and the reason."""

    claim: str
    where: str
    why: str


UNDECIDED: tuple[UndecidedClaim, ...] = tuple(
    UndecidedClaim(**row) for row in package_table("undecided_claims.toml")["undecided"]
)
"""Claims that the twin cannot decide, in the thesis' order; `scenarios/data/undecided_claims.toml` holds the table."""


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
        """The claim that the finding tests."""
        return CLAIMS[self.key]


def decided_finding(key: str, parts: Parts, value: Mapping[str, float], facts: Mapping[str, object]) -> Finding:
    """Decide a claim that can be read in one way; see `finding_by_reading`."""
    # The one reading has no name, and its parts get none to follow them.
    return finding_by_reading(key, {"": parts}, value, facts)


def finding_by_reading(
    key: str, readings: Mapping[str, Parts], value: Mapping[str, float], facts: Mapping[str, object]
) -> Finding:
    """Decide a claim by its parts under every reading.

    All parts hold: reproduced (by construction where the table says so); none: not reproduced; some: partly, and the
    reason names them. Where the table names parts that hold by construction, only the others count, and those of them
    that fail nevertheless. Readings that give different verdicts: it depends on the reading.

    Args:
        key: One of `CLAIMS`.
        readings: By reading, in words that follow a verdict, the parts of the claim; the name may be empty.
        value: Numbers by name; those that are not finite are left out.
        facts: Fields of the claim's sentences `why` and `cause`, which have those of its limits too. Several numbers
            become a list, or a range where the format begins with `to`.

    Returns:
        The finding; where a part fails and nothing is known of the cause, it says "not tried".
    """
    claim = CLAIMS[key]
    fields = {**claim.limits, **facts}
    why = _Sentences().format(claim.why, **fields)
    cause = _Sentences().format(claim.cause, **fields)

    outcomes = {reading: _printable(parts) for reading, parts in readings.items()}
    constructed = _constructed(outcomes, claim)
    tested = {reading: _without(outcome, constructed) for reading, outcome in outcomes.items()}
    verdicts = {reading: _verdict(outcome, claim) for reading, outcome in tested.items()}
    agreed = set(verdicts.values())
    decision: Verdict = agreed.pop() if len(agreed) == 1 else "depends on the reading"

    sentences = [_capitalised(_decided_text(verdicts, tested)), _capitalised(why)]
    if constructed:
        sentences.append(f"By construction, and not counted: {_grouped(constructed)}, because {claim.by_construction}")
    if decision == "reproduced by construction":
        sentences.append(f"By construction: {claim.by_construction}")
    elif decision != "reproduced":
        sentences.append(f"Cause: {cause or 'not tried'}")
    # JSON has no word for a number that is not finite.
    finite = {name: float(number) for name, number in value.items() if np.isfinite(number)}
    return Finding(
        key, decision, finite, ". ".join(filter(None, sentences)), _under_every_reading(outcomes, constructed)
    )


def _constructed(outcomes: Mapping[str, Parts], claim: ThesisClaim) -> tuple[str, ...]:
    """Names of parts that hold under every reading and do so by construction; one that fails is tested like others."""
    names: dict[str, bool] = {}
    for outcome in outcomes.values():
        for name, holds in outcome.items():
            if claim.constructs(name):
                names[name] = names.get(name, True) and holds
    return tuple(name for name, holds in names.items() if holds)


def _without(outcome: Parts, names: Sequence[str]) -> dict[str, bool]:
    return {name: holds for name, holds in outcome.items() if name not in names}


def _printable(parts: Parts) -> dict[str, bool]:
    """Parts with names as people write them; comparisons of arrays give NumPy's booleans, which JSON refuses."""
    return {words(name): bool(holds) for name, holds in parts.items()}


def _verdict(outcome: Parts, claim: ThesisClaim) -> Verdict:
    """Verdict on a claim under one reading, by the parts that count."""
    if all(outcome.values()):
        # What follows from how the models or the twin are made is no evidence for the claim. Without a part that was
        # tested nothing else is left.
        untested = claim.by_construction and (not claim.constructed or not outcome)
        return "reproduced by construction" if untested else "reproduced"
    return "partly" if any(outcome.values()) else "not reproduced"


def _decided_text(verdicts: Mapping[str, Verdict], outcomes: Mapping[str, Parts]) -> str:
    """Verdict under every reading that has a name, or of which some parts hold and others fail."""
    texts = []
    for reading, verdict in verdicts.items():
        # Of a claim that is read in one way, the verdict of the finding says as much.
        if reading or verdict == "partly":
            texts.append(f"{verdict} {reading}".strip() + _differing(outcomes[reading]))
    return "; ".join(texts)


def _under_every_reading(outcomes: Mapping[str, Parts], constructed: Sequence[str]) -> dict[str, bool]:
    """All parts in one table, named with their reading; those that do not count say so."""
    table = {}
    for reading, outcome in outcomes.items():
        for name, holds in outcome.items():
            note = " (by construction)" if name in constructed else ""
            table[f"{name} {reading}".strip() + note] = holds
    return table


def _capitalised(text: str) -> str:
    # `str.capitalize` would put the rest of the text in small letters: OKID, ARMAX.
    return text[:1].upper() + text[1:]


def _differing(outcome: Parts) -> str:
    """Name the parts that hold and those that do not, where there are both."""
    holding = [name for name, holds in outcome.items() if holds]
    failing = [name for name, holds in outcome.items() if not holds]
    if not holding or not failing:
        return ""
    return f" (holds: {_grouped(holding)}; fails: {_grouped(failing)})"


def _grouped(names: Sequence[str]) -> str:
    """List parts named such as "bandwidth on elbow pitch", the joints of one statement together."""
    joints_by_statement: dict[str, list[str]] = {}
    for name in names:
        statement, _, joint = name.partition(" on ")
        joints = joints_by_statement.setdefault(statement, [])
        if joint:
            joints.append(joint)
    texts = []
    for statement, joints in joints_by_statement.items():
        if not joints:
            texts.append(statement)
        elif len(joints) == len(STUDIED_JOINTS):
            texts.append(f"{statement} on every joint")
        else:
            texts.append(f"{statement} on {' and '.join(joints)}")
    return ", ".join(texts)


def words(name: str) -> str:
    """A name, of a joint as a rule, with spaces for underscores."""
    return name.replace("_", " ")
