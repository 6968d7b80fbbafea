"""Versions of what a result was made with."""

import platform
from functools import cache
from hashlib import sha256
from importlib import resources
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

from hmtb_twin.resources import models_directory

PACKAGES = ("hmtb-twin", "mujoco", "numpy", "scipy", "control", "pin", "matplotlib", "xarray")
ROOMS = ("hmtb_twin", "sysid", "scenarios")
KINDS = (".py", ".toml", ".xml")


def versions() -> dict[str, str]:
    """Versions of Python and of every package that a result depends on."""
    found = {"python": platform.python_version(), "machine": platform.machine()}
    for name in PACKAGES:
        try:
            found[name] = version(name)
        except PackageNotFoundError:
            found[name] = "not installed as a package"
    return found


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
