"""Findings of chapter VI on what the three-joint models are: roots, responses, states, coupling."""

from collections.abc import Mapping
from statistics import median

import numpy as np

from hmtb_twin import JOINTS
from scenarios.thesis.both_ways import both_ways
from scenarios.thesis.comparison import Comparison
from scenarios.thesis.coupled_response import off_diagonal
from scenarios.thesis.finding import Finding, decided, verdict
from scenarios.thesis.multi_input import EXCITED, FULL_OKID, INDEPENDENT
from scenarios.thesis.multivariable import WAYS, Kind, Multivariable, ThreeJointModel, Way

AGREE_DB, AGREE_DEGREES = 3.0, 30.0
"""Two Bode plots agree where gain and phase differ by no more: what the eye sees on axes of decades and quadrants."""

BODE_BAND = (0.1, 5.0)
"""Where they have to agree, Hz."""

POINT = 1.0
"""What fewer states may cost, percentage points."""

LITTLE = 10.0
"""A coupling below it is little, percent."""


def real_poles(study: Comparison) -> Finding:
    """F16: OKID has real poles and complex zeros, the SysID model has complex poles."""
    own, okid = study.multivariable.pair()
    zeros = okid.model.zeros()
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
        else "the SysID model has none that fades"
    )
    printed = " and ".join(
        f"{complex_roots(entry.model.poles())} of {entry.model.order} poles and "
        f"{complex_roots(entry.model.zeros())} of {len(entry.model.zeros())} zeros complex in the {entry.name}"
        for entry in study.multivariable.pair(printed=True)
    )
    direct = max(float(np.abs(block.D).max()) for block in okid.blocks.values())
    return decided(
        "F16",
        verdict(sum(parts), len(parts)),
        {
            "OKID complex poles": float(complex_roots(okid.model.poles())),
            "OKID zeros": float(len(zeros)),
            "OKID complex zeros": float(complex_roots(zeros)),
            "SysID complex poles": float(complex_roots(own.model.poles())),
        },
        "number of roots with an imaginary part, three joints",
        "three parts: no pole of the OKID model complex, all of its zeros complex, a pole of the SysID model complex. "
        f"The zeros of two states with a direct term of at most {direct:.2g} (the arm, with its delay, has none) have "
        f"moduli of {np.abs(zeros).min(initial=np.inf):.2g} to {np.abs(zeros).max(initial=0.0):.2g}: they stand for "
        f"the delay that two states leave out, and small numbers decide whether they are real; {fading}. "
        f"As printed: {printed}",
    )


ROUNDING = 1e-6
"""An imaginary part below it is rounding."""


def complex_roots(roots: np.ndarray) -> int:
    """How many roots have an imaginary part."""
    return int((np.abs(roots.imag) > ROUNDING).sum())


def bode_agrees(study: Comparison) -> Finding:
    """F17: the Bode plots of the two three-joint models agree."""
    apart = {joint: bode_apart(study.multivariable, joint) for joint in study.joints}
    printed = [bode_apart(study.multivariable, joint, printed=True) for joint in study.joints]
    own, okid = study.multivariable.pair()
    return decided(
        "F17",
        verdict(sum(gain < AGREE_DB and phase < AGREE_DEGREES for gain, phase in apart.values()), len(apart)),
        {
            **{f"{joint}, gain": gain for joint, (gain, _) in apart.items()},
            **{f"{joint}, phase": phase for joint, (_, phase) in apart.items()},
        },
        f"dB and degrees, largest difference of gain and phase from {BODE_BAND[0]:g} to {BODE_BAND[1]:g} Hz",
        f"less than {AGREE_DB:g} dB and {AGREE_DEGREES:g} degrees is taken as agreement, joint by joint. Both come "
        f"from one record and both are near the truth (diagonal error {100 * own.diagonal_error:.1f} and "
        f"{100 * okid.diagonal_error:.1f} %); the printed pair differs by "
        f"{', '.join(f'{gain:.1f} dB and {phase:.0f} degrees' for gain, phase in printed)}",
    )


def bode_apart(found: Multivariable, joint: str, *, printed: bool = False) -> tuple[float, float]:
    """Largest difference of gain, dB, and of phase, degrees, between the SysID and the OKID model of a joint."""
    f = np.geomspace(*BODE_BAND, 100)
    one, other = (entry.blocks[joint].frequency_response(f)[:, 0, 0] for entry in found.pair(printed=printed))
    ratio = one / other
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
    decision, said = both_ways({way: sum(v > -POINT for v in apart[way].values()) for way in WAYS}, len(study.joints))
    return decided(
        "F24",
        decision,
        {f"{joint}, {way.replace('_', ' ')}": value for way in WAYS for joint, value in apart[way].items()},
        "percentage points, median fit of OKID less that of the SysID model over all records not identified from",
        f"the orders are {_orders(okid)} against {_orders(own)}; they are imposed, what the twin decides is whether "
        f"fewer states cost fit, {POINT:g} point allowed, joint by joint. {said[0].upper()}{said[1:]}",
    )


def held_out_fit(study: Comparison, kind: Kind, joint: str, way: Way) -> float:
    """Median fit of a model over all records that it was not identified from, of one joint and of several, percent."""
    entry = study.joints[joint]
    single = entry.models["okid"] if kind == "OKID" else entry.chosen
    several = study.multivariable.model(kind)
    alone = [fit.simulation if way == "simulation" else fit.one_step for fit in single.held_out(study.estimation_test)]
    return median([*alone, *(fits.of(way)[joint] for fits in several.fits.values())])


def _orders(model: ThreeJointModel) -> str:
    return "/".join(str(block.order) for block in model.blocks.values())


def coupling(study: Comparison) -> Finding:
    """F26: little coupling between the joints near the operating point."""
    moved = {joint: _others_move(study, joint) for joint in study.joints}
    study.campaign.log(INDEPENDENT)
    full = {entry.record: entry for entry in study.multivariable.full if entry.method == FULL_OKID}
    found = {
        "truth": 100 * study.multivariable.coupling,
        "identified, independent waveforms": 100 * full[INDEPENDENT].coupling,
        **{f"motion with {joint}": value for joint, value in moved.items()},
    }
    shared = [entry for record, entry in full.items() if record != INDEPENDENT]
    aside = "".join(
        f". From one shared waveform (condition {entry.condition:.0f} between the commands) the same method finds "
        f"{100 * entry.coupling:.0f} %, which is not there"
        for entry in shared
    )
    true = 100 * off_diagonal(study.multivariable.truth, band=EXCITED)
    return decided(
        "F26",
        verdict(sum(value < LITTLE for value in found.values()), len(found)),
        found,
        "percent: response off the diagonal over all of it, true (0.1 to 10 Hz) and identified (0.5 to 10 Hz); largest "
        "motion of another studied joint over that of the one excited alone, PRBS test",
        f"below {LITTLE:g} % each is taken as little. Stiff servos hold what another joint pushes: over the identified "
        f"band the true response has {true:.1f} % off the diagonal{aside}",
    )


def _others_move(study: Comparison, joint: str) -> float:
    log = study.campaign.log(study.joints[joint].data[study.estimation_test].name)
    spread: Mapping[str, float] = {
        other: float(np.std(log.true_angles[:, JOINTS.index(other)])) for other in study.joints
    }
    return 100 * max(value for other, value in spread.items() if other != joint) / spread[joint]
