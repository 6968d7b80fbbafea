"""The report: one HTML file that needs nothing else."""

from collections.abc import Sequence
from dataclasses import dataclass
from importlib.resources import files
from itertools import count
from pathlib import Path

import matplotlib
import numpy as np
from jinja2 import Environment, StrictUndefined
from matplotlib.figure import Figure

from hmtb_twin import TwinError, load_arm, render
from hmtb_twin.provenance import provenance_table
from scenarios import report_figures as draw
from scenarios.attribution import CONDITIONS, COVERAGE
from scenarios.comparison import Comparison, JointResult
from scenarios.crossing import half_power_hz
from scenarios.drawing import SETTINGS, png, svg
from scenarios.errors import ScenarioError
from scenarios.finding import Finding
from scenarios.findings import untried
from scenarios.findings_models import ABOUT_1_HZ, TINY, p_value
from scenarios.preparation import SETTLING
from scenarios.registry import load
from scenarios.results import answers, departures, friction_effect, headline, near_1_hz
from scenarios.study import STRUCTURES
from scenarios.whole_file import check_place, write_whole


@dataclass(frozen=True)
class Picture:
    """A figure on the page.

    Attributes:
        svg: The element.
        caption: What it shows and how to read it; the page numbers it.
    """

    svg: str
    caption: str


class _Gallery:
    """Marks figures apart as they are drawn."""

    def __init__(self) -> None:
        self.count = 0

    def add(self, figure: Figure, caption: str) -> Picture:
        self.count += 1
        return Picture(svg(figure, caption, f"f{self.count}"), caption[:1].upper() + caption[1:])


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
    environment = Environment(autoescape=True, undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True)
    environment.filters["si"] = lambda value, digits=4: "–" if not np.isfinite(value) else f"{value:.{digits}g}"
    environment.filters["measure"] = measure
    environment.filters["near"] = near_1_hz
    environment.filters["level"] = half_power_hz
    environment.filters["root"] = root
    environment.filters["words"] = lambda name: name.replace("_", " ")
    template = environment.from_string(
        (files("scenarios") / "templates" / "report.html.j2").read_text(encoding="utf-8")
    )
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
    gallery = _Gallery()
    arm, no_arm = _arm()
    overview = gallery.add(
        draw.bandwidths(study),
        "Bandwidth of each joint, 3.01 dB below the gain at 0 Hz: recovered by every method with its 95 % interval "
        "(markers), and of the published models (stars), against the true value of the twin (black line). Bars: where "
        "the gain is 0.707, whatever it is at 0 Hz. Grey: what counts as about 1 Hz; dotted: 1 Hz.",
    )
    joints = [_joint(study, entry, gallery) for entry in study.joints.values()]
    coupled = gallery.add(
        draw.coupled(study),
        "Gain from each commanded to each measured angle: the true arm couples its pitch joints a little, the "
        "block-diagonal models by construction not at all. Panels without a line: gain below 0.0001.",
    )
    return {
        "study": study,
        "findings": sorted((*findings, *untried(findings)), key=lambda entry: int(entry.key[1:])),
        "answers": answers(study),
        "headline": headline(study),
        "about": ABOUT_1_HZ,
        "settling": SETTLING,
        "numbered": _numbered(study),
        "reproduce": _reproduce(study),
        "departures": departures(study),
        "coverage": tuple(zip(CONDITIONS, COVERAGE, strict=True)),
        "friction": friction_effect(study),
        "overview": overview,
        "arm": arm,
        "no_arm": no_arm,
        "parameters": _parameters(),
        "joints": joints,
        "coupled": coupled,
        "number": count(1).__next__,
        "samples": len(next(iter(study.logs.values())).commanded),
    }


def _joint(study: Comparison, entry: JointResult, gallery: _Gallery) -> dict[str, object]:
    name = draw.short(entry.joint)
    own = study.estimation_test
    captions = {
        5: "the PRBS that they were identified from",
        4: "the two sines at 2.5 and 10 Hz",
        7: "the bipolar ramping pulse",
        8: "the 5-10 Hz chirp",
    }
    return {
        "result": entry,
        "tests": gallery.add(
            draw.tests(study, entry),
            f"{name}: two settled seconds of each test, commanded and measured angle about their means.",
        ),
        "spectra": gallery.add(
            draw.data_spectra(study, entry),
            f"{name}: input, output and disturbance spectra on the lines of the PRBS; the disturbance is what differs "
            "between periods.",
        ),
        "bode": gallery.add(
            draw.model_bode(entry),
            f"{name}: frequency response of the truth, of spectral and empirical estimate on the excited lines and of "
            "the identified models, with 95 % bands. Dashed: −3 dB below one; dotted: 1 Hz; grey: nothing is excited "
            "there, models extrapolate.",
        ),
        "zoom": gallery.add(
            draw.zoomed_bode(entry),
            f"{name}: the gain from 0.1 to 3 Hz; below, by how much it departs from the true gain.",
        ),
        "published": gallery.add(
            draw.published_bode(entry),
            f"{name}: the models that the thesis prints, beside the truth of the twin. Grey: below 0.5 Hz, where the "
            "PRBS file of the twin excites nothing; that of the thesis is not known.",
        ),
        "roots": gallery.add(draw.roots(entry), f"{name}: poles and zeros in the z plane with the unit circle."),
        "outputs": [
            gallery.add(
                draw.outputs(entry, number, length=length),
                f"{name}: simulated outputs of the models against the measurement of test {number}, "
                f"{captions[number]}, with their fits over the whole record; below, what is left.",
            )
            for number, length in ((own, 4.0), (4, 1.6), (7, 3.0), (8, 2.0))
            if number in entry.data
        ],
        "residuals": [
            gallery.add(
                draw.residuals(model),
                f"{name}, {model.label}: correlations of the residuals on the PRBS test with 99 % bounds "
                f"(whiteness {p_value(model.residual_test.whiteness_p[0])}, independence "
                f"{p_value(model.residual_test.independence_p[0, 0])}).",
            )
            for model in entry.models.values()
        ],
        "attribution": study.attribution[entry.joint],
    }


def _numbered(study: Comparison) -> list[tuple[int, str]]:
    """Numbers of the tests with what is played in them."""
    joint, entry = next(iter(study.joints.items()))
    return [(number, load(f"siso-{number}-{joint}").description.split(": ", 1)[1]) for number in entry.data]


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
