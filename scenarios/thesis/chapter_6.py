"""Report section on chapter VI: tables of the three-joint models."""

import numpy as np

from hmtb_twin import JOINTS, STUDIED_JOINTS, Status
from scenarios.experiments.campaign import RPCM
from scenarios.experiments.log_review import SETTLING
from scenarios.thesis.campaign import plays_identified_sequence
from scenarios.thesis.categories import categories
from scenarios.thesis.comparison import Comparison
from scenarios.thesis.multi_input import EXCITED, off_diagonal, pushed_by_others
from scenarios.thesis.multivariable import FAST_CHIRP, ThreeJointModel
from scenarios.thesis.reference_fits import COUPLED, DIAGONAL, NOISELESS

PUSHED = (0.5, 1.0, 2.5, 5.0, 10.0)
"""Frequencies at which the true coupling is listed, Hz."""


def chapter_6(study: Comparison) -> dict[str, object]:
    """Numbers of the section.

    Args:
        study: The study.

    Returns:
        Variables of the template.
    """
    arm_models = study.multivariable
    return {
        "joints": STUDIED_JOINTS,
        "models": [{"model": entry, "bandwidths": _bandwidths(entry)} for entry in arm_models.models],
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
        "exchange": _exchange(study) if RPCM in arm_models.records else {},
        "reach": _chirp_fits(study) if FAST_CHIRP in arm_models.records else {},
        "same": [name for name in arm_models.records if plays_identified_sequence(name)],
        "records": arm_models.records,
        "categories": categories(study),
    }


def departure(study: Comparison) -> dict[str, float]:
    """Largest distance of each joint from the operating point in the settled part of the exchange, rad."""
    log = study.campaign.log(RPCM)
    away = np.abs(log.true_angles[round(SETTLING / log.dt) :] - study.truth.angles).max(axis=0)
    return dict(zip(JOINTS, map(float, away), strict=True))


def _exchange(study: Comparison) -> dict[str, object]:
    log = study.campaign.log(RPCM)
    held = (log.status[round(SETTLING / log.dt) :] & Status.UNIT_HELD) > 0
    return {
        "away": {joint: float(np.degrees(value)) for joint, value in departure(study).items()},
        "loaded": 100.0 * float(held.mean()),
    }


def _chirp_fits(study: Comparison) -> dict[str, list[float]]:
    """Fits to the fast chirp by joint, percent: truth without coupling, truth with coupling, true angles."""
    models = study.multivariable
    return {
        joint: [models.reference(kind, FAST_CHIRP)[joint] for kind in (DIAGONAL, COUPLED, NOISELESS)]
        for joint in STUDIED_JOINTS
    }


def _bandwidths(entry: ThreeJointModel) -> list[float]:
    return [float(block.bandwidth()[0, 0]) for block in entry.blocks.values()]
