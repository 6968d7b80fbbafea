"""HTML report of the study: context of its template, shortcomings and rendering."""

from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from time import perf_counter

import matplotlib
import numpy as np

from hmtb_twin.files.atomic_write import check_place, write_whole
from hmtb_twin.parameters.provenance import provenance_table
from hmtb_twin.parameters.values import SAMPLE_RATE
from scenarios.experiments.log_review import SETTLING
from scenarios.experiments.model_structures import STRUCTURES
from scenarios.experiments.waveform import POINTS
from scenarios.files.errors import ScenarioError
from scenarios.identification.recovered_bandwidth import ABOUT_1_HZ, near_1_hz
from scenarios.report.figures import SETTINGS, Gallery, Picture
from scenarios.report.page import Page
from scenarios.thesis.attribution import CONDITIONS, COVERAGE
from scenarios.thesis.chapter_3 import chapter_3
from scenarios.thesis.chapter_4 import chapter_4
from scenarios.thesis.chapter_5 import chapter_5
from scenarios.thesis.chapter_6 import chapter_6
from scenarios.thesis.comparison import Comparison
from scenarios.thesis.fairness_section import fairness_section
from scenarios.thesis.figure_map import map_figures
from scenarios.thesis.figures_overview import arm_picture, bandwidths, exchange, true_responses
from scenarios.thesis.finding import CLAIMS, Finding, Verdict
from scenarios.thesis.frequencies import ORDER, chance, frequency_text
from scenarios.thesis.number_text import limits, parts, root, value_text
from scenarios.thesis.published_section import assumed_values, assumed_values_of, published_section
from scenarios.thesis.response_figures import EXCITED_FROM
from scenarios.thesis.results import answers, departures, friction_in_words, headline
from scenarios.thesis.robustness_section import robustness
from scenarios.thesis.tally import Tally
from sysid.models.bandwidth import half_power_hz


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
        partly: Findings of which a part is, or that depend on the reading.
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
    """Collect the claims and numbers that do not hold.

    Args:
        study: The study.
        findings: Its findings, decided.
        tally: Many seeds.

    Returns:
        The lists.
    """

    def with_verdict(*verdicts: Verdict) -> tuple[Finding, ...]:
        return tuple(entry for entry in findings if entry.verdict in verdicts)

    misses = []
    for name, entry in study.joints.items():
        true = entry.best_linear.hz
        for model in entry.models.values():
            if not model.covers:
                half = (model.ci95[1] - model.ci95[0]) / 2
                away = model.bandwidth_hz - true
                misses.append(Miss(name, model.label, 100 * away / true, abs(away) / half))
    models = [(name, model) for name, entry in study.joints.items() for model in entry.models.values()]
    printed = [(name, model) for name, entry in study.joints.items() for model in entry.published]
    return Shortcomings(
        refuted=with_verdict("not reproduced"),
        partly=with_verdict("partly", "depends on the reading"),
        open=with_verdict("cannot be told"),
        turned=() if tally is None else tuple(_changed_verdicts(findings, tally)),
        misses=tuple(sorted(misses, key=lambda miss: -abs(miss.away))),
        intervals=len(models),
        far=tuple((name, m.label, m.bandwidth_hz) for name, m in models if not near_1_hz(m.bandwidth_hz)),
        printed_far=tuple((name, m.label, m.bandwidth_hz) for name, m in printed if not near_1_hz(m.bandwidth_hz)),
        printed=len(printed),
    )


def _changed_verdicts(findings: Sequence[Finding], tally: Tally) -> Iterator[tuple[Finding, str]]:
    for entry in findings:
        frequency = tally.frequency(entry.key)
        if frequency.counts and frequency.against(entry.verdict):
            yield entry, frequency_text(entry, tally)


SECTIONS: tuple[tuple[str, Callable[[Comparison, Gallery], object]], ...] = (
    ("overview", lambda study, gallery: _overview(study, gallery)),
    ("truth_figure", lambda study, gallery: _truth(study, gallery)),
    ("chapter_3", chapter_3),
    ("chapter_4", chapter_4),
    ("chapter_5", chapter_5),
    ("chapter_6", chapter_6),
    ("published", published_section),
    ("fairness", fairness_section),
    ("robustness", robustness),
)
"""Sections of the report with figures, by template name."""


def context(study: Comparison, findings: Sequence[Finding], gallery: Gallery, tally: Tally | None) -> dict[str, object]:
    """Return the context of the templates.

    Args:
        study: The study.
        findings: Its findings, decided.
        gallery: Takes the figures.
        tally: Conclusions of many seeds, if the page is to speak of chance.

    Returns:
        By name.
    """
    arm, no_arm = arm_picture()
    moments, outcome = exchange(study)
    sections = {name: section(study, gallery) for name, section in SECTIONS}
    counterparts = map_figures(gallery.counterparts())
    expected = [number for entry in counterparts if not entry.kind.instead for number in entry.kind.numbers]
    parameters = _parameters()
    counts = Counter(entry.verdict for entry in findings)
    return {
        **sections,
        "study": study,
        "findings": findings,
        "criteria": CLAIMS.values(),
        "verdicts": [(name, counts[name]) for name in ORDER if counts[name]],
        "chance": chance(findings, tally, study.seed),
        "answers": answers(study),
        "headline": headline(study),
        "about": ABOUT_1_HZ,
        "extent": _extent(study),
        "lowest": EXCITED_FROM,
        "points": POINTS,
        "settling": SETTLING,
        "reproduce": _reproduction_commands(study),
        "departures": departures(study),
        "coverage": tuple(zip(CONDITIONS, COVERAGE, strict=True)),
        "friction": friction_in_words(study),
        "arm": arm,
        "no_arm": no_arm,
        "moments": moments,
        "exchange_outcome": outcome,
        "assumed_values": assumed_values(),
        "assumed_values_of": assumed_values_of(findings),
        "parameters": parameters,
        "tags": Counter(entry["tag"] for entry in parameters).most_common(),
        "joints": [{"result": entry, "attribution": study.attribution[name]} for name, entry in study.joints.items()],
        "short": shortcomings(study, findings, tally),
        "figure_map": counterparts,
        "mapped_total": len(expected),
        "mapped_count": len(expected) - sum(len(entry.missing) for entry in counterparts),
        "figure_count": len(gallery.pictures),
    }


