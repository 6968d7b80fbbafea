"""HTML report of the study: context of its templates, shortcomings and rendering."""

import base64
import gzip
import json
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import cache
from pathlib import Path
from time import perf_counter
from typing import Any

import numpy as np

from hmtb_twin.files.atomic_write import check_place, write_whole
from hmtb_twin.parameters.provenance import provenance_table
from hmtb_twin.parameters.values import SAMPLE_RATE
from scenarios.experiments.log_review import SETTLING
from scenarios.experiments.model_structures import STRUCTURES
from scenarios.experiments.waveform import POINTS
from scenarios.files.errors import ScenarioError
from scenarios.identification.recovered_bandwidth import ABOUT_1_HZ, near_1_hz
from scenarios.report.page import Page
from scenarios.thesis import chapters
from scenarios.thesis.answer import Answer, answer_texts
from scenarios.thesis.attribution import CONDITIONS
from scenarios.thesis.comparison import Comparison
from scenarios.thesis.control_section import control_section
from scenarios.thesis.every_joint_section import every_joint_section
from scenarios.thesis.fairness_section import fairness_section
from scenarios.thesis.figures import report_figures, without_counterpart, write_figures
from scenarios.thesis.finding import CLAIMS, Finding
from scenarios.thesis.frequencies import ORDER, chance
from scenarios.thesis.long_tables import LongTables
from scenarios.thesis.monte_carlo import Spread, Tally
from scenarios.thesis.motion_answer import motion_texts
from scenarios.thesis.motion_section import read_motion
from scenarios.thesis.number_text import measure, number, parts, root, value_text
from scenarios.thesis.pictures import arm_picture, exchange, film
from scenarios.thesis.response_charts import EXCITED_FROM
from scenarios.thesis.results import friction_in_words
from sysid.models.bandwidth import half_power_hz


def shortcomings(study: Comparison) -> dict[str, Any]:
    """Numbers of the report that do not hold.

    Bandwidths that disagree with the best linear truth, the farthest first, with their distance in percent and in half
    widths of the interval; identified and printed models that are not near 1 Hz.
    """
    models = [(entry, model) for entry in study.joints.values() for model in entry.models.values()]
    printed = [(entry, model) for entry in study.joints.values() for model in entry.published]
    away = [(entry, model, model.bandwidth_hz - entry.best_linear.hz) for entry, model in models if not model.covers]
    misses = [
        (entry.joint, model.label, 100 * hz / entry.best_linear.hz, 2 * abs(hz) / float(np.ptp(model.ci95)))
        for entry, model, hz in away
    ]
    return {
        "misses": sorted(misses, key=lambda miss: -abs(miss[2])),
        "intervals": len(models),
        "printed": len(printed),
        "far": [(entry.joint, model) for entry, model in models if not near_1_hz(model.bandwidth_hz)],
        "printed_far": [(entry.joint, model) for entry, model in printed if not near_1_hz(model.bandwidth_hz)],
    }


SECTIONS: Mapping[str, Callable[[Comparison], object]] = {
    **{"chapter_3": chapters.chapter_3, "chapter_4": chapters.chapter_4, "chapter_5": chapters.chapter_5},
    **{"chapter_6": chapters.chapter_6, "published": chapters.published_section, "fairness": fairness_section},
    **{"robustness": chapters.robustness, "short": shortcomings, "every_joint": every_joint_section},
    **{"control": control_section},
}
"""Variables of the sections, by the name that their templates know."""


