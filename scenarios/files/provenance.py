"""Versions of the software that computes a result, and a hash of our own source."""

import platform
from functools import cache
from hashlib import sha256
from importlib import resources
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

from hmtb_twin.parameters.resources import models_directory
from scenarios.files.errors import ScenarioError
from scenarios.files.toml_file import read_toml

OURS = "hmtb-twin"
PACKAGES = (OURS, "mujoco", "numpy", "scipy", "control", "pin", "matplotlib", "xarray")
ROOMS = ("hmtb_twin", "sysid", "scenarios")
KINDS = (".py", ".toml", ".xml")


# Reading the metadata of a package takes a millisecond.
_installed = cache(version)


def versions() -> dict[str, str]:
    """Versions of Python and of every package that a result depends on."""
    installed = {"python": platform.python_version(), "machine": platform.machine()}
    for name in PACKAGES:
        try:
            installed[name] = _installed(name)
        except PackageNotFoundError:
            installed[name] = _of_source() if name == OURS else "not installed as a package"
    return installed


def _of_source() -> str:
    """Version of this package in `pyproject.toml`, for source that runs without being installed."""
    project = Path(str(resources.files("hmtb_twin"))).parent / "pyproject.toml"
    try:
        release = read_toml(project.read_text(encoding="utf-8"), project.name)["project"]["version"]
    except (OSError, ScenarioError, KeyError):
        return "not installed as a package"
    return f"{release} from source"


@cache
def fingerprint() -> str:
    """Hash of everything of ours that a result depends on: source text, experiments and models."""
    digest = sha256()
    for room in (*(Path(str(resources.files(name))) for name in ROOMS), models_directory()):
        for path in sorted(room.rglob("*")):
            if path.suffix in KINDS:
                digest.update(f"{room.name}/{path.relative_to(room).as_posix()}\0".encode())
                digest.update(path.read_bytes())
    return digest.hexdigest()
