"""The report: one HTML file that needs nothing else."""

from collections.abc import Sequence
from pathlib import Path

import matplotlib
import numpy as np
from jinja2 import Environment, PackageLoader, StrictUndefined

from hmtb_twin import TwinError, load_arm, render
from hmtb_twin.provenance import provenance_table
from scenarios.crossing import half_power_hz
from scenarios.drawing import SETTINGS, png
from scenarios.errors import ScenarioError
from scenarios.preparation import SETTLING
from scenarios.thesis.about_1_hz import ABOUT_1_HZ, near_1_hz
from scenarios.thesis.attribution import CONDITIONS, COVERAGE
from scenarios.thesis.chapter_3 import chapter_3
from scenarios.thesis.chapter_4 import chapter_4
from scenarios.thesis.chapter_5 import chapter_5
from scenarios.thesis.chapter_6 import chapter_6
from scenarios.thesis.comparison import Comparison
from scenarios.thesis.figures_answer import bandwidths
from scenarios.thesis.finding import Finding
from scenarios.thesis.gallery import Gallery
from scenarios.thesis.probability import TINY
from scenarios.thesis.results import answers, departures, friction_effect, headline
from scenarios.thesis.robustness_section import robustness
from scenarios.thesis.structures import STRUCTURES
from scenarios.whole_file import check_place, write_whole


def write_report(study: Comparison, findings: Sequence[Finding], path: Path) -> Path:
    """Write the report.

    Args:
        study: The study.
        findings: The decided findings.
        path: The HTML file.

    Returns:
        The path.

    Raises:
        ScenarioError: The file cannot be written.
    """
    check_place(path)
    environment = Environment(
        loader=PackageLoader("scenarios"),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.filters["si"] = lambda value, digits=4: "–" if not np.isfinite(value) else f"{value:.{digits}g}"
    environment.filters["measure"] = measure
    environment.filters["near"] = near_1_hz
    environment.filters["level"] = half_power_hz
    environment.filters["root"] = root
    environment.filters["words"] = lambda name: name.replace("_", " ")
    template = environment.get_template("report.html.j2")
    with matplotlib.rc_context(SETTINGS):
        page = template.render(_context(study, findings))
    try:
        write_whole(path, page)
    except OSError as error:
        raise ScenarioError(f"cannot write the report {str(path)!r}: {error.strerror}") from error
    return path


def number(value: float, digits: int = 4) -> str:
    """A number as text, counts without decimals, all others to the same significant digits."""
    if not np.isfinite(value):
        return "–"
    if value == 0.0 or (float(value).is_integer() and abs(value) < 1000):
        return f"{value:.0f}"
    return f"{value:#.{digits}g}".rstrip(".")


def measure(value: float, finding: Finding) -> str:
    """A number of a finding; a probability too small to have been computed is said to be so."""
    return f"< {TINY:g}" if value < TINY and "p-value" in finding.unit else number(value)


def root(value: complex, digits: int = 3) -> str:
    """A pole or zero as text."""
    value = complex(value)
    if abs(value.imag) < 0.5 * 10.0**-digits:
        return f"{value.real:.{digits}f}"
    sign = "+" if value.imag > 0 else "−"
    return f"{value.real:.{digits}f} {sign} {abs(value.imag):.{digits}f}j"


def _context(study: Comparison, findings: Sequence[Finding]) -> dict[str, object]:
    gallery = Gallery()
    arm, no_arm = _arm()
    overview = gallery.add(
        bandwidths(study),
        "Bandwidth of each joint, 3.01 dB below the gain at 0 Hz: recovered by every method with its 95 % interval "
        "(markers), and of the published models (stars), against the true value of the twin (black line). Bars: where "
        "the gain is 0.707, whatever it is at 0 Hz. Grey: what counts as about 1 Hz; dotted: 1 Hz.",
        name="bandwidths",
    )
    return {
        "study": study,
        "findings": findings,
        "answers": answers(study),
        "headline": headline(study),
        "about": ABOUT_1_HZ,
        "settling": SETTLING,
        "reproduce": _reproduce(study),
        "departures": departures(study),
        "coverage": tuple(zip(CONDITIONS, COVERAGE, strict=True)),
        "friction": friction_effect(study),
        "overview": overview,
        "arm": arm,
        "no_arm": no_arm,
        "parameters": _parameters(),
        "joints": [{"result": entry, "attribution": study.attribution[name]} for name, entry in study.joints.items()],
        "samples": len(next(iter(study.logs.values())).commanded),
        # In the order of the page: figures are numbered as they come.
        "chapter_3": chapter_3(study, gallery),
        "chapter_4": chapter_4(study, gallery),
        "chapter_5": chapter_5(study, gallery),
        "chapter_6": chapter_6(study, gallery),
        "robustness": robustness(study, gallery),
    }


def _reproduce(study: Comparison) -> str:
    """Commands that give one row of the table of bandwidths again."""
    structure = STRUCTURES["shoulder_yaw"][0]
    name = f"siso-{study.estimation_test}-shoulder_yaw"
    switches = "" if study.duration is None else f" --duration {study.duration:g}"
    switches += "" if study.seed is None else f" --seed {study.seed}"
    return (
        f"hmtb simulate {name}{switches}\n"
        f"hmtb identify {name}.nc --method {structure.estimator} --orders {' '.join(map(str, structure.orders))} "
        f"--skip {SETTLING:g}"
    )


def _arm() -> tuple[str, str]:
    """The picture of the arm, or what is missing to draw one."""
    try:
        return png(render(load_arm(), width=1200, height=750)), ""
    except TwinError as error:
        said = str(error)
        return "", said[:1].upper() + said[1:]


def _parameters() -> list[dict[str, str]]:
    def text(value: object) -> str:
        if isinstance(value, tuple | list):
            return " × ".join(text(part) for part in value)
        return f"{value:.5g}" if isinstance(value, float | int) else str(value)

    return [
        {
            "owner": line.owner.replace("_", " "),
            "parameter": line.parameter.replace("_", " "),
            "value": text(line.value),
            "unit": line.unit,
            "tag": line.tag,
            "source": line.source,
        }
        for line in provenance_table()
    ]
