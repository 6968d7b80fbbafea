"""Report section on chapter VI: comparison of the three-joint models."""

from collections.abc import Mapping

import numpy as np

from hmtb_twin import STUDIED_JOINTS
from scenarios.experiments.campaign import RPCM
from scenarios.report.figure_style import short
from scenarios.report.figures import Gallery, Picture
from scenarios.thesis import figures_chapter_6 as draw
from scenarios.thesis import figures_records as records
from scenarios.thesis.campaign import plays_identified_sequence
from scenarios.thesis.categories import categories
from scenarios.thesis.comparison import Comparison
from scenarios.thesis.figures_chapter_6 import block_diagrams
from scenarios.thesis.multi_input import EXCITED, off_diagonal, pushed_by_others
from scenarios.thesis.multivariable import FAST_CHIRP, ThreeJointModel
from scenarios.thesis.reference_fits import COUPLED, DIAGONAL, NOISELESS

BODES = {"shoulder_yaw": ("58", "61"), "shoulder_pitch": ("59", "62"), "elbow_pitch": ("60", "63")}
"""The thesis' Bode plots of the SysID and of the OKID model."""

SHOWN = (20.0, 4.0)
"""Start of a part of the chirp after settling, and its length, s: two sweeps."""


PUSHED = (0.5, 1.0, 2.5, 5.0, 10.0)
"""Frequencies at which the true coupling is listed, Hz."""


def chapter_6(study: Comparison, gallery: Gallery) -> dict[str, object]:
    """Figures and numbers of the section.

    Args:
        study: The study.
        gallery: Takes the figures, in the order of the page.

    Returns:
        What the template shows.
    """
    arm_models = study.multivariable
    models = _models(study, gallery)
    return {
        "joints": STUDIED_JOINTS,
        "models": [{"model": entry, "bandwidths": _bandwidths(entry)} for entry in arm_models.models],
        "figures": models,
        "full": arm_models.full,
        "true_coupling": off_diagonal(arm_models.truth, band=EXCITED),
        "pushes": [
            {
                "hz": hz,
                "share": {
                    joint: 100 * part for joint, part in pushed_by_others(arm_models.truth, band=(hz, hz)).items()
                },
            }
            for hz in PUSHED
        ],
        "exchange": _exchange(study, gallery) if RPCM in arm_models.records else {},
        "chirp": _chirp(study, gallery) if FAST_CHIRP in arm_models.records else [],
        "reach": _chirp_fits(study) if FAST_CHIRP in arm_models.records else {},
        "same": [name for name in arm_models.records if plays_identified_sequence(name)],
        "records": arm_models.records,
        "fits": _every_fit(study, gallery) if arm_models.records else None,
        "categories": categories(study),
    }


def _chirp_fits(study: Comparison) -> dict[str, list[float]]:
    """Fits to the fast chirp by joint, percent: truth without coupling, truth with coupling, true angles."""
    models = study.multivariable
    return {
        joint: [models.reference(kind, FAST_CHIRP)[joint] for kind in (DIAGONAL, COUPLED, NOISELESS)]
        for joint in STUDIED_JOINTS
    }


def _models(study: Comparison, gallery: Gallery) -> dict[str, Picture | list[Picture]]:
    return {
        "blocks": gallery.add(
            block_diagrams(),
            "the two structures of the SysID model: ARMAX on yaw and elbow pitch, output error on shoulder pitch. An "
            "output-error model has no dynamics of the noise, so it cannot predict better than it simulates.",
            name="block-diagrams",
            thesis=("56", "57"),
        ),
        "bode": [
            gallery.add(
                draw.joint_bode(study, joint),
                f"{short(joint)} in the SysID and the OKID model, identified from the twin and as printed, against the "
                "true response. Grey: not excited; dotted: 1 Hz.",
                name=f"three-joint-bode-{joint.replace('_', '-')}",
                thesis=figures,
            )
            for joint, figures in BODES.items()
        ],
        "roots": gallery.add(
            draw.root_maps(study),
            "poles (crosses) and transmission zeros (rings) of the SysID and the OKID model, identified from the twin "
            "(large) and as printed (small). A pole with a zero on it is a state that the model could do without.",
            name="three-joint-roots",
            thesis=("64", "65"),
        ),
        "coupled": gallery.add(
            draw.coupled(study),
            "gain from each commanded to each measured angle: the true arm couples its pitch joints, the "
            "block-diagonal "
            "models by construction do not, and a model of all nine responses finds couplings that are not there when "
            "the "
            "axes share a waveform. Panels without a black line: true gain below 0.0001.",
            name="coupled",
        ),
    }


