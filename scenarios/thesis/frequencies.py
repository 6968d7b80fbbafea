"""Frequencies over seeds: how often a verdict was reached, and how far numbers move from seed to seed."""

from collections.abc import Mapping, Sequence
from dataclasses import asdict
from typing import get_args

from scenarios.report.page import Page
from scenarios.thesis.finding import Finding, Verdict
from scenarios.thesis.monte_carlo import Tally

ORDER: tuple[Verdict, ...] = get_args(Verdict)


def chance(findings: Sequence[Finding], tally: Tally | None, seed: int | None = None) -> dict[str, object]:
    """Collect the variables of the templates on many seeds, for the findings as this run with its seed decided them.

    Texts, how often each verdict came out, findings whose verdict of this run depends on the seed, those among them of
    which more seeds reached another, ranges of their numbers, and the bandwidths of `Tally.coverage`; nothing without
    seeds.
    """
    if tally is None:
        return {}
    pairs = [(entry, tally.frequency(entry.key)) for entry in findings]
    return {
        "source": source_text(tally, seed),
        "answer": answer_text(tally),
        "verdicts": {entry.key: frequency_text(entry, tally) for entry in findings},
        "depends": [one.key for one, seeds in pairs if seeds.counts and seeds.depends_on_seed(one.verdict)],
        "against": [one.key for one, seeds in pairs if seeds.counts and seeds.against(one.verdict)],
        "ranges": {entry.key: tally.spread(entry.key) for entry in findings},
        "rows": tally.coverage(),
    }


def frequency_text(finding: Finding, tally: Tally) -> str:
    """Describe how often seeds reached the verdict of this run, if it depends on the seed; nothing where none tried."""
    frequency = tally.frequency(finding.key)
    return frequency_in_words(frequency.counts, depends=frequency.depends_on_seed(finding.verdict))


def frequency_in_words(counts: Mapping[Verdict, int], *, depends: bool) -> str:
    """Describe how many seeds reached each verdict, if it depends on the seed; nothing where none tried."""
    seeds = sum(counts.values())
    if not seeds:
        return ""
    if depends:
        parts = ", ".join(f"{counts[entry]} {entry}" for entry in ORDER if entry in counts)
        return f"depends on the seed: of {seeds} seeds {parts}"
    return f"same on {seeds} of {seeds} seeds"


def answer_text(tally: Tally) -> str:
    """Count the bandwidths near 1 Hz, and those that agree with the best linear truth, over all seeds."""
    models = [one for methods in tally.coverage().values() for one in methods.values()]
    seeds = len(tally.outcomes)
    near, agree = sum(one.near_1_hz for one in models), sum(one.covers for one in models)
    return (
        f"Over {seeds} seeds {near} of {seeds * len(models)} bandwidths of {len(models)} models are near 1 Hz, and "
        f"{agree} agree with the best linear truth."
    )


def source_text(tally: Tally, seed: int | None = None) -> str:
    """Describe which seeds the frequencies count, beside that of this run, on which arm and with which software."""
    seeds = sorted(entry.seed for entry in tally.outcomes if entry.seed is not None)
    values = {"tally": tally, "seed": seed, "seeds": seeds, "versions": tally.outcomes[0].versions}
    return " ".join(Page().render("seeds_text.j2", values).split())


def finding_record(finding: Finding, tally: Tally | None) -> dict[str, object]:
    """Return the entries of results.json on a finding: frequency of the verdicts, and `range` of each number."""
    if tally is None or not (frequency := tally.frequency(finding.key)).counts:
        return {}
    return {
        "frequency": {
            "seeds": frequency.seeds,
            "verdicts": dict(frequency.counts),
            "depends_on_seed": frequency.depends_on_seed(finding.verdict),
        },
        "range": {name: asdict(entry) for name, entry in tally.spread(finding.key).items()},
    }


def seeds_record(tally: Tally) -> dict[str, object]:
    """Return the entry of results.json for all seeds: numbers, bandwidths, cost, and whether they were run now."""
    cost = tally.cost
    return {
        "of_this_run": not tally.recorded,
        "seeds": [entry.seed for entry in tally.outcomes],
        "failed": {str(seed): why for seed, why in tally.failed.items()},
        "duration": tally.duration,
        "bandwidth": {
            joint: {method: asdict(entry) for method, entry in methods.items()}
            for joint, methods in tally.coverage().items()
        },
        "cost": {"physics_s": cost.physics_s, "total_s": cost.total_s, "ratio": cost.times_physics},
        "versions": dict(tally.outcomes[0].versions),
    }
