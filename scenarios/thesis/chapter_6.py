"""Chapter VI in the report: the three-joint models compared."""

from scenarios.thesis.comparison import Comparison
from scenarios.thesis.figures_chapter_6 import coupled
from scenarios.thesis.gallery import Gallery


def chapter_6(study: Comparison, gallery: Gallery) -> dict[str, object]:
    """Figures and numbers of the section.

    Args:
        study: The study.
        gallery: Takes the figures, in the order of the page.

    Returns:
        What the template shows.
    """
    return {
        "coupled": gallery.add(
            coupled(study),
            "Gain from each commanded to each measured angle: the true arm couples its pitch joints a little, the "
            "block-diagonal models by construction not at all. Panels without a line: gain below 0.0001.",
            name="coupled",
        ),
    }
