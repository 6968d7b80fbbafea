"""Versions of what a result was made with."""

import platform
from importlib.metadata import PackageNotFoundError, version

PACKAGES = ("hmtb-twin", "mujoco", "numpy", "scipy", "control", "pin", "matplotlib", "xarray")


def versions() -> dict[str, str]:
    """Versions of Python and of every package that a result depends on."""
    found = {"python": platform.python_version(), "machine": platform.machine()}
    for name in PACKAGES:
        try:
            found[name] = version(name)
        except PackageNotFoundError:
            found[name] = "not installed as a package"
    return found
