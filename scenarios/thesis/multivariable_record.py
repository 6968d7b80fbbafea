"""Chapter VI as plain mappings, for JSON."""

from scenarios.thesis.categories import categories
from scenarios.thesis.comparison import Comparison
from scenarios.thesis.multivariable import WAYS


def multivariable_record(study: Comparison) -> dict[str, object]:
    """The three-joint models with their fits, and the seven categories.

    Args:
        study: The study.

    Returns:
        `three_joint_models`, `references` (what the truth itself follows), `full_models` and `categories` by name.
    """
    found = study.multivariable
    return {
        "three_joint_models": {
            entry.name: {
                "states": entry.model.order,
                "largest_pole": entry.largest_pole,
                "relative_error": entry.error,
                "relative_error_diagonal": entry.diagonal_error,
                "fits": {name: {way: dict(fits.of(way)) for way in WAYS} for name, fits in entry.fits.items()},
            }
            for entry in found.models
        },
        "references": {
            entry.name: {name: dict(fits) for name, fits in entry.fits.items()} for entry in found.references
        },
        "full_models": [
            {
                "record": entry.record,
                "condition": entry.condition,
                "method": entry.method,
                "relative_error": entry.error,
                "relative_error_diagonal": entry.diagonal_error,
                "off_diagonal": entry.coupling,
            }
            for entry in found.full
        ],
        "categories": {
            entry.name: {
                "thesis": entry.thesis,
                "ahead": entry.ahead,
                "measures": [
                    {"what": measure.what, "values": dict(measure.values), "ahead": measure.ahead}
                    for measure in entry.measures
                ],
            }
            for entry in categories(study)
        },
    }
