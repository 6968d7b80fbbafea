"""Files of models: written whole or not at all, named by identifiers, marked with the software that wrote them."""

import re
import secrets
from pathlib import Path

import numpy as np

from sysid.models.estimate import Estimate
from sysid.models.model_forms import as_model, chosen_model
from sysid.models.state_space import StateSpace
from sysid.records.arguments import file_path
from sysid.records.arrays import FloatArray
from sysid.records.errors import SysidError

PACKAGE = "hmtb-twin"
LONGEST_IDENTIFIER = 63  # characters, MATLAB's limit
KEYWORDS = (
    "break|case|catch|classdef|continue|else|elseif|end|for|function|global|if|otherwise|parfor|persistent|return|spmd|"
    "switch|try|while"
)


def software() -> str:
    """Package and version that write a file."""
    from importlib.metadata import PackageNotFoundError, version

    try:
        return f"{PACKAGE} {version(PACKAGE)}"
    except PackageNotFoundError:
        return f"{PACKAGE}, not installed"


def write_whole(path: Path, content: bytes) -> None:
    """Write a file under a temporary name and rename it: readers find the old file or the new one, never a part.

    Raises:
        SysidError: There is a folder of that name, or none to write into.
        OSError: The file cannot be written; the old one stays.
    """
    if path.is_dir():
        raise SysidError(f"cannot write {path}: it is a folder; expected a file or nothing there")
    if not path.parent.is_dir():
        raise SysidError(f"cannot write {path}: there is no folder {path.parent}")
    partial = path.with_name(f"{path.name[:200]}.{secrets.token_hex(4)}.partial")
    try:
        # a new file, never through a link that somebody has put here
        with partial.open("xb") as stream:
            stream.write(content)
        partial.replace(path)
    except FileNotFoundError as error:
        # a working folder that was deleted still looks like a folder, but takes no files
        raise SysidError(f"cannot write {path}: its folder no longer exists") from error
    finally:
        partial.unlink(missing_ok=True)


def named_path(path: str | Path, ending: str) -> Path:
    """Check that the name of a file is an identifier of C and MATLAB with the expected ending.

    Raises:
        SysidError: Another ending or name.
    """
    file = file_path(path)
    name = file.stem
    if file.suffix != ending:
        raise SysidError(f"cannot write {file.name}: expected a name that ends with {ending}")
    if not re.fullmatch(rf"(?!(?:{KEYWORDS})$)[A-Za-z]\w{{0,{LONGEST_IDENTIFIER - 1}}}", name, re.ASCII):
        raise SysidError(
            f"cannot write {file.name}: the file's name names functions too; expected a letter, then at most "
            f"{LONGEST_IDENTIFIER - 1} letters, digits and underscores, as in servo{ending}"
        )
    return file


def operating_point(model: StateSpace | Estimate) -> tuple[FloatArray, FloatArray]:
    """Inputs (nu,) and outputs (ny,) that the signals of a model are relative to; zero where it knows none."""
    model = chosen_model(model)
    if isinstance(model, Estimate) and model.operating_point is not None:
        return model.operating_point
    return np.zeros(as_model(model).nu), np.zeros(as_model(model).ny)


def heading(model: StateSpace | Estimate) -> str:
    """One line on a model and its origin, in ASCII, for comments in source code."""
    model = chosen_model(model)
    if isinstance(model, Estimate):
        described = repr(model).removeprefix("<Estimate: ").removesuffix(">")
    else:
        described = f"state space of order {as_model(model).order}, every {model.dt:g} s"
    return comment(f"{described}; written by {software()}")


def comment(text: str) -> str:
    """Text that ends no comment and no line."""
    hidden = {ord(character): " " for character in text if not character.isprintable()}
    line = text.translate(hidden).replace("*/", "* /").replace("/*", "/ *")
    # A backslash at the end of a line would continue a comment of C.
    return line.encode("ascii", "backslashreplace").decode().replace("\\", "|")
