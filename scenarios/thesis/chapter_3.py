"""Chapter III in the report: the records and what is seen in them without a model."""

from scenarios.registry import load
from scenarios.thesis.campaign import single_joint_test
from scenarios.thesis.comparison import Comparison
from scenarios.thesis.figure_style import short
from scenarios.thesis.figures_chapter_3 import data_spectra, tests
from scenarios.thesis.gallery import Gallery


def chapter_3(study: Comparison, gallery: Gallery) -> dict[str, object]:
    """Figures and numbers of the chapter.

    Args:
        study: The study.
        gallery: Takes the figures, in the order of the page.

    Returns:
        What the template shows.
    """
    joints = []
    for joint, entry in study.joints.items():
        name, mark = short(joint), joint.replace("_", "-")
        joints.append(
            {
                "result": entry,
                "tests": gallery.add(
                    tests(study, entry),
                    f"{name}: two settled seconds of each test, commanded and measured angle about their means.",
                    name=f"tests-{mark}",
                ),
                "spectra": gallery.add(
                    data_spectra(study, entry),
                    f"{name}: input, output and disturbance spectra on the lines of the PRBS; the disturbance is what "
                    "differs between periods.",
                    name=f"spectra-{mark}",
                ),
            }
        )
    return {"joints": joints, "numbered": _numbered(study)}


def _numbered(study: Comparison) -> list[tuple[int, str]]:
    """Numbers of the tests with what is played in them."""
    joint, entry = next(iter(study.joints.items()))
    return [(number, load(single_joint_test(number, joint)).description.split(": ", 1)[1]) for number in entry.data]