def _overview(study: Comparison, gallery: Gallery) -> Picture:
    low, high = ABOUT_1_HZ
    return gallery.add(
        bandwidths(study),
        "Bandwidth of each joint, 3.01 dB below the gain at 0 Hz: recovered by every method with its 95 % interval "
        "(markers), and of the published models (stars), against the true value of the twin (black line). Bars: where "
        f"the gain is 0.707, whatever it is at 0 Hz. Grey: what counts as about 1 Hz, {low:g} to {high:g} Hz; dotted: "
        "1 Hz.",
        name="bandwidths",
    )


def _truth(study: Comparison, gallery: Gallery) -> Picture:
    return gallery.add(
        true_responses(study),
        "The true joints: gain and phase from command to measured angle of the same joint. Dots: 3.01 dB below the "
        "gain at 0 Hz; dotted: 1 Hz.",
        name="truth",
    )


def _extent(study: Comparison) -> dict[str, float]:
    """Return the amount of records, over all arms."""
    logs = [log for campaign in study.campaigns for log in campaign.logs.values()]
    return {
        "experiments": len(logs),
        "arms": len(study.campaigns),
        "hours": sum(len(log) * log.dt for log in logs) / 3600.0,
        "rate": SAMPLE_RATE,
    }


def _reproduction_commands(study: Comparison) -> dict[str, str]:
    """Commands that reproduce the report, and one row of the table of bandwidths."""
    structure = STRUCTURES["shoulder_yaw"][0]
    name = f"siso-{study.estimation_test}-shoulder_yaw"
    seed = "" if study.seed is None else f" --seed {study.seed}"
    duration = "" if study.duration is None else f" --duration {study.duration:g}"
    quick = "" if study.duration is None else " --quick"
    return {
        "all": f"hmtb thesis{seed}{quick} --figures",
        "row": f"hmtb simulate {name}{duration}{seed}\n"
        f"hmtb identify {name}.nc --method {structure.estimator} --orders {' '.join(map(str, structure.orders))} "
        f"--skip {SETTLING:g}",
    }


def _parameters() -> list[dict[str, str]]:
    """Every number of the arm that the study is about; the flight arm has a table of its own in its documentation."""
    return [
        {
            "owner": line.owner.replace("_", " "),
            "parameter": line.parameter.replace("_", " "),
            "value": value_text(line.value),
            "unit": line.unit,
            "tag": line.tag,
            "source": line.source,
        }
        for line in provenance_table()
        if not line.owner.startswith("flight")
    ]


def write_report(
    study: Comparison,
    findings: Sequence[Finding],
    path: Path,
    tally: Tally | None = None,
    *,
    figures: Path | None = None,
    drawn: Callable[[int], None] | None = None,
) -> Path:
    """Write the report.

    Args:
        study: The study.
        findings: The decided findings.
        path: The HTML file.
        tally: Conclusions of many seeds; without them the report does not speak of chance.
        figures: Folder for every figure as SVG and PNG too, which must exist; none are written if None.
        drawn: Called with the number of figures drawn after each.

    Returns:
        The path.

    Raises:
        ScenarioError: The file cannot be written.
    """
    check_place(path)
    if not path.parent.is_dir():
        raise ScenarioError(f"cannot write the report {str(path)!r}: there is no folder {str(path.parent)!r}")
    begin = perf_counter()
    with matplotlib.rc_context(SETTINGS):
        values = context(study, findings, Gallery(figures, drawn), tally)
    values["study"] = replace(study, cost=study.cost.later(perf_counter() - begin, report=True))
    try:
        write_whole(path, html(values))
    except OSError as error:
        raise ScenarioError(f"cannot write the report {str(path)!r}: {error.strerror}") from error
    return path


def html(values: Mapping[str, object]) -> str:
    """The page as text.

    Args:
        values: Variables of the templates, see `context`.
    """
    page = Page(
        {
            "si": lambda value, digits=4: "–" if not np.isfinite(value) else f"{value:.{digits}g}",
            "parts": parts,
            "limits": limits,
            "near": near_1_hz,
            "level": half_power_hz,
            "root": root,
            "words": lambda name: name.replace("_", " "),
        }
    )
    # On paper the answer comes first and then the contents, which are known once all sections are rendered.
    answer = page.render("answer.html.j2", values)
    body = page.render("body.html.j2", values)
    return page.render("report.html.j2", {**values, "answer": answer, "body": body})
