"""Packages that the code imports are those that the project files declare, and the other way round."""

import ast
import re
import sys
import tomllib
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
OURS = {"hmtb_twin", "sysid", "scenarios"}

DISTRIBUTIONS = {"PIL": "pillow", "pinocchio": "pin", "chapter10": "pychapter10", "sippy_unipi": "sippy-unipi"}
"""Names on PyPI of modules that are called otherwise; `_` and `-` are the same there."""

NOT_IMPORTED = {"example-robot-data", "h5netcdf"}
"""Required for its files, and as the engine that users of xarray name."""

DEVELOPMENT = {"dev", "docs", "notebooks", "peers", "test"}
"""Extras with tools beside what the code imports."""


def project(file: str) -> dict:
    return tomllib.loads((ROOT / file).read_text(encoding="utf-8"))["project"]


def distribution(requirement: str) -> str:
    """Name of a requirement without its versions and extras."""
    return re.match(r"[\w.-]+", requirement)[0].lower().replace("_", "-")


def declared(file: str, *, development: bool) -> set[str]:
    """Distributions that a project file requires, in its extras too."""
    settings = project(file)
    requirements = list(settings["dependencies"])
    for extra, packages in settings["optional-dependencies"].items():
        if development or extra not in DEVELOPMENT:
            requirements += packages
    return {distribution(requirement) for requirement in requirements} - {settings["name"]}


def imported(*packages: str) -> set[str]:
    """Distributions whose modules the files of packages import, inside functions too."""
    modules = set()
    for path in (path for package in packages for path in (ROOT / package).rglob("*.py")):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.Import):
                modules |= {alias.name.partition(".")[0] for alias in node.names}
            elif isinstance(node, ast.ImportFrom) and not node.level:
                modules.add(node.module.partition(".")[0])
    foreign = modules - set(sys.stdlib_module_names) - OURS
    return {DISTRIBUTIONS.get(module, module).lower().replace("_", "-") for module in foreign}


@pytest.mark.slow
def test_everything_that_is_imported_is_declared():
    assert not imported(*OURS) - declared("pyproject.toml", development=True)


@pytest.mark.slow
def test_everything_that_is_declared_is_imported():
    assert declared("pyproject.toml", development=False) - imported(*OURS) == NOT_IMPORTED


@pytest.mark.slow
def test_sysid_alone_declares_what_it_imports():
    assert imported("sysid") == declared("sysid/pyproject.toml", development=False)


def test_versions_are_those_of_the_whole():
    """Both project files ask for the same versions of the same packages."""
    whole, alone = project("pyproject.toml"), project("sysid/pyproject.toml")
    assert alone["version"] == whole["version"]
    assert alone["requires-python"] == whole["requires-python"]
    stated = {
        *whole["dependencies"],
        *(entry for extra in whole["optional-dependencies"].values() for entry in extra),
    }
    required = {
        *alone["dependencies"],
        *(entry for extra in alone["optional-dependencies"].values() for entry in extra),
    }
    assert required <= stated
