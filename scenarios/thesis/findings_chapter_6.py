"""Findings of chapter VI on what the three-joint models are: roots, responses, states, coupling."""

from collections.abc import Mapping

import numpy as np

from hmtb_twin import JOINTS
from scenarios.experiments.campaign import RPCM
from scenarios.thesis.comparison import Comparison
from scenarios.thesis.finding import Finding, decided_finding, verdict
from scenarios.thesis.multi_input import EXCITED, FULL_OKID, INDEPENDENT, pushed_by_others
from scenarios.thesis.multivariable import WAYS, Multivariable, ThreeJointModel
from scenarios.thesis.record_fits import held_out_fit, held_out_records, ties, within_reach
from scenarios.thesis.reference_fits import COUPLED, DIAGONAL
from scenarios.thesis.verdicts import verdict_by_way, verdict_of_readings

AGREE_DB, AGREE_DEGREES = 3.0, 30.0
"""Two Bode plots agree where gain and phase differ by no more: visible on axes of decades and quadrants."""

BODE_BAND = (0.1, 5.0)
"""Band in which they have to agree, Hz."""

POINT = 1.0
"""Largest loss of fit with fewer states, percentage points."""

LITTLE = 10.0
"""A coupling below this share counts as little, percent."""

FROM, MIDDLE, HIGH = 0.1, (3.0, 5.0), (5.0, 10.0)
"""Bands of the coupling, Hz: up to the lowest bandwidth of a joint, then the thesis' two bands."""

FINITE = 1e3
"""A transmission zero beyond this modulus counts as infinite: rounding makes it finite."""


def real_poles(study: Comparison) -> Finding:
    """F16: OKID has real poles and complex zeros, the SysID model has complex poles."""
    own, okid = study.multivariable.pair()
    zeros = finite(okid.model.zeros())
    beyond = len(okid.model.zeros()) - len(zeros)
    parts = [
        complex_roots(okid.model.poles()) == 0,
        0 < len(zeros) == complex_roots(zeros),
        complex_roots(own.model.poles()) > 0,
    ]
    pair = own.model.poles()[np.abs(own.model.poles().imag) > ROUNDING]
    fading = (
        f"the complex poles of the SysID model have moduli up to {np.abs(pair).max():.2f}, gone within "
        f"{np.log(0.05) / np.log(np.abs(pair).max()):.0f} samples"
        if len(pair) and 0 < np.abs(pair).max() < 1
        else f"the SysID model has {'complex poles that do not fade' if len(pair) else 'no complex pole'}"
    )
    printed = " and ".join(
        f"{complex_roots(entry.model.poles())} of {entry.model.order} poles and "
        f"{complex_roots(finite(entry.model.zeros()))} of {len(finite(entry.model.zeros()))} zeros complex in the "
        f"{entry.name}"
        for entry in study.multivariable.pair(printed=True)
    )
    direct = max(float(np.abs(block.D).max()) for block in okid.blocks.values())
    return decided_finding(
        "F16",
        verdict(sum(parts), len(parts)),
        {
            "OKID complex poles": float(complex_roots(okid.model.poles())),
            "OKID zeros": float(len(zeros)),
            "OKID complex zeros": float(complex_roots(zeros)),
            "SysID complex poles": float(complex_roots(own.model.poles())),
        },
        "number of roots with an imaginary part, three joints",
        "three parts: no pole of the OKID model complex, all of its zeros complex, a pole of the SysID model complex; "
        f"zeros with a modulus above {FINITE:g} are at infinity and not counted ({beyond} of OKID's). The zeros of "
        f"two states with a direct term of at most {direct:.2g} (the arm, with its delay, has none) have "
        f"moduli of {np.abs(zeros).min(initial=np.inf):.2g} to {np.abs(zeros).max(initial=0.0):.2g}: they stand for "
        f"the delay that two states leave out, and small numbers decide whether they are real; {fading}. "
        f"As printed: {printed}",
    )


def finite(zeros: np.ndarray) -> np.ndarray:
    """Return the finite roots; very large ones are infinite roots that rounding made finite."""
    return np.asarray(zeros[np.abs(zeros) <= FINITE])


ROUNDING = 1e-6
"""A smaller imaginary part is rounding."""


def complex_roots(roots: np.ndarray) -> int:
    """Count the complex roots."""
    return int((np.abs(roots.imag) > ROUNDING).sum())


def bode_agrees(study: Comparison) -> Finding:
    """F17: the Bode plots of the two three-joint models agree."""
    apart = {joint: bode_differences(study.multivariable, joint) for joint in study.joints}
    printed = {joint: bode_differences(study.multivariable, joint, printed=True) for joint in study.joints}
    so = sum(gain < AGREE_DB and phase < AGREE_DEGREES for gain, phase in printed.values())
    own, okid = study.multivariable.pair()
    return decided_finding(
        "F17",
        verdict(sum(gain < AGREE_DB and phase < AGREE_DEGREES for gain, phase in apart.values()), len(apart)),
        {
            **{f"{joint}, gain": gain for joint, (gain, _) in apart.items()},
            **{f"{joint}, phase": phase for joint, (_, phase) in apart.items()},
        },
        f"dB and degrees, largest difference of gain and phase from {BODE_BAND[0]:g} to {BODE_BAND[1]:g} Hz",
        f"less than {AGREE_DB:g} dB and {AGREE_DEGREES:g} degrees is taken as agreement, joint by joint: wide limits, "
        f"for "
        f"what the thesis itself calls comparable. Its printed pair differs by {_differences_text(printed)}, which "
        f"passes on "
        f"{so} of "
        f"{len(printed)} joints. Both of the twin's come from one record and both are near the truth (diagonal error "
        f"{100 * own.diagonal_error:.1f} and {100 * okid.diagonal_error:.1f} %)",
    )


