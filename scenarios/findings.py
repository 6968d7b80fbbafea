"""The thesis' findings that the data of the study decide; others are absent, not guessed [Morris1996]."""

from scenarios import findings_data as data
from scenarios import findings_models as models
from scenarios.comparison import Comparison
from scenarios.finding import Finding

NEEDED = {
    "F4": {5},
    "F5": {7},
    "F6": {4},
    "F22": {1, 2, 3},
    "F23": {8},
}
"""Tests without which a finding cannot be decided."""


def findings(study: Comparison) -> tuple[Finding, ...]:
    """Try every finding that the study's data decide.

    Args:
        study: The study's result.

    Returns:
        Findings in the order of their numbers; those whose tests failed are left out.
    """
    decided = {
        "F1": data.gain_and_cutoff,
        "F2": data.slope,
        "F3": data.delay,
        "F4": data.prbs_looks_white,
        "F5": data.pulse_spectra,
        "F6": data.sinusoid_disturbance,
        "F7": data.measurement_against_process,
        "F9": models.yaw_armax,
        "F10": models.yaw_oe,
        "F11": lambda study: models.best_structure(
            study,
            "F11",
            "shoulder_pitch",
            "oe",
            "armax",
            "shoulder pitch: OE (2 poles, 1 zero, 1 delay) is best, its residuals independent of the input",
        ),
        "F12": lambda study: models.best_structure(
            study,
            "F12",
            "elbow_pitch",
            "armax",
            "oe",
            "elbow pitch: ARMAX (2 poles, 1 zero, 2 delays) is best, whiter than OE",
        ),
        "F13": models.stable,
        "F14": models.percent_described,
        "F16": models.real_poles,
        "F17": models.bode_agrees,
        "F22": models.follows_5_hz,
        "F23": models.above_5_hz,
        "F24": models.parsimony,
        "F26": data.coupling,
    }
    there = set.intersection(*(set(entry.data) for entry in study.joints.values()))
    return tuple(decide(study) for key, decide in decided.items() if NEEDED.get(key, set()) <= there)
