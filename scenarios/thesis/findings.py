"""Claims of the thesis, each tested on the twin [Morris1996]."""

from collections.abc import Callable, Mapping
from types import MappingProxyType

from scenarios.files.errors import MissingRecordError
from scenarios.thesis import findings_chapter_3 as chapter_3
from scenarios.thesis import findings_chapter_4 as chapter_4
from scenarios.thesis import findings_chapter_5 as chapter_5
from scenarios.thesis import findings_chapter_6 as chapter_6
from scenarios.thesis import findings_comparison as comparison
from scenarios.thesis import findings_excitation as excitation
from scenarios.thesis import findings_observer as observer
from scenarios.thesis import findings_spectra as spectra
from scenarios.thesis import findings_structures as structures
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
        "F27": excitation.limited_to_10_hz,
        "F28": excitation.orders_of_excitation,
        "F29": excitation.noise_on_the_input,
        "F30": excitation.zero_mean,
        "F31": excitation.pulse_around_1_hz,
        "F32": spectra.other_modes,
        "F33": spectra.order_from_correlation,
        "F34": spectra.moderate_disturbances,
        "F35": spectra.bandwidth_needed,
        "F36": spectra.error_sources,
        "F37": spectra.coloured_noise,
        "F38": spectra.parametric_more_accurate,
        "F39": spectra.agrees_with_nonparametric,
        "F40": structures.noise_characterized,
        "F41": structures.better_structures,
        "F42": structures.yaw_most_nonlinear,
        "F43": structures.yaw_armax_best,
        "F44": structures.yaw_without_the_pair,
        "F45": structures.yaw_oe_independent,
        "F46": structures.yaw_oe_follows_the_mean,
        "F47": structures.yaw_oe_at_10_hz,
        "F48": structures.structures_agree,
        "F49": structures.linear_enough,
        "F50": observer.deadbeat,
        "F51": observer.observer_decays_faster,
        "F52": observer.many_parameters,
        "F53": observer.valid_below_1_hz,
        "F54": observer.predicts_own_record,
        "F55": observer.follows_the_chirp,
        "F56": observer.not_the_kalman_filter,
        "F57": observer.higher_orders_fit_better,
        "F58": comparison.captured_the_truth,
        "F59": comparison.near_the_origin,
        "F60": comparison.exchange_matched,
        "F61": comparison.due_to_output_error,
        "F62": comparison.chirp_matched,
        "F63": comparison.chirp_residuals,
        "F64": comparison.yaw_near_10_hz,
        "F65": comparison.okid_more_accurate,
        "F66": comparison.majority_of_records,
        "F67": comparison.better_overall,
        "F68": observer.second_order_suffices,
        "F69": comparison.valid_locally,
    }
)
"""Functions that decide the findings."""


def findings(study: Comparison) -> tuple[Finding, ...]:
    """Test all claims of the thesis, in order.

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