def _differences_text(distances: Mapping[str, tuple[float, float]]) -> str:
    return ", ".join(
        f"{gain:.1f} dB and {phase:.0f} degrees on {joint.replace('_', ' ')}"
        for joint, (gain, phase) in distances.items()
    )


def bode_differences(models: Multivariable, joint: str, *, printed: bool = False) -> tuple[float, float]:
    """Largest difference of gain, dB, and of phase, degrees, between the SysID and the OKID model of a joint."""
    f = np.geomspace(*BODE_BAND, 100)
    first, second = (entry.blocks[joint].frequency_response(f)[:, 0, 0] for entry in models.pair(printed=printed))
    ratio = first / second
    return float(20 * np.abs(np.log10(np.abs(ratio))).max()), float(np.abs(np.degrees(np.angle(ratio))).max())


def parsimony(study: Comparison) -> Finding:
    """F24: two states each do as well as five, two and three."""
    apart = {
        way: {
            joint: held_out_fit(study, "OKID", joint, way) - held_out_fit(study, "SysID", joint, way)
            for joint in study.joints
        }
        for way in WAYS
    }
    own, okid = study.multivariable.pair()
    decision, text = verdict_by_way(
        {way: sum(v > -POINT for v in apart[way].values()) for way in WAYS}, len(study.joints)
    )
    value = {f"{joint}, {way.replace('_', ' ')}": points for way in WAYS for joint, points in apart[way].items()}
    single, several = held_out_records(study, next(iter(study.joints)))
    names = tuple(several)
    return decided_finding(
        "F24",
        decision,
        value,
        "percentage points, median fit of OKID less that of the SysID model over all records of other waveforms than "
        "the binary sequence that both were identified from",
        f"the orders are {_orders(okid)} against {_orders(own)}; they are imposed, what the twin decides is whether "
        f"fewer states cost fit, {POINT:g} point allowed, joint by joint; {ties(value)}. {text[0].upper()}{text[1:]}. "
        f"For yaw those are {len(tuple(single))} single-joint tests and {len(names)} records of several joints"
        f"{f'. {within_reach(study, names)}' if names else ''}",
    )


def _orders(model: ThreeJointModel) -> str:
    return "/".join(str(block.order) for block in model.blocks.values())


def coupling(study: Comparison) -> Finding:
    """F26: little coupling between the joints near the operating point."""
    lowest = min(entry.truth.bandwidth_hz for entry in study.joints.values())
    bands = {
        f"{FROM:g} Hz to the bandwidth": (FROM, lowest),
        **{f"{low:g} to {high:g} Hz": (low, high) for low, high in (MIDDLE, HIGH)},
    }
    share = {
        name: {joint: 100 * part for joint, part in pushed_by_others(study.multivariable.truth, band=band).items()}
        for name, band in bands.items()
    }
    first, *_, last = share.values()
    moved = {joint: _others_move(study, joint) for joint in study.joints}
    by_band = verdict(sum(max(by_joint.values()) < LITTLE for by_joint in share.values()), len(share))
    by_data = verdict(sum(value < LITTLE for value in moved.values()), len(moved))
    decision, text = verdict_of_readings(
        {"as a response, band by band": by_band, "as motion in the PRBS tests": by_data}
    )
    return decided_finding(
        "F26",
        decision,
        {
            **{f"{joint}, {name}": value for name, by_joint in share.items() for joint, value in by_joint.items()},
            **{f"motion with {joint}": value for joint, value in moved.items()},
        },
        "percent: gains from the other joints' commands to a joint over the gain from its own, all added up, largest "
        "in "
        "the band; largest motion of another studied joint over that of the one excited alone, PRBS test",
        f"below {LITTLE:g} % everywhere is taken as little. {text[0].upper()}{text[1:]}. The lowest bandwidth is "
        f"{lowest:.2f} Hz: up to it the other commands have at most {max(first.values()):.0f} % of what the own one "
        f"has, "
        f"from {HIGH[0]:g} to {HIGH[1]:g} Hz {max(last.values()):.0f} %{_exchange(study)}"
        f"{_identified(study)}",
    )


def _exchange(study: Comparison) -> str:
    """Describe the effect of coupling in the record for which the thesis reports little coupling."""
    if RPCM not in study.multivariable.records:
        return ""
    alone, whole = (study.multivariable.reference(kind, RPCM) for kind in (DIAGONAL, COUPLED))
    most = max(whole[joint] - alone[joint] for joint in alone)
    return (
        ". In the exchange, from which the thesis has its claim, the true coupling is worth "
        f"{most:.2f} points of fit at most"
    )


def _identified(study: Comparison) -> str:
    """Describe the models of all nine responses, with independent waveforms and with a shared one."""
    text = ""
    for entry in study.multivariable.full:
        if entry.method == FULL_OKID:
            apart = entry.record == INDEPENDENT
            text += (
                f". {entry.method}, from {'a waveform for each axis' if apart else 'one shared waveform'} (condition "
                f"{entry.condition:.0f} between the commands) finds up to "
                f"{100 * max(pushed_by_others(entry.model, band=EXCITED).values()):.0f} % between {EXCITED[0]:g} and "
                f"{EXCITED[1]:g} Hz"
            )
    if text:
        true = 100 * max(pushed_by_others(study.multivariable.truth, band=EXCITED).values())
        text += f"; the truth has {true:.0f} %"
    return text


def _others_move(study: Comparison, joint: str) -> float:
    log = study.campaign.log(study.joints[joint].data[study.estimation_test].name)
    spread: Mapping[str, float] = {
        other: float(np.std(log.true_angles[:, JOINTS.index(other)])) for other in study.joints
    }
    return 100 * max(value for other, value in spread.items() if other != joint) / spread[joint]
