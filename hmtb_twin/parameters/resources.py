"""Where the MJCF models lie, in an installed wheel and in a checkout alike."""

from importlib.resources import files
from pathlib import Path

from hmtb_twin.parameters.errors import TwinError


def models_directory() -> Path:
    """Return the folder that holds the model folders.

    In a wheel the models lie inside this package; in a checkout, and so in an editable install, they stand at the root
    of the repository beside it.

    Returns:
        The folder `models`.

    Raises:
        FileNotFoundError: Neither place holds models: the installation is incomplete.
    """
    package = Path(str(files("hmtb_twin")))
    places = (package / "models", package.parent / "models")
    for place in places:
        if place.is_dir():
            return place
    raise FileNotFoundError(
        f"no model folder found, expected one of {', '.join(map(str, places))}: "
        "the installation of hmtb-twin is incomplete"
    )


def model_file(name: str) -> Path:
    """Return the path of one model file.

    Args:
        name: Path below the folder `models`, with forward slashes, such as `hmtb/hmtb.xml`.

    Returns:
        The file's path; MuJoCo and Pinocchio both read it from there.

    Raises:
        TwinError: There is no such file; the message lists the files that exist.
    """
    models = models_directory()
    path = models / name
    if path.is_file():
        return path
    available = sorted(p.relative_to(models).as_posix() for p in models.rglob("*.xml"))
    raise TwinError(f"no model file {name!r}, available: {', '.join(available) or 'none'}")
