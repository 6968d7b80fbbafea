"""What a motion campaign says: answers in words, tables and the cells of the map over motion and friction."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from hmtb_twin import STUDIED_JOINTS
from hmtb_twin.files.atomic_write import write_whole
from hmtb_twin.parameters.drives import ACTUATORS, Friction
from hmtb_twin.parameters.values import HAND_CONTROLLER
from hmtb_twin.parameters.variants import VARIANTS
from scenarios.datasets.tables import table_text
from scenarios.thesis.motion import METHODS, MotionCampaign, Row, Setting
from scenarios.thesis.motion_score import COMMON, EXPLAINS, ArmScore, Cell, arms, cells, factors, items, profile

SHOWN = 20
"""Arms in the results, the best first."""


@dataclass(frozen=True, eq=False)
class MotionStudy:
    """A motion campaign with its scores.

    Attributes:
        campaign: Its factors.
        cells: Its cells, setting by setting.
        failed: Experiments that failed, with the reasons.
    """

    campaign: MotionCampaign
    cells: tuple[Cell, ...]
    failed: tuple[str, ...] = ()

    @classmethod
    def of(cls, campaign: MotionCampaign, results: Mapping[Setting, Sequence[Row]]) -> "MotionStudy":
        """Score the results of a campaign."""
        failed = (f"{one}, {row['failed']}" for one, rows in results.items() for row in rows if "failed" in row)
        return cls(campaign, cells(results), tuple(failed))

    @cached_property
    def arms(self) -> tuple[ArmScore, ...]:
        """Every arm, the best first; see `motion_score.arms`."""
        return arms(self.cells)

    @cached_property
    def nominal(self) -> ArmScore:
        """The arm of the campaign that is nearest to the nominal one, its friction too."""
        own = HAND_CONTROLLER
        wanted = {"gain": own.gain, "hold": own.hold, "noise": own.noise, "volts": 1.0, "logged": 0.0}
        wanted["presliding"] = Friction.presliding

        def away(cell: Cell) -> tuple[float, ...]:
            levels, actuator = factors(cell), ACTUATORS[cell.setting.joint]
            rubs = cell.setting.friction * actuator.rated_torque / actuator.coulomb_torque
            numbers = (abs(float(str(levels[name])) - value) for name, value in wanted.items())
            return (float(cell.setting.servo != VARIANTS["nominal"].servo), *numbers, abs(np.log(rubs)))

        return ArmScore(tuple(min(self._tests(joint), key=away) for joint in STUDIED_JOINTS))

    def best(self, joint: str) -> Cell:
        """The cell of a joint with the least score."""
        return min(self._tests(joint), key=lambda cell: cell.score)

    def _tests(self, joint: str) -> list[Cell]:
        return [cell for cell in self.cells if cell.setting.joint == joint and cell.excitation == "prbs"]

    def answers(self) -> tuple[str, ...]:
        """Say what explains the thesis' models: each joint alone, one arm for all, what each factor is worth."""
        best, nominal = self.arms[0], self.nominal
        texts = []
        for joint in STUDIED_JOINTS:
            cell, tried = self.best(joint), self._tests(joint)
            explained = sum(one.score <= EXPLAINS for one in tried)
            texts.append(
                f"{joint.replace('_', ' ').capitalize()} alone: {explained} of {len(tried)} cells explain it. Nearest "
                f"is {_common_text(cell)}, {_joint_text(cell)}; farthest off there: {_worst(cell)}."
            )
        as_good = [arm for arm in self.arms if arm.score <= best.score + 2.0 * float(np.hypot(arm.error, best.error))]
        explains = [joint.replace("_", " ") for joint in best.explains]
        texts.append(
            f"One arm for all three joints: the best explains {' and '.join(explains) or 'no joint'}, "
            f"{_arm_text(best)}. Of {len(self.arms)} arms {len(as_good)} are as good within two standard errors; "
            f"{sum(len(arm.explains) == 3 for arm in self.arms)} explain all joints."
        )
        texts.append(f"The nominal arm: {_arm_text(nominal)}.")
        pairs = [
            f"{cell.setting.joint.replace('_', ' ')} {_bandwidths(cell)} and {_bandwidths(other)}"
            for cell in nominal.cells
            for other in self.cells
            if other.excitation == "multisine" and (other.setting, factors(other)) == (cell.setting, factors(cell))
        ]
        if pairs:
            texts.append(
                "Bandwidths that ARMAX/OE/OKID recover there, from binary sequences and from multisines of 0.05 to 5 "
                f"Hz: {', '.join(pairs)} Hz."
            )
        worth = [
            f"{name} " + ", ".join(f"{level}: {score:.2f}" for level, score in levels.items())
            for name, levels in profile(self.arms).items()
            if len(levels) > 1
        ]
        if worth:
            texts.append(f"Score of the best arm where one factor is fixed: {'; '.join(worth)}.")
        return tuple(texts)

    def record(self) -> dict[str, Any]:
        """Return all that the campaign says, for JSON."""
        return {
            "answers": self.answers(),
            "decided": "2026-11-23, before results",
            "explains": EXPLAINS,
            "campaign": vars(self.campaign),
            "items": {joint: list(items(joint)) for joint in STUDIED_JOINTS},
            "best": {joint: _record(self.best(joint)) for joint in STUDIED_JOINTS},
            "arms": [_arm_record(arm) for arm in self.arms[:SHOWN]],
            "nominal": _arm_record(self.nominal),
            "profile": profile(self.arms),
            "failed": self.failed,
            "map": [cell.record() for cell in self.map_cells()],
        }

    def map_cells(self) -> list[Cell]:
        """Return the cells of the map: those of the best arm's servo and chain, over motion and friction."""
        fixed = {
            name: factors(self.arms[0].cells[0])[name] for name in ("servo", "presliding", "hold", "noise", "logged")
        }
        return [
            cell
            for joint in STUDIED_JOINTS
            for cell in self._tests(joint)
            if all(factors(cell)[name] == level for name, level in fixed.items())
        ]

    def write(self, folder: Path, text: str) -> list[Path]:
        """Write `motion.json` with a text, and a row for every cell as `motion.csv`; return the files."""
        result, table = folder / "motion.json", folder / "motion.csv"
        rows = [cell.record() for cell in self.cells]
        write_whole(result, text)
        write_whole(table, table_text(dict.fromkeys(name for row in rows for name in row), rows))
        return [result, table]


