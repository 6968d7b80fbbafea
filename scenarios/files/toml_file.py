"""Tables from TOML, of users and of the package."""

from importlib.resources import files
from typing import Any

from hmtb_twin.files.errors import TwinError
from hmtb_twin.files.toml_text import toml_table
from scenarios.files.errors import ScenarioError


def read_toml(text: str, source: str) -> dict[str, Any]:
    """Parse TOML; see `toml_table`.

    Raises:
        ScenarioError: It is no TOML, nested too deeply, or has whole numbers of more than 63 bits.
    """
    try:
        return toml_table(text, source)
    except TwinError as error:
        raise ScenarioError(str(error)) from error


def package_table(name: str) -> dict[str, Any]:
    """Read a table that comes with the package, such as ``criteria.toml``."""
    return read_toml(files("scenarios").joinpath("data", name).read_text(encoding="utf-8"), name)
