"""Contents of the report of the study: everything that its templates show, as one record."""

from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

from hmtb_twin import JointLog
from hmtb_twin.parameters.provenance import Provenance, provenance_table
from hmtb_twin.parameters.values import SAMPLE_RATE
from scenarios.experiments.log_review import SETTLING
from scenarios.experiments.model_structures import STRUCTURES, Structure
from scenarios.experiments.waveform import POINTS
from scenarios.identification.recovered_bandwidth import ABOUT_1_HZ
from scenarios.report.figure_files import ReportFigure
from scenarios.thesis import chapters
from scenarios.thesis.answer import Answer, answer_texts
from scenarios.thesis.attribution import CONDITIONS, Attributions
from scenarios.thesis.comparison import Comparison, JointResult
from scenarios.thesis.control_section import control_section
from scenarios.thesis.every_joint_section import every_joint_section
from scenarios.thesis.fairness_section import fairness_section
from scenarios.thesis.figures import report_figures, without_counterpart
from scenarios.thesis.finding import CLAIMS, UNDECIDED, Finding, ThesisClaim, UndecidedClaim, Verdict
from scenarios.thesis.frequencies import ORDER, chance
from scenarios.thesis.monte_carlo import Tally
from scenarios.thesis.motion_answer import motion_texts
from scenarios.thesis.motion_section import read_motion
from scenarios.thesis.pictures import ArmPicture, Exchange, Film, arm_picture, exchange, film
from scenarios.thesis.response_charts import EXCITED_FROM
from scenarios.thesis.results import friction_in_words
from scenarios.thesis.shortcomings import Shortcomings, shortcomings


class Extent(NamedTuple):
    """How much was played: experiments on a number of arms, hours of record, samples per second."""

    experiments: int
    arms: int
    hours: float
    rate_hz: float


class WaveformFile(NamedTuple):
    """The excitation files of the thesis: points of a period, and the lowest frequency with power, Hz."""

    points: int
    lowest_line_hz: float


class JointEntry(NamedTuple):
    """One joint in the tables of bandwidths: its models and truth, and why intervals miss the truth."""

    result: JointResult
    attribution: Attributions


class AssumedValues(NamedTuple):
    """Thesis values used to build the twin, and the findings that rest on them: no independent evidence."""

    values: Sequence[chapters.AssumedValue]
    findings: frozenset[str]


class ParameterTable(NamedTuple):
    """Every parameter of the twin with its source, and how many have each tag, the most frequent first."""

    rows: Sequence[Provenance]
    tag_counts: Sequence[tuple[str, int]]


@dataclass(frozen=True, eq=False)
class ReportContents:
    """Everything that the report shows; its templates know the fields by these names.

    Attributes:
        study: The study.
        findings: Its decided findings.
        criteria: Every claim of the thesis with its criterion.
        undecided: Claims that the twin cannot decide.
        verdict_counts: Verdicts that occur, in the order of `ORDER`, and the number of findings that have each.
        other_seeds: What other seeds decide, see `chance`; empty without them.
        answer_sentences: The answer in three sentences.
        certainty_sentence: How sure it is.
        near_1_hz_limits: Ends of what counts as near 1 Hz, Hz.
        extent: How much was played.
        waveform_file: Of which the excitation consists.
        joints: Every joint in the tables of bandwidths.
        figures: Figures of the report by name.
        figures_left_out: Figures of the thesis without a counterpart, with the reason.
        motion: The record of `hmtb motion`.
        motion_sentences: The same in words.
        arm_picture: Picture of the arm.
        film: Film of a joint that plays the PRBS.
        exchange: Pictures and outcome of the exchange.
        assumed_values: Thesis values used to build the twin.
        parameters: Every parameter of the twin.
        chapter_3: Variables of the section of chapter III.
        chapter_4: Of chapter IV.
        chapter_5: Of chapter V.
        chapter_6: Of chapter VI.
        published: Of the section on the printed models.
        every_joint: Of that on the seven-joint model.
        fairness: Of the table of every arm.
        robustness: Of that on disturbed records.
        control: Of that on model reference control.
        shortcomings: Numbers that do not hold.
        attribution_conditions: Conditions under which the cause of a missed interval is sought.
        friction_sentence: What friction does to the bandwidths, in words.
        example_structure: Structure in the commands that repeat a row of the report.
        settling_s: Start of every record that is dropped, s.
    """

    study: Comparison
    findings: Sequence[Finding]
    criteria: Sequence[ThesisClaim]
    undecided: Sequence[UndecidedClaim]
    verdict_counts: Sequence[tuple[Verdict, int]]
    other_seeds: Mapping[str, object]
    answer_sentences: Sequence[str]
    certainty_sentence: str
    near_1_hz_limits: tuple[float, float]
    extent: Extent
    waveform_file: WaveformFile
    joints: Sequence[JointEntry]
    figures: Mapping[str, ReportFigure]
    figures_left_out: Sequence[tuple[Sequence[str], str]]
    motion: Mapping[str, Any]
    motion_sentences: Sequence[str]
    arm_picture: ArmPicture
    film: Film
    exchange: Exchange
    assumed_values: AssumedValues
    parameters: ParameterTable
    chapter_3: object
    chapter_4: object
    chapter_5: object
    chapter_6: object
    published: object
    every_joint: object
    fairness: object
    robustness: object
    control: object
    shortcomings: Shortcomings
    attribution_conditions: Sequence[str]
    friction_sentence: str
    example_structure: Structure
    settling_s: float


