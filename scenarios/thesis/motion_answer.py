"""What a motion campaign says: its scores as one record, and the same in words."""

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np

from hmtb_twin import STUDIED_JOINTS
from hmtb_twin.parameters.drives import Friction, Hydraulics
from hmtb_twin.parameters.values import HAND_CONTROLLER
from hmtb_twin.parameters.variants import ACTUATORS, VARIANTS
from scenarios.report.page import Page
from scenarios.thesis.finding import words
from scenarios.thesis.motion import METHODS, MotionCampaign, model_numbers
from scenarios.thesis.motion_score import COMMON, EXPLAINS, OWN, ArmScore, Cell, arms, factors, items, profile
from scenarios.truth.published import published

SHOWN = 20
"""Arms in the record, the best first."""

SCORES_OF_JOINT = ("friction", "drift", "score", "spread", "within", "items")
"""Numbers of a cell that the record of an arm has for each joint."""

OF_MAP = ("servo", "slope", "presliding", "hold", "noise", "logged")
"""Factors that the cells of the map have in common: those of the best arm. They have no drift."""


def motion_record(campaign: MotionCampaign, cells: Sequence[Cell], failed: Sequence[str] = ()) -> dict[str, Any]:
    """Return all that a campaign says, for JSON: its scores, and the experiments that failed, with the reasons."""
    tests: dict[str, list[Cell]] = {}
    printed: list[dict[str, Any]] = []
    for joint in STUDIED_JOINTS:
        # The thesis' models come from binary tests: the other excitations only show what they would have given.
        tests[joint] = [cell for cell in cells if cell.setting.joint == joint and cell.excitation == "prbs"]
        printed += _nearest_to_prints(joint, tests[joint])
    ranked_arms = arms(cells)
    score_by_level = profile(ranked_arms)
    return {
        "decided": "2026-11-23, before results",
        "extended": "2026-11-30, before results",
        "explains": EXPLAINS,
        "campaign": vars(campaign),
        "settings": len(campaign.settings()),
        "joints": {joint: _joint_record(of_joint) for joint, of_joint in tests.items()},
        "printed": printed,
        "arms": {
            "number": len(ranked_arms),
            "explain_all": sum(len(arm.explains) == len(STUDIED_JOINTS) for arm in ranked_arms),
            "best": [_arm_record(arm, cells) for arm in ranked_arms[:SHOWN]],
        },
        "nominal": _arm_record(_nominal(tests.values()), cells),
        # A factor of which one level was tried cost nothing to fix.
        "profile": {name: levels for name, levels in score_by_level.items() if len(levels) > 1},
        "map": _map_records(ranked_arms[0], tests.values()),
        "failed": list(failed),
    }


def _joint_record(cells: Sequence[Cell]) -> dict[str, Any]:
    """How many cells of a joint explain it, the best of them, and the best score at each level of what is its own."""
    best_by_level = {name: _best_by_level(cells, name) for name in OWN}
    return {
        "cells": len(cells),
        "explained": sum(cell.score <= EXPLAINS for cell in cells),
        "best": _with_distances(min(cells, key=lambda cell: cell.score)),
        **best_by_level,
    }


def _best_by_level(cells: Sequence[Cell], name: str) -> dict[str, float]:
    """The best score of a joint at each level of a factor."""
    scores: dict[float, float] = {}
    for cell in cells:
        level = float(str(factors(cell)[name]))
        scores[level] = min(cell.score, scores.get(level, cell.score))
    return {str(level): score for level, score in sorted(scores.items())}


def _map_records(best: ArmScore, tests: Iterable[Sequence[Cell]]) -> list[dict[str, object]]:
    """The cells of every joint that share with the best arm all factors but motion and friction, the map's axes."""
    levels_of_best = factors(best.cells[0])
    fixed = {name: levels_of_best[name] for name in OF_MAP}
    records = []
    for cells in tests:
        records += [cell.record() for cell in cells if fixed.items() <= factors(cell).items() and not cell.drift]
    return records


def motion_texts(record: Mapping[str, Any]) -> tuple[str, ...]:
    """Say in words what explains the thesis' models: for each joint, for one arm, by each factor."""
    paragraphs = Page({"words": words}).render("motion_text.j2", record).split("\n\n")
    return tuple(" ".join(paragraph.split()) for paragraph in paragraphs if paragraph.strip())


def _nominal(tests: Iterable[Sequence[Cell]]) -> ArmScore:
    """The cells of every joint that are nearest to the nominal arm, its friction too."""
    hand_controller = HAND_CONTROLLER
    nominal = {
        "gain": hand_controller.gain,
        "hold": hand_controller.hold,
        "noise": hand_controller.noise,
        "volts": 1.0,
        "logged": 0.0,
        "drift": 0.0,
        "slope": Hydraulics.load_flow_slope,
        "presliding": Friction.presliding,
    }

    def distances(cell: Cell) -> tuple[float, ...]:
        """By factor, the most important first: tuples are compared one factor after the other."""
        levels, actuator = factors(cell), ACTUATORS[cell.setting.joint]
        friction_ratio = cell.setting.friction * actuator.rated_torque / actuator.coulomb_torque
        differences = []
        for name, level in nominal.items():
            differences.append(abs(float(str(levels[name])) - level))
        other_servo = cell.setting.servo != VARIANTS["nominal"].servo
        return (float(other_servo), *differences, abs(np.log(friction_ratio)))

    return ArmScore(tuple(min(cells, key=distances) for cells in tests))


def _arm_record(arm: ArmScore, cells: Sequence[Cell]) -> dict[str, Any]:
    """Return what an arm's joints have in common, their scores, and what the methods recover by excitation."""
    common = {name: factors(arm.cells[0])[name] for name in COMMON}
    joints = {}
    for cell in arm.cells:
        record = cell.record()
        bandwidths = {}
        for same in cells:
            # The same arm and chain under the other excitations.
            if (same.setting, factors(same)) == (cell.setting, factors(cell)):
                recovered = {method: same.medians.get(f"{method}_bandwidth_hz") for method in METHODS}
                bandwidths[same.excitation] = recovered
        joints[cell.setting.joint] = {
            **{name: value for name, value in record.items() if name in SCORES_OF_JOINT},
            "bandwidth_hz": bandwidths,
        }
    return {**common, "score": arm.score, "error": arm.error, "explains": arm.explains, "joints": joints}


def _with_distances(cell: Cell) -> dict[str, object]:
    """The record of a cell with its distance from every printed item by name."""
    return {**cell.record(), "distances": dict(zip(items(cell.setting.joint), cell.distances, strict=True))}


def _nearest_to_prints(joint: str, cells: Sequence[Cell]) -> Iterable[dict[str, Any]]:
    """Yield for each printed model its numbers and the cell that is nearest to its five items."""
    item_names = list(items(joint))
    for model in published(joint):
        of_model = [index for index, name in enumerate(item_names) if name.startswith(f"{model.label}, ")]
        distances = []
        for cell in cells:
            of_cell = [cell.distances[index] for index in of_model]
            distances.append(float(np.mean(of_cell)))
        nearest = cells[int(np.argmin(distances))]
        yield {
            "joint": joint,
            "model": model.label,
            "method": model.method,
            "numbers": model_numbers(model.model),
            "distance": min(distances),
            "nearest": nearest.record(),
        }
