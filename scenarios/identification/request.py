"""An identification that can be repeated: as a command, as Python, or at once."""

import inspect
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from scenarios.identification.file_identification import FileIdentification, identify_files

_PARAMETERS = inspect.signature(identify_files).parameters.values()
DEFAULTS = {parameter.name: parameter.default for parameter in _PARAMETERS if parameter.kind is parameter.KEYWORD_ONLY}
DEFAULTS |= {"input": ("u",), "output": ("y",)}  # as the command line has them, which takes several names
"""Options of `identify_files`, in their sequence, with their values where they are not given."""


@dataclass(frozen=True)
class IdentificationRequest:
    """Files and options of one identification.

    Attributes:
        data: The files.
        options: Options of `identify_files`; those that are left at their defaults are dropped.
    """

    data: tuple[Path, ...]
    options: Mapping[str, Any]

    def __post_init__(self) -> None:
        options = {name: self.options.get(name, default) for name, default in DEFAULTS.items()}
        changed = {name: value for name, value in options.items() if value != DEFAULTS[name]}
        object.__setattr__(self, "options", changed)

    def run(self) -> FileIdentification:
        """Identify; raises what `identify_files` raises."""
        return identify_files(self.data, **self.options)

    @property
    def words(self) -> tuple[str, ...]:
        """The command."""
        words = ["hmtb", "identify", *map(str, self.data)]
        for name, value in self.options.items():
            words.append(f"--{name.replace('_', '-')}")
            if isinstance(value, tuple):
                words += map(str, value)
            elif value is not True:  # a flag has no value
                words.append(str(value))
        return tuple(words)

    @property
    def python(self) -> str:
        """The call of `identify_files`."""
        arguments = [f"[{', '.join(map(_literal, self.data))}]"]
        arguments += [f"{name}={_literal(value)}" for name, value in self.options.items()]
        return f"identify_files({', '.join(arguments)})"


def _literal(value: object) -> str:
    return f"Path({str(value)!r})" if isinstance(value, Path) else repr(value)