def _bandwidths(entry: ThreeJointModel) -> list[float]:
    return [float(block.bandwidth()[0, 0]) for block in entry.blocks.values()]


def _exchange(study: Comparison, gallery: Gallery) -> dict[str, object]:
    exchange = study.multivariable.exchange
    away: Mapping[str, float] = {} if exchange is None else exchange.departure
    return {
        "away": {joint: float(np.degrees(value)) for joint, value in away.items()},
        "loaded": 0.0 if exchange is None else 100 * exchange.loaded,
        "phases": [
            {"phase": entry, "swing": {joint: float(np.degrees(value)) for joint, value in entry.swing.items()}}
            for entry in (() if exchange is None else exchange.phases)
        ],
        "kinds": [entry.name for entry in study.multivariable.pair()],
        "figures": [
            gallery.add(
                records.record(study, RPCM, degrees=True),
                "commanded and measured angles during the exchange of the replacement unit, without their means; "
                "on this scale they coincide.",
                name="exchange-record",
                thesis=("66",),
            ),
            gallery.add(
                records.whole_outputs(study, RPCM),
                "the exchange simulated by the SysID and the OKID model, and below each joint what they miss. Where "
                "only one colour is seen, both say the same. Percent: fit in simulation.",
                name="exchange-outputs",
                thesis=("67", "68", "69", "73", "74", "75"),
            ),
            gallery.add(
                records.residuals(study, RPCM),
                "one-step residuals on the exchange, SysID model left, OKID model right, on the same axes. With K = 0 "
                "a residual is the error of the simulation: not a worse model, but another question.",
                name="exchange-residuals",
                thesis=("70", "76"),
            ),
            gallery.add(
                records.correlations(study, RPCM, inputs=STUDIED_JOINTS[:1]),
                "residuals on the exchange: autocorrelation, and correlation of yaw's with its input, SysID model "
                "left, OKID model right. Bars beyond the grey bounds contradict a perfect model at 99 %.",
                name="exchange-correlations",
                thesis=("71", "72", "77", "78"),
            ),
        ],
    }


def _chirp(study: Comparison, gallery: Gallery) -> list[Picture]:
    start, length = SHOWN
    return [
        gallery.add(
            records.record(study, FAST_CHIRP, start=start, length=length, degrees=False),
            "two sweeps of the chirp of several joints, 5 to 10 Hz: commanded and measured angles without their means. "
            "The three commands are multiples of one waveform.",
            name="chirp-record",
            thesis=("79",),
        ),
        gallery.add(
            records.part_outputs(study, FAST_CHIRP, start=start, length=0.5 * length),
            "one sweep by both models, simulated (left) and predicted one step ahead (right); percent: fit to the "
            "whole record. The difference between the columns is what knowing the last output is worth.",
            name="chirp-outputs",
            thesis=("80", "81", "82", "84", "85", "86"),
        ),
        gallery.add(
            records.residuals(study, FAST_CHIRP, start=start, length=length),
            "one-step residuals on the chirp, SysID model left, OKID model right, on the same axes; rms of the whole "
            "record.",
            name="chirp-residuals",
            thesis=("83", "87"),
        ),
        gallery.add(
            records.correlations(study, FAST_CHIRP, inputs=STUDIED_JOINTS),
            "residuals on the chirp: autocorrelation, and correlation of yaw's residual with all three inputs. The "
            "last three rows are one picture, because the inputs are one waveform: they cannot show a coupling.",
            name="chirp-correlations",
        ),
    ]


def _every_fit(study: Comparison, gallery: Gallery) -> Picture:
    return gallery.add(
        draw.every_fit(study),
        "fits of the SysID and the OKID model to every record of several joints: in simulation (filled) and one step "
        "ahead (open). A mark without a partner has both at one place. Black bars: what the linear truth follows "
        "without "
        "its coupling (dashed) and with it (solid).",
        name="every-fit",
    )
