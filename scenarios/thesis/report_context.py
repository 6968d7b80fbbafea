"""Context of the report's templates."""

from collections import Counter
from collections.abc import Callable, Sequence

from hmtb_twin.parameters.provenance import provenance_table
from hmtb_twin.parameters.values import SAMPLE_RATE
from scenarios.experiments.log_review import SETTLING
from scenarios.experiments.model_structures import STRUCTURES
from scenarios.experiments.waveform import POINTS
from scenarios.identification.recovered_bandwidth import ABOUT_1_HZ
from scenarios.report.figure_style import EXCITED_FROM
from scenarios.report.figures import Gallery, Picture
from scenarios.thesis.assumed_values import assumed_values, assumed_values_of
from scenarios.thesis.attribution import CONDITIONS, COVERAGE
from scenarios.thesis.chapter_3 import chapter_3
from scenarios.thesis.chapter_4 import chapter_4
from scenarios.thesis.chapter_5 import chapter_5
from scenarios.thesis.chapter_6 import chapter_6
from scenarios.thesis.comparison import Comparison
from scenarios.thesis.fairness_section import fairness_section
from scenarios.thesis.figure_map import mapped
from scenarios.thesis.figures_answer import bandwidths
from scenarios.thesis.figures_truth import true_responses
from scenarios.thesis.finding import Finding
from scenarios.thesis.frequencies import ORDER, chance
from scenarios.thesis.pictures import arm_picture, exchange
from scenarios.thesis.published_section import published_section
from scenarios.thesis.results import answers, departures, friction_in_words, headline
from scenarios.thesis.robustness_section import robustness
from scenarios.thesis.shortcomings import shortcomings
from scenarios.thesis.tally import Tally
from scenarios.thesis.wording import plain

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
"""Parts that draw."""


def context(study: Comparison, findings: Sequence[Finding], gallery: Gallery, tally: Tally | None) -> dict[str, object]:
    """Return the context of the templates.

    Args:
        study: The study.
        findings: Its findings, decided.
        gallery: Takes the figures.
        tally: What many seeds concluded, if anything is to be said of chance.

    Returns:
        By name.
    """
    arm, no_arm = arm_picture()
    moments, outcome = exchange(study)
    drawn = {name: section(study, gallery) for name, section in SECTIONS}
    counterparts = mapped(gallery.counterparts())
    expected = [number for entry in counterparts if not entry.kind.instead for number in entry.kind.numbers]
    parameters = _parameters()
    counts = Counter(entry.verdict for entry in findings)
    return {
        **drawn,
        "study": study,
        "findings": findings,
        "verdicts": [(name, counts[name]) for name in ORDER if counts[name]],
        "chance": chance(findings, tally, study.seed),
        "answers": answers(study),
        "headline": headline(study),
        "about": ABOUT_1_HZ,
        "extent": _extent(study),
        "lowest": EXCITED_FROM,
        "points": POINTS,
        "settling": SETTLING,
        "reproduce": _reproduce(study),
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


def _reproduce(study: Comparison) -> dict[str, str]:
    """Commands that give the report, and one row of the table of bandwidths, again."""
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
            "value": plain(line.value),
            "unit": line.unit,
            "tag": line.tag,
            "source": line.source,
        }
        for line in provenance_table()
        if not line.owner.startswith("flight")
    ]