def _common_text(cell: Cell) -> str:
    setting = cell.setting
    return (
        f"servo {setting.servo}, {1000 * setting.gain:g} mrad/V, {cell.volts:g} V, presliding "
        f"{1000 * setting.presliding:g} mrad, hold {setting.hold}, noise {setting.noise:g} V, logged noise "
        f"{cell.logged:g}x"
    )


def _joint_text(cell: Cell) -> str:
    within = f"{cell.within} of {len(cell.distances)} items within tolerance"
    return f"friction {100 * cell.setting.friction:g} % (score {cell.score:.2f} ± {cell.spread:.2f}, {within})"


def _arm_text(arm: ArmScore) -> str:
    joints = (f"{one.setting.joint.replace('_', ' ')} {_joint_text(one)}" for one in arm.cells)
    return f"score {arm.score:.2f} ± {arm.error:.2f} with {_common_text(arm.cells[0])}; {', '.join(joints)}"


def _worst(cell: Cell) -> str:
    names = list(items(cell.setting.joint))
    order = np.argsort(cell.distances)[:-4:-1]
    return "; ".join(f"{names[k]} ({cell.distances[k]:.1f})" for k in order)


def _bandwidths(cell: Cell) -> str:
    values = (cell.medians.get(f"{method}_bandwidth_hz", np.nan) for method in METHODS)
    return "/".join(f"{value:.2f}" if np.isfinite(value) else "none" for value in values)


def _record(cell: Cell) -> dict[str, object]:
    return {**cell.record(), "distances": dict(zip(items(cell.setting.joint), cell.distances, strict=True))}


def _arm_record(arm: ArmScore) -> dict[str, object]:
    own = {name: factors(arm.cells[0])[name] for name in COMMON}
    joints = {cell.setting.joint: {"friction": cell.setting.friction, "score": cell.score} for cell in arm.cells}
    return {**own, "score": arm.score, "error": arm.error, "explains": arm.explains, "joints": joints}
