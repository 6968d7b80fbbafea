"""Tally of the verdicts over many seeds, and its statistics in words."""

import json
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from hmtb_twin.files.atomic_write import write_whole
from scenarios.files.errors import ScenarioError
from scenarios.identification.recovered_bandwidth import near_1_hz
from scenarios.thesis.finding import Finding, Verdict
from scenarios.thesis.outcome import SeedOutcome, outcome_from

STEADY = 0.9
"""A conclusion that fewer than this part of the seeds share depends on the seed."""

FEW = 40
"""Up to so many seeds a range over 95 % of them leaves none out."""


@dataclass(frozen=True)
class Spread:
    """Distribution of a number over the seeds.

    Attributes:
        median: Its median.
        low: Lower end of what 95 % of the seeds lie in: a value that a seed has, the smallest of all up to 40 seeds.
        high: Upper end, likewise.
        smallest: The smallest of all.
        largest: The largest of all.
        seeds: How many seeds have it.
        shares: Where the seeds have two values only, each with the number of seeds; else empty.
    """

    median: float
    low: float
    high: float
    smallest: float
    largest: float
    seeds: int
    shares: tuple[tuple[float, int], ...] = ()


@dataclass(frozen=True)
class Frequency:
    """Frequency of each verdict of a finding.

    Attributes:
        counts: Number of seeds by verdict, the most frequent first.
    """

    counts: Mapping[Verdict, int]

    @property
    def seeds(self) -> int:
        """Number of seeds that decided the finding."""
        return sum(self.counts.values())

    @property
    def usual(self) -> Verdict:
        """The verdict that most seeds share."""
        return next(iter(self.counts))

    @property
    def depends(self) -> bool:
        """Whether the verdict depends on the seed: fewer than nine in ten share one."""
        return self.depends_on_seed(self.usual)

    def depends_on_seed(self, verdict: Verdict) -> bool:
        """Whether a verdict depends on the seed: fewer than nine in ten seeds reach it."""
        return self.counts.get(verdict, 0) < STEADY * self.seeds

    def against(self, verdict: Verdict) -> bool:
        """Whether more seeds reached another verdict than this one."""
        return self.counts.get(verdict, 0) < self.counts[self.usual]


@dataclass(frozen=True)
class BandwidthCoverage:
    """One method's bandwidth on one joint over the seeds.

    Attributes:
        hz: MethodBandwidth bandwidth, Hz.
        half_power_hz: Frequency of the gain 0.707, Hz.
        width: Width of the 95 % intervals, Hz.
        covers: Number of seeds whose interval holds the small-signal truth.
        near: Number of seeds with a bandwidth of about 1 Hz.
    """

    hz: Spread
    half_power_hz: Spread
    width: Spread
    covers: int
    near: int


@dataclass(frozen=True, eq=False)
class Tally:
    """The conclusions of many seeds.

    Attributes:
        outcomes: One for each seed that came to an end, in the order of the seeds.
        failed: Seeds that did not, with the reason.
        recorded: Whether it came with the package, made earlier, rather than in this run.
    """

    outcomes: tuple[SeedOutcome, ...]
    failed: Mapping[int, str]
    recorded: bool = False

    @property
    def versions(self) -> Mapping[str, str]:
        """Versions of what it was made with."""
        return self.outcomes[0].versions

    @property
    def duration(self) -> float | None:
        """Length of the records where it was shortened, s."""
        return self.outcomes[0].duration

    @property
    def all_seeds(self) -> bool:
        """Whether ranges span all seeds: for so few seeds the 95 % range is the full range."""
        return len(self.outcomes) <= FEW

    @property
    def physics_s(self) -> float:
        """Time inside the physics engine, all seeds, s."""
        return sum(entry.cost.physics_s for entry in self.outcomes)

    @property
    def total_s(self) -> float:
        """Time in all, all seeds, s."""
        return sum(entry.cost.total_s for entry in self.outcomes)

    def of(self, seed: int) -> SeedOutcome:
        """Return the conclusions of a seed.

        Raises:
            ScenarioError: It is none of the seeds.
        """
        for entry in self.outcomes:
            if entry.seed == seed:
                return entry
        raise ScenarioError(f"no seed {seed} in this tally, it has {[entry.seed for entry in self.outcomes]}")

    def frequency(self, key: str) -> Frequency:
        """Return the frequency of each verdict of a finding.

        Args:
            key: F1 to F26.
        """
        counts = Counter(entry.verdicts[key] for entry in self.outcomes if key in entry.verdicts)
        return Frequency(dict(counts.most_common()))

    def spread(self, key: str) -> dict[str, Spread]:
        """Return the distributions of the numbers of a finding, by name.

        Args:
            key: F1 to F26.
        """
        values: dict[str, list[float]] = {}
        for entry in self.outcomes:
            for name, value in entry.numbers.get(key, {}).items():
                values.setdefault(name, []).append(value)
        return {name: spread(entries) for name, entries in values.items()}

    def coverage(self, joint: str, method: str) -> BandwidthCoverage:
        """Return the distribution of one method's bandwidth on one joint.

        Args:
            joint: Name of the joint.
            method: Key of the method.
        """
        recoveries = [entry.recovered[joint][method] for entry in self.outcomes]
        return BandwidthCoverage(
            spread([entry.hz for entry in recoveries]),
            spread([entry.half_power_hz for entry in recoveries]),
            spread([entry.ci95[1] - entry.ci95[0] for entry in recoveries]),
            sum(entry.covers for entry in recoveries),
            sum(near_1_hz(entry.hz) for entry in recoveries),
        )


