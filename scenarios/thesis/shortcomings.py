"""Shortcomings: findings that the twin does not show, intervals that miss, models that are not near 1 Hz."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from scenarios.identification.recovered_bandwidth import near_1_hz
from scenarios.thesis.comparison import Comparison
from scenarios.thesis.finding import Finding
from scenarios.thesis.frequencies import frequency_text
from scenarios.thesis.tally import Tally


@dataclass(frozen=True)
class Miss:
    """An interval that does not hold the truth.

    Attributes:
        joint: Name of the joint.
        label: The model.
        away: Of the estimate from the truth, percent.
        widths: The same in half widths of the interval.
    """

    joint: str
    label: str
    away: float
    widths: float


@dataclass(frozen=True)
class Shortcomings:
    """Claims and numbers of the report that do not hold.

    Attributes:
        refuted: Findings that are not reproduced.
        partly: Findings of which a part is.
        open: Findings that cannot be told.
        turned: Findings of which more seeds reached another verdict than that of this run, with how many reached which.
        misses: Intervals that do not hold the truth, the farthest first.
        intervals: Number of intervals in all.
        far: Identified models that are not near 1 Hz, as joint and label.
        printed_far: The thesis' printed models that are not near 1 Hz.
        printed: Number of printed models.
    """

    refuted: tuple[Finding, ...]
    partly: tuple[Finding, ...]
    open: tuple[Finding, ...]
    turned: tuple[tuple[Finding, str], ...]
    misses: tuple[Miss, ...]
    intervals: int
    far: tuple[tuple[str, str, float], ...]
    printed_far: tuple[tuple[str, str, float], ...]
    printed: int


def shortcomings(study: Comparison, findings: Sequence[Finding], tally: Tally | None = None) -> Shortcomings:
    """Collect what does not hold.

    Args:
        study: The study.
        findings: Its findings, decided.
        tally: Many seeds.

    Returns:
        The lists.
    """

    def with_verdict(wanted: str) -> tuple[Finding, ...]:
        return tuple(entry for entry in findings if entry.verdict == wanted)

    misses = []
    for name, entry in study.joints.items():
        true = entry.truth.bandwidth_hz
        for model in entry.models.values():
            if not model.covers:
                half = (model.ci95[1] - model.ci95[0]) / 2
                away = model.bandwidth_hz - true
                misses.append(Miss(name, model.label, 100 * away / true, abs(away) / half))
    models = [(name, model) for name, entry in study.joints.items() for model in entry.models.values()]
    printed = [(name, model) for name, entry in study.joints.items() for model in entry.published]
    return Shortcomings(
        refuted=with_verdict("not reproduced"),
        partly=with_verdict("partly"),
        open=with_verdict("cannot be told"),
        turned=() if tally is None else tuple(_turned(findings, tally)),
        misses=tuple(sorted(misses, key=lambda miss: -abs(miss.away))),
        intervals=len(models),
        far=tuple((name, m.label, m.bandwidth_hz) for name, m in models if not near_1_hz(m.bandwidth_hz)),
        printed_far=tuple((name, m.label, m.bandwidth_hz) for name, m in printed if not near_1_hz(m.bandwidth_hz)),
        printed=len(printed),
    )


def _turned(findings: Sequence[Finding], tally: Tally) -> Iterator[tuple[Finding, str]]:
    for entry in findings:
        found = tally.frequency(entry.key)
        if found.counts and found.against(entry.verdict):
            yield entry, frequency_text(entry, tally)
