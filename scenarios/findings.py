"""The thesis' findings: those that the data of the study decide, and those that are not tried [Morris1996]."""

from collections.abc import Sequence

from scenarios import findings_data as data
from scenarios import findings_models as models
from scenarios import findings_robustness as robustness
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

_RPCM = "this study does not analyse the RPCM task yet; `hmtb simulate rpcm` makes its record"
_CHIRP = "this study does not analyse the multi-input tests yet; `hmtb simulate mimo-12` makes the record"

UNTRIED = {
    "F8": (
        "ARX and IV4 give inconsistent models from one data set to the next, ARMAX and OE do not",
        "IV.1",
        "every structure would have to be identified from each of the eight records; here all come from the PRBS",
    ),
    "F18": ("RPCM data: OKID fits better than SysID on every joint, SysID is worst on shoulder pitch", "VI.4", _RPCM),
    "F19": (
        "RPCM residuals: SysID white on yaw and elbow but not shoulder; OKID fairly white on yaw and shoulder, less on "
        "elbow; yaw residuals correlate with the input at lags below 15",
        "VI.4",
        _RPCM,
    ),
    "F20": (
        "5-10 Hz multi-input chirp: OKID fits better, slight coupling from the pitch inputs into the yaw residuals",
        "VI.5",
        _CHIRP,
    ),
    "F21": (
        "low-frequency data: SysID beats OKID on yaw, so a hybrid model is best there",
        "VI.6",
        "this study does not analyse the multi-input tests yet; `hmtb simulate mimo-10` makes the record",
    ),
}
"""Findings that these data do not decide: claim, where, and what is missing."""


def findings(study: Comparison) -> tuple[Finding, ...]:
    """Try every finding that the study's data decide.

    Args:
        study: The study's result.

    Returns:
        Findings in the order of their numbers; those whose tests failed are left to `untried`.
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
        "F15": robustness.without_detrending,
        "F16": models.real_poles,
        "F17": models.bode_agrees,
        "F22": models.follows_5_hz,
        "F23": models.above_5_hz,
        "F24": models.parsimony,
        "F25": robustness.bias_and_outliers,
        "F26": data.coupling,
    }
    there = set.intersection(*(set(entry.data) for entry in study.joints.values()))
    return tuple(decide(study) for key, decide in decided.items() if NEEDED.get(key, set()) <= there)


def untried(decided: Sequence[Finding]) -> tuple[Finding, ...]:
    """What is left of the thesis' 26 findings, without a number.

    Args:
        decided: The decided findings.

    Returns:
        Findings in the order of their numbers, each with what is missing to try it.
    """
    there = {entry.key for entry in decided}
    left = {}
    for number in range(1, 27):
        key = f"F{number}"
        if key not in there:
            claim, where, missing = UNTRIED.get(key, ("", "", f"an experiment of it failed; {key} needs every test"))
            left[key] = Finding(key, claim, where, "not tried", {}, "", "", missing)
    return tuple(left.values())