def spread(values: Sequence[float]) -> Spread:
    """Median, 95 % range and ends of a number over the seeds.

    The ends of the range are values that seeds have, taken outwards: counts stay counts, and of few seeds none lies
    outside.

    Args:
        values: One for each seed; where one is not a number, nothing is.
    """
    with np.errstate(invalid="ignore"):
        median = float(np.median(values))
    low = float(np.quantile(values, 0.025, method="lower"))
    high = float(np.quantile(values, 0.975, method="higher"))
    counts = Counter(values)
    shares = tuple(sorted(counts.items())) if len(counts) == 2 < len(values) else ()
    return Spread(median, low, high, float(np.min(values)), float(np.max(values)), len(values), shares)


def write_tally(tally: Tally, path: Path) -> None:
    """Write a tally as JSON, a line for each seed.

    Args:
        tally: The tally.
        path: The file.
    """
    lines = ",\n".join(json.dumps(entry.record(), allow_nan=False) for entry in tally.outcomes)
    failed = json.dumps({str(seed): why for seed, why in tally.failed.items()})
    write_whole(path, f'{{"failed": {failed},\n"seeds": [\n{lines}\n]}}\n')


def read_tally(text: str, *, recorded: bool = False) -> Tally:
    """Read what `write_tally` wrote.

    Args:
        text: The JSON.
        recorded: Whether it came with the package.

    Returns:
        The tally.
    """
    record = json.loads(text)
    outcomes = tuple(outcome_from(entry) for entry in record["seeds"])
    return Tally(outcomes, {int(seed): why for seed, why in record["failed"].items()}, recorded)


TINY = 1e-300
"""Probabilities below this are printed as such: the tail of the distribution is not computed further."""


def minus(text: str) -> str:
    """The text with the minus sign of print for every hyphen; for numbers only."""
    return text.replace("-", "−")


def number(value: float, digits: int = 4) -> str:
    """A number as text, counts without decimals, all others to the same significant digits."""
    if not np.isfinite(value):
        return "–"
    if value == 0.0 or (float(value).is_integer() and abs(value) < 1000):
        return minus(f"{value:.0f}")
    return minus(f"{value:#.{digits}g}".rstrip("."))


def p_value(p: float) -> str:
    """A probability as text."""
    return f"p < {TINY:g}" if p < TINY else f"p = {p:.2g}"


def measure(value: float, finding: Finding) -> str:
    """A number of a finding; a probability too small to have been computed is said to be so."""
    return f"< {TINY:g}" if value < TINY and "p-value" in finding.unit else number(value)


def parts(finding: Finding) -> list[tuple[str, str, str | None]]:
    """The numbers of a finding as they are shown, one after the other.

    Args:
        finding: The finding. A number named `of`, or `of ...`, is the whole of which the one before it counts a part.

    Returns:
        Name of each number, the number, and the whole that it is a part of; the name is empty where there is one only.
    """
    if not isinstance(finding.value, Mapping):
        return [("", measure(finding.value, finding), None)]
    parts: list[tuple[str, str, str | None]] = []
    for name, value in finding.value.items():
        text = measure(value, finding)
        if parts and (name == "of" or name.startswith("of ")):
            parts[-1] = (*parts[-1][:2], text)
        else:
            parts.append((name, text, None))
    return parts


def limits(spread: Spread | None, finding: Finding) -> str:
    """Return the range of a finding's number over the seeds, in brackets; empty where it does not move.

    Args:
        spread: The number over the seeds, if they have it.
        finding: The finding.
    """
    if spread is None or spread.low == spread.high or np.isnan(spread.low):
        return ""
    if spread.shares:
        return f"({', '.join(f'{measure(value, finding)} with {count}' for value, count in spread.shares)} seeds)"
    return f"({measure(spread.low, finding)} – {measure(spread.high, finding)})"


def root(value: complex, digits: int = 3) -> str:
    """A pole or zero as text."""
    value = complex(value)
    if abs(value.imag) < 0.5 * 10.0**-digits:
        return minus(f"{value.real:.{digits}f}")
    sign = "+" if value.imag > 0 else "−"
    return minus(f"{value.real:.{digits}f}") + f" {sign} {abs(value.imag):.{digits}f}j"


def value_text(value: object) -> str:
    """Value of a parameter as text; several numbers are joined by crosses."""
    if isinstance(value, tuple | list):
        return " × ".join(value_text(part) for part in value)
    return f"{value:.5g}" if isinstance(value, float | int) else str(value)
