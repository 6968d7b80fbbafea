"""Paths of the MJCF models, in an installed wheel and in a checkout."""

from importlib.resources import files
from pathlib import Path

from hmtb_twin.files.errors import TwinError


def models_directory() -> Path:
    """Return the folder `models`: inside this package in a wheel, at the root of the repository in a checkout.

    Raises:
        FileNotFoundError: Neither place holds models: the installation is incomplete.
    """
    package = Path(str(files("hmtb_twin")))
    # The wheel's own folder first: beside an installed package there may be a foreign folder of this name.
    candidates = (package / "models", package.parent / "models")
    for folder in candidates:
        if folder.is_dir():
            return folder
    raise FileNotFoundError(
        f"no model folder found, expected one of {', '.join(map(str, candidates))}: "
        "the installation of hmtb-twin is incomplete"
    )


def model_file(name: str) -> Path:
    """Return the path of a model file, named below the folder `models` with forward slashes, as in `hmtb/hmtb.xml`.

    Raises:
        TwinError: There is no such file; the message lists the files that exist.
    """
    models = models_directory()
    path = models / name
    if path.is_file():
        return path
    available = sorted(file.relative_to(models).as_posix() for file in models.rglob("*.xml"))
    raise TwinError(f"no model file {name!r}, available: {', '.join(available) or 'none'}")