def report_contents(
    study: Comparison,
    findings: Sequence[Finding],
    answer: Answer,
    tally: Tally | None = None,
    *,
    motion: Mapping[str, Any] | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> ReportContents:
    """Collect the contents of the report; see `write_report` for the arguments."""
    motion = motion or read_motion()
    *answer_sentences, certainty_sentence = answer_texts(answer, motion)
    return ReportContents(
        study=study,
        findings=findings,
        criteria=tuple(CLAIMS.values()),
        undecided=UNDECIDED,
        verdict_counts=verdict_counts(findings),
        other_seeds=chance(findings, tally, study.seed),
        answer_sentences=answer_sentences,
        certainty_sentence=certainty_sentence,
        near_1_hz_limits=ABOUT_1_HZ,
        extent=extent_of(study),
        waveform_file=WaveformFile(POINTS, EXCITED_FROM),
        joints=[JointEntry(result, study.attribution[joint]) for joint, result in study.joints.items()],
        figures=report_figures(study, answer, progress, motion=motion["map"]),
        figures_left_out=without_counterpart(),
        motion=motion,
        motion_sentences=motion_texts(motion),
        arm_picture=arm_picture(),
        film=film(study),
        exchange=exchange(study),
        assumed_values=assumed_values(),
        parameters=parameter_table(),
        chapter_3=chapters.chapter_3(study),
        chapter_4=chapters.chapter_4(study),
        chapter_5=chapters.chapter_5(study),
        chapter_6=chapters.chapter_6(study),
        published=chapters.published_section(study),
        every_joint=every_joint_section(study),
        fairness=fairness_section(study),
        robustness=chapters.robustness(study),
        control=control_section(study),
        shortcomings=shortcomings(study),
        attribution_conditions=CONDITIONS,
        friction_sentence=friction_in_words(study),
        example_structure=STRUCTURES["shoulder_yaw"][0],
        settling_s=SETTLING,
    )


def verdict_counts(findings: Sequence[Finding]) -> list[tuple[Verdict, int]]:
    """Count the findings that have each verdict; verdicts that no finding has are left out."""
    counts = Counter(finding.verdict for finding in findings)
    return [(verdict, counts[verdict]) for verdict in ORDER if counts[verdict]]


def extent_of(study: Comparison) -> Extent:
    """How much a study played on all its arms."""
    logs: list[JointLog] = []
    for campaign in study.campaigns:
        logs += campaign.logs.values()
    seconds = sum(len(log) * log.dt for log in logs)
    return Extent(len(logs), len(study.campaigns), seconds / 3600.0, SAMPLE_RATE)


def assumed_values() -> AssumedValues:
    """Thesis values used to build the twin, and the findings that rest on any of them."""
    values = chapters.assumed_values()
    return AssumedValues(values, frozenset().union(*(value.findings for value in values)))


def parameter_table() -> ParameterTable:
    """Every parameter of the ground arm, its payloads and the chain of signals."""
    # The flight arm has a table of its own in its documentation.
    rows = [line for line in provenance_table() if not line.owner.startswith("flight")]
    return ParameterTable(rows, Counter(row.tag for row in rows).most_common())
