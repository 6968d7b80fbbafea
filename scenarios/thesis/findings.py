"""The thesis' 26 findings, each tested on the twin [Morris1996]."""

from collections.abc import Callable, Mapping
from types import MappingProxyType

from scenarios.files.errors import MissingRecordError
from scenarios.thesis import findings_chapter_3 as chapter_3
from scenarios.thesis import findings_chapter_4 as chapter_4
from scenarios.thesis import findings_chapter_5 as chapter_5
from scenarios.thesis import findings_chapter_6 as chapter_6
from scenarios.thesis.comparison import Comparison
from scenarios.thesis.finding import Finding
from sysid import SysidError

FINDINGS: Mapping[str, Callable[[Comparison], Finding]] = MappingProxyType(
    {
        "F1": chapter_3.gain_and_cutoff,
        "F2": chapter_3.slope,
        "F3": chapter_3.delay,
        "F4": chapter_3.prbs_looks_white,
        "F5": chapter_3.pulse_spectra,
        "F6": chapter_3.sinusoid_disturbance,
        "F7": chapter_3.measurement_against_process,
        "F8": chapter_4.consistency,
        "F9": chapter_4.yaw_armax,
        "F10": chapter_4.yaw_oe,
        "F11": chapter_4.shoulder_oe,
        "F12": chapter_4.elbow_armax,
        "F13": chapter_4.stable,
        "F14": chapter_5.percent_described,
        "F15": chapter_5.without_detrending,
        "F16": chapter_6.real_poles,
        "F17": chapter_6.bode_agrees,
        "F18": chapter_6.exchange_fit,
        "F19": chapter_6.exchange_residuals,
        "F20": chapter_6.fast_chirp,
        "F21": chapter_6.slow_data,
        "F22": chapter_6.follows_5_hz,
        "F23": chapter_6.above_5_hz,
        "F24": chapter_6.parsimony,
        "F25": chapter_6.bias_and_outliers,
        "F26": chapter_6.coupling,
    }
)
"""Functions that decide the findings."""


def findings(study: Comparison) -> tuple[Finding, ...]:
    """Test all 26 findings of the thesis, in order.

    One whose record is missing, or refused by an estimator, cannot be told and says why.
    """
    decided = []
    for key, decide in FINDINGS.items():
        try:
            decided.append(decide(study))
        except (MissingRecordError, SysidError) as error:
            # Records may be such that an estimator refuses them; whatever else goes wrong is a fault of the study.
            refused = "" if isinstance(error, MissingRecordError) else "an estimator refuses its record: "
            decided.append(Finding(key, "cannot be told", {}, f"{refused}{error}"))
    return tuple(decided)
