"""Frequencies over seeds: how often a verdict was reached, and how far numbers move from seed to seed."""

from collections.abc import Mapping, Sequence
from dataclasses import asdict
from typing import get_args

from scenarios.report.page import Page
from scenarios.thesis.finding import Finding, Verdict
from scenarios.thesis.monte_carlo import BandwidthCoverage, Tally

ORDER: tuple[Verdict, ...] = get_args(Verdict)


def chance(findings: Sequence[Finding], tally: Tally | None, seed: int | None = None) -> dict[str, object]:
    """Collect the variables of the templates on many seeds, for the findings as this run with its seed decided them.

    Texts, how often each verdict came out, findings whose verdict of this run depends on the seed, those among them of
    which more seeds reached another, ranges of their numbers, and the bandwidths of `Tally.coverage`; nothing without
    seeds.
    """
    if tally is None:
        return {}
    depends, against = [], []
    for finding in findings:
        frequency = tally.frequency(finding.key)
        # No seed may have had the records that decide it.
        if not frequency.counts:
            continue
        if frequency.depends_on_seed(finding.verdict):
            depends.append(finding.key)
        if frequency.against(finding.verdict):
            against.append(finding.key)
    return {
        "source": source_text(tally, seed),
        "answer": answer_text(tally),
        "verdicts": {finding.key: frequency_text(finding, tally) for finding in findings},
        "depends": depends,
        "against": against,
        "ranges": {finding.key: tally.spread(finding.key) for finding in findings},
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
        listed = ", ".join(f"{counts[verdict]} {verdict}" for verdict in ORDER if verdict in counts)
        return f"depends on the seed: of {seeds} seeds {listed}"
    return f"same on {seeds} of {seeds} seeds"


def answer_text(tally: Tally) -> str:
    """Count the bandwidths near 1 Hz, and those that agree with the best linear truth, over all seeds."""
    models: list[BandwidthCoverage] = []
    for methods in tally.coverage().values():
        models += methods.values()
    seeds = len(tally.outcomes)
    near, agree = sum(model.near_1_hz for model in models), sum(model.covers for model in models)
    return (
        f"Over {seeds} seeds {near} of {seeds * len(models)} bandwidths of {len(models)} models are near 1 Hz, and "
        f"{agree} agree with the best linear truth."
    )


def source_text(tally: Tally, seed: int | None = None) -> str:
    """Describe which seeds the frequencies count, beside that of this run, on which arm and with which software."""
    # A study with the scenarios' own seeds has no seed.
    seeds = sorted(outcome.seed for outcome in tally.outcomes if outcome.seed is not None)
    values = {"tally": tally, "seed": seed, "seeds": seeds, "versions": tally.outcomes[0].versions}
    return " ".join(Page().render("seeds_text.j2", values).split())


def finding_record(finding: Finding, tally: Tally | None) -> dict[str, object]:
    """Return the entries of results.json on a finding: frequency of the verdicts, and `range` of each number."""
    if tally is None or not (frequency := tally.frequency(finding.key)).counts:
        return {}
    verdicts = {
        "seeds": frequency.seeds,
        "verdicts": dict(frequency.counts),
        "depends_on_seed": frequency.depends_on_seed(finding.verdict),
    }
    ranges = {name: asdict(spread) for name, spread in tally.spread(finding.key).items()}
    return {"frequency": verdicts, "range": ranges}


def seeds_record(tally: Tally) -> dict[str, object]:
    """Return the entry of results.json for all seeds: numbers, bandwidths, cost, and whether they were run now."""
    bandwidths = {}
    for joint, methods in tally.coverage().items():
        bandwidths[joint] = {method: asdict(coverage) for method, coverage in methods.items()}
    cost = tally.cost
    costs = {"physics_s": cost.physics_s, "total_s": cost.total_s, "ratio": cost.times_physics}
    return {
        "of_this_run": not tally.recorded,
        "seeds": [outcome.seed for outcome in tally.outcomes],
        "failed": {str(seed): why for seed, why in tally.failed.items()},
        "duration": tally.duration,
        "bandwidth": bandwidths,
        "cost": costs,
        # Outcomes of other versions are never joined into one tally.
        "versions": dict(tally.outcomes[0].versions),
    }
