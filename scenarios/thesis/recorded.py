"""Recorded conclusions of twenty seeds, and the check that a study agrees with them."""

from collections.abc import Iterator
from functools import cache
from importlib import resources

from scenarios.thesis.outcome import SeedOutcome
from scenarios.thesis.tally import Tally, read_tally

FILE = "findings.json"
"""File among the package's data; tests/benchmarks/findings.py writes it."""

ROUNDING = 0.01
"""Rounding on another machine moves a number by less than this part of the range over the seeds."""

DIGITS = 1e-6
"""Where the seeds agree, rounding moves a number by less than this part of itself."""


@cache
def recorded() -> Tally:
    """The tally that comes with the package: whole records of the nominal arm, seeds 1 to 20."""
    text = resources.files("scenarios").joinpath("data", FILE).read_text(encoding="utf-8")
    return read_tally(text, recorded=True)


def contradictions(found: SeedOutcome, reference: Tally) -> tuple[str, ...]:
    """List the contradictions between a study of one of the seeds and the tally.

    Args:
        found: What the study concluded.
        reference: The tally; it holds the same seed.

    Returns:
        A line for every verdict that is not the one recorded of this seed, for every number and bandwidth that lies
        outside those of all seeds (widened by what rounding moves), and for whatever one has and the other lacks.

    Raises:
        ScenarioError: The tally does not hold the seed.
    """
    return tuple(_contradictions(found, reference))


def _contradictions(found: SeedOutcome, reference: Tally) -> Iterator[str]:
    before = reference.of(found.seed if found.seed is not None else -1)
    for key in sorted({*before.verdicts, *found.verdicts}, key=lambda name: int(name[1:])):
        verdicts = before.verdicts.get(key, "not recorded"), found.verdicts.get(key, "not tried")
        if verdicts[0] != verdicts[1]:
            yield f"{key}: {verdicts[1]}, recorded of seed {found.seed}: {verdicts[0]}"
    yield from _outside(_numbers(found), [_numbers(entry) for entry in reference.outcomes])


def _numbers(found: SeedOutcome) -> dict[str, float]:
    """Every number of an outcome by a name of its own."""
    of_findings = {f"{key} {name}": value for key, part in found.numbers.items() for name, value in part.items()}
    of_methods = {
        f"bandwidth of {joint}, {method}, {what}": value
        for joint, methods in found.recovered.items()
        for method, entry in methods.items()
        for what, value in (
            ("Hz", entry.hz),
            ("lower end", entry.ci95[0]),
            ("upper end", entry.ci95[1]),
            ("0.707 at", entry.half_power_hz),
        )
    }
    true = {f"bandwidth of {joint}, truth": value for joint, value in found.true_hz.items()}
    return {**of_findings, **of_methods, **true}


def _outside(found: dict[str, float], reference: list[dict[str, float]]) -> Iterator[str]:
    names = dict.fromkeys(name for entry in reference for name in entry)
    for name in {**names, **found}:
        values = [entry[name] for entry in reference if name in entry]
        if name not in found:
            if len(values) == len(reference):
                yield f"{name}: not there, but with every seed recorded"
        elif not values:
            yield f"{name}: {found[name]:.6g}, not recorded"
        else:
            low, high = min(values), max(values)
            room = ROUNDING * (high - low) + DIGITS * max(abs(low), abs(high))
            # The first comparison is for what is infinite with some seed, as the end of an interval may be.
            if found[name] not in values and not low - room <= found[name] <= high + room:
                yield f"{name}: {found[name]:.6g}, recorded {low:.6g} to {high:.6g}"