def context(
    study: Comparison,
    findings: Sequence[Finding],
    answer: Answer,
    tally: Tally | None = None,
    *,
    motion: Mapping[str, Any] | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> dict[str, Any]:
    """Return the variables of the templates by name; see `write_report` for the arguments."""
    motion = motion or read_motion()
    texts = answer_texts(answer, motion)
    arm, no_arm = arm_picture()
    moments, outcome = exchange(study)
    figures = report_figures(study, answer, progress, motion=motion["map"])
    # The flight arm has a table of its own in its documentation.
    parameters = [line for line in provenance_table() if not line.owner.startswith("flight")]
    counts = Counter(entry.verdict for entry in findings)
    logs = [log for campaign in study.campaigns for log in campaign.logs.values()]
    return {
        **{name: section(study) for name, section in SECTIONS.items()},
        "study": study,
        "findings": findings,
        "criteria": CLAIMS.values(),
        "verdicts": [(name, counts[name]) for name in ORDER if counts[name]],
        "chance": chance(findings, tally, study.seed),
        "sentences": texts[:3],
        "certainty": texts[3],
        "answer": answer,
        "figures": figures,
        "motion": motion,
        "moved": motion_texts(motion),
        "without": without_counterpart(),
        "about": ABOUT_1_HZ,
        "extent": {
            "experiments": len(logs),
            "arms": len(study.campaigns),
            "hours": sum(len(log) * log.dt for log in logs) / 3600.0,
            "rate": SAMPLE_RATE,
        },
        "lowest": EXCITED_FROM,
        "points": POINTS,
        "settling": SETTLING,
        "structure": STRUCTURES["shoulder_yaw"][0],
        "friction": friction_in_words(study),
        "conditions": CONDITIONS,
        "arm": arm,
        "no_arm": no_arm,
        "film": film(study),
        "moments": moments,
        "exchange_outcome": outcome,
        "assumed_values": chapters.assumed_values(),
        "put_in": {key for value in chapters.assumed_values() for key in value.findings},
        "parameters": parameters,
        "tags": Counter(line.tag for line in parameters).most_common(),
        "joints": [{"result": entry, "attribution": study.attribution[name]} for name, entry in study.joints.items()],
    }


def write_report(
    study: Comparison,
    findings: Sequence[Finding],
    answer: Answer,
    path: Path,
    tally: Tally | None = None,
    *,
    figures: Path | None = None,
    motion: Mapping[str, Any] | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> Path:
    """Write the report, and its long tables as CSV files in the folder `tables` beside it; return its path.

    Without a `tally`, the conclusions of many seeds, it does not speak of chance; without `motion`, the record of
    `hmtb motion`, it shows that of the package. `figures` is an existing folder for every figure as SVG, PNG and CSV;
    `progress` is called with the figures made and those in all.

    Raises:
        ScenarioError: The file cannot be written.
    """
    check_place(path)
    if not path.parent.is_dir():
        raise ScenarioError(f"cannot write the report {str(path)!r}: there is no folder {str(path.parent)!r}")
    begin = perf_counter()
    values = context(study, findings, answer, tally, motion=motion, progress=progress)
    values["study"] = replace(study, cost=study.cost.later(perf_counter() - begin, report=True))
    text, tables = html(values)
    try:
        tables.write(path.parent / "tables")
        if figures is not None:
            write_figures(values["figures"].values(), figures)
        write_whole(path, text)
    except OSError as error:
        raise ScenarioError(f"cannot write the report {str(path)!r}: {error.strerror}") from error
    return path


@cache
def compressed_plotly() -> str:
    """Return plotly.js as base64 of gzip, two fifths of its size, which browsers unpack by themselves."""
    from plotly.offline import get_plotlyjs

    return base64.b64encode(gzip.compress(get_plotlyjs().encode(), compresslevel=9, mtime=0)).decode("ascii")


def limits(spread: Spread | None, finding: Finding) -> str:
    """Return the range of a finding's number over the seeds, in brackets; empty where it does not move."""
    if spread is None or spread.low == spread.high or np.isnan(spread.low):
        return ""
    # Counts beside probabilities: a count of 0 is no probability that was too small.
    counts = float(spread.low).is_integer() and spread.high >= 1.0
    low, high = (number(end) if counts else measure(end, finding) for end in (spread.low, spread.high))
    return f"({low} – {high})"


def html(values: Mapping[str, Any]) -> tuple[str, LongTables]:
    """The page as text from the variables of `context`, and the tables that are too long for it."""
    tables = LongTables()
    page = Page(
        {
            "si": lambda value, digits=4: "–" if not np.isfinite(value) else f"{value:.{digits}g}",
            "hz": lambda value: "none" if not np.isfinite(value) else f"{value:.3f}",
            "parts": parts,
            "limits": limits,
            "near": near_1_hz,
            "level": half_power_hz,
            "root": root,
            "value": value_text,
            "words": lambda name: name.replace("_", " "),
            "csv": tables.take,
        }
    )
    data = {name: one.chart.data() for name, one in values["figures"].items()}
    charts = json.dumps(data, separators=(",", ":"), allow_nan=False)
    # On paper the answer comes first and then the contents, which are known once all sections are rendered.
    answer = page.render("answer.html.j2", values)
    body = page.render("body.html.j2", values)
    # An end tag inside a string would end the script.
    scripts = {"charts": charts.replace("</", "<\\/"), "plotly": compressed_plotly()}
    return page.render("report.html.j2", {**values, **scripts, "answer": answer, "body": body}), tables
