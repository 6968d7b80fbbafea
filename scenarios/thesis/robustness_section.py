"""Robustness in the report."""

from scenarios.thesis.comparison import Comparison
from scenarios.thesis.gallery import Gallery


def robustness(study: Comparison, gallery: Gallery) -> dict[str, object]:
    """Figures and numbers of the section.

    Args:
        study: The study.
        gallery: Takes the figures, in the order of the page.

    Returns:
        What the template shows.
    """
    return {}
