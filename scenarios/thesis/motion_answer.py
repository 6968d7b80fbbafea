"""What a motion campaign says: its scores as one record, and the same in words."""

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np

from hmtb_twin import STUDIED_JOINTS
from hmtb_twin.parameters.drives import ACTUATORS, Friction
from hmtb_twin.parameters.values import HAND_CONTROLLER
from hmtb_twin.parameters.variants import VARIANTS
from scenarios.report.page import Page
from scenarios.thesis.finding import words
from scenarios.thesis.motion import METHODS, MotionCampaign, model_numbers
from scenarios.thesis.motion_score import COMMON, EXPLAINS, ArmScore, Cell, arms, factors, items, profile
from scenarios.truth.published import published

SHOWN = 20
"""Arms in the record, the best first."""

OF_MAP = ("servo", "presliding", "hold", "noise", "logged")
"""Factors that the cells of the map have in common: those of the best arm."""


def motion_record(campaign: MotionCampaign, cells: Sequence[Cell], failed: Sequence[str] = ()) -> dict[str, Any]:
    """Return all that a campaign says, for JSON: its scores, and the experiments that failed, with the reasons."""
    tests = {
        joint: [one for one in cells if (one.setting.joint, one.excitation) == (joint, "prbs")]
        for joint in STUDIED_JOINTS
    }
    every = arms(cells)
    best, worth = every[0], profile(every)
    fixed = {name: factors(best.cells[0])[name] for name in OF_MAP}
    return {
        "decided": "2026-11-23, before results",
        "explains": EXPLAINS,
        "campaign": vars(campaign),
        "settings": len(campaign.settings()),
        "joints": {
            joint: {
                "cells": len(own),
                "explained": sum(one.score <= EXPLAINS for one in own),
                "best": _with_distances(min(own, key=lambda one: one.score)),
                "friction": {
                    str(level): min(one.score for one in own if one.setting.friction == level)
                    for level in sorted({one.setting.friction for one in own})
                },
            }
            for joint, own in tests.items()
        },
        "printed": [row for joint, own in tests.items() for row in _nearest_to_prints(joint, own)],
        "arms": {
            "number": len(every),
            "explain_all": sum(len(arm.explains) == len(STUDIED_JOINTS) for arm in every),
            "best": [_arm(arm, cells) for arm in every[:SHOWN]],
        },
        "nominal": _arm(_nominal(tests.values()), cells),
        "profile": {name: levels for name, levels in worth.items() if len(levels) > 1},
        "map": [one.record() for own in tests.values() for one in own if fixed.items() <= factors(one).items()],
        "failed": list(failed),
    }


def motion_texts(record: Mapping[str, Any]) -> tuple[str, ...]:
    """Say in words what explains the thesis' models: for each joint, for one arm, by each factor."""
    page = Page({"words": words})
    return tuple(" ".join(part.split()) for part in page.render("motion_text.j2", record).split("\n\n") if part.strip())


def _nominal(tests: Iterable[Sequence[Cell]]) -> ArmScore:
    """The cells of every joint that are nearest to the nominal arm, its friction too."""
    own = HAND_CONTROLLER
    wanted = {"gain": own.gain, "hold": own.hold, "noise": own.noise, "volts": 1.0, "logged": 0.0}
    wanted["presliding"] = Friction.presliding

    def away(cell: Cell) -> tuple[float, ...]:
        levels, actuator = factors(cell), ACTUATORS[cell.setting.joint]
        rubs = cell.setting.friction * actuator.rated_torque / actuator.coulomb_torque
        numbers = (abs(float(str(levels[name])) - value) for name, value in wanted.items())
        return (float(cell.setting.servo != VARIANTS["nominal"].servo), *numbers, abs(np.log(rubs)))

    return ArmScore(tuple(min(cells, key=away) for cells in tests))


def _arm(arm: ArmScore, cells: Sequence[Cell]) -> dict[str, Any]:
    """Return what an arm's joints have in common, their scores, and what the methods recover by excitation."""
    common = {name: factors(arm.cells[0])[name] for name in COMMON}
    joints = {
        cell.setting.joint: {
            **{
                name: value
                for name, value in cell.record().items()
                if name in ("friction", "score", "spread", "within", "items")
            },
            "bandwidth_hz": {
                other.excitation: {method: other.medians.get(f"{method}_bandwidth_hz") for method in METHODS}
                for other in cells
                if (other.setting, factors(other)) == (cell.setting, factors(cell))
            },
        }
        for cell in arm.cells
    }
    return {**common, "score": arm.score, "error": arm.error, "explains": arm.explains, "joints": joints}


def _with_distances(cell: Cell) -> dict[str, object]:
    return {**cell.record(), "distances": dict(zip(items(cell.setting.joint), cell.distances, strict=True))}


def _nearest_to_prints(joint: str, cells: Sequence[Cell]) -> Iterable[dict[str, Any]]:
    """Yield for each printed model its numbers and the cell that is nearest to its five items."""
    names = list(items(joint))
    for model in published(joint):
        own = [k for k, name in enumerate(names) if name.startswith(f"{model.label}, ")]
        away = [float(np.mean([cell.distances[k] for k in own])) for cell in cells]
        nearest = cells[int(np.argmin(away))]
        yield {
            "joint": joint,
            "model": model.label,
            "method": model.method,
            "numbers": model_numbers(model.model),
            "distance": min(away),
            "nearest": nearest.record(),
        }
