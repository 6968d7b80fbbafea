"""Nothing outside the description of an arm names its joints: what works on the test bed works on every arm."""

import ast
import re
from pathlib import Path

import pytest

from hmtb_twin import JOINTS
from hmtb_twin.arm_files.known_arms import arm_named

ROOT = Path(__file__).parents[1]
PACKAGES = ("hmtb_twin", "scenarios", "sysid")

OF_THE_TEST_BED = {
    "hmtb_twin/arm/rigid_bodies.py": "bodies of its MJCF",
    "scenarios/experiments/model_structures.py": "structures that the thesis prints",
    "scenarios/truth/published.py": "models that the thesis prints",
    "scenarios/truth/maps.py": "its plane, over which the maps are drawn",
    "scenarios/identification/one_hertz.py": "the finding of the thesis",
    "scenarios/commands/bandwidth.py": "the finding of the thesis",
    "scenarios/bench/amplitude_split.py": "problems of the bench on its joints",
    "scenarios/problems/twin_best_linear.py": "problems of the bench on its joints",
    "scenarios/station/station.py": "its first test",
    "scenarios/commands/control.py": "its default scenarios",
}
"""Modules that are of the test bed, and why; the room of the thesis is all of it."""


def texts(path: Path) -> list[str]:
    """Texts in the code of a module, without its docstrings."""
    tree = ast.parse(path.read_text(encoding="utf-8"))
    documented = {id(node.value) for node in ast.walk(tree) if isinstance(node, ast.Expr)}
    found = []
    for node in ast.walk(tree):
        if isinstance(node, ast.Constant) and isinstance(node.value, str) and id(node) not in documented:
            found.append(node.value)
    return found


MODULES = [path for package in PACKAGES for path in sorted((ROOT / package).rglob("*.py"))]


def named(path: Path, joints: tuple[str, ...]) -> list[str]:
    """Texts of a module in which one of these joints is named."""
    pattern = re.compile(rf"(?<![a-z0-9])({'|'.join(map(re.escape, joints))})(?![a-z0-9])")
    return [text for text in texts(path) if pattern.search(text)]


def test_joints_of_the_test_bed_are_named_by_what_is_of_it_alone():
    # The wrist's first and last joints may have the names of other things.
    for path in MODULES:
        name = path.relative_to(ROOT).as_posix()
        if name not in OF_THE_TEST_BED and not name.startswith("scenarios/thesis/"):
            assert not named(path, JOINTS), f"{name} names joints of the test bed"


def test_what_is_said_to_be_of_the_test_bed_is_there():
    for name in OF_THE_TEST_BED:
        assert named(ROOT / name, JOINTS), f"{name} names no joint any more: take it off the list"


@pytest.mark.parametrize("arm", ["panda", "ur10", "kinova"])
def test_joints_of_other_arms_are_named_nowhere(arm):
    for path in MODULES:
        assert not named(path, arm_named(arm).joints), path
