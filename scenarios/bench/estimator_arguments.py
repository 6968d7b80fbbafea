"""Estimators as they are given on the command line."""

import re
import shlex
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from scenarios.bench.source import module_file
from scenarios.estimators.contestant import Contestant
from scenarios.estimators.known_estimators import contestant, names
from scenarios.files.errors import ScenarioError, unknown

FUNCTION = re.compile(r"[^\W\d]\w*(?:\.[^\W\d]\w*)*", re.ASCII)
"""A name as Python has it, of something inside a class too."""


@dataclass(frozen=True)
class Said:
    """What is said of an estimator that the bench does not know.

    Attributes:
        name: Label; from its target where empty.
        structure: See `Contestant`.
        method: See `Contestant`.
        stays: See `Contestant`.
    """

    name: str = ""
    structure: str | None = None
    method: str | None = None
    stays: bool = False

    def words(self) -> tuple[str, ...]:
        """As options of the command line."""
        pairs = (("--name", self.name), ("--structure", self.structure), ("--method", self.method))
        told = [word for option, value in pairs if value for word in (option, value)]
        return (*told, "--stays") if self.stays else tuple(told)


def estimators(given: Sequence[str], command: str | None, said: Said) -> dict[Contestant, str]:
    """Contestants, each with the words that give it.

    Args:
        given: `module:function`, `file.py:function`, or names of contestants that the bench knows.
        command: Command line of a program, or None.
        said: Of those that the bench does not know: structure and method of each, a name of the only one.

    Raises:
        ScenarioError: Nothing is given; or something is not found; or what is said belongs to none, a name to several.
    """
    if not given and command is None:
        raise ScenarioError(
            "no estimator given; expected MODULE:FUNCTION, FILE.py:FUNCTION, --command, or a name that hmtb verify "
            "--list tells"
        )
    own = sum(":" in text for text in given) + (command is not None)
    if said != Said() and not own:
        raise ScenarioError(
            f"{' '.join(said.words())} given without an estimator of your own; what the bench knows says it of itself"
        )
    if said.name and own > 1:
        raise ScenarioError(
            f"--name {said.name} given with {own} estimators of your own, expected one; functions have the names that "
            "their files give them"
        )
    if said.stays and command is None:
        raise ScenarioError("--stays given without --command; expected both: only programs are started")
    twice = [text for text, count in Counter(given).items() if count > 1]
    if twice:
        raise ScenarioError(f"estimators given twice: {', '.join(twice)}")
    found: dict[Contestant, str] = {}
    for text in given:
        if ":" in text:
            found[_function(text, said)] = shlex.join([text, *replace(said, stays=False).words()])
        else:
            found[_known(text)] = shlex.quote(text)
    if command is not None:
        found[_program(command, said)] = shlex.join(["--command", command, *said.words()])
    return found


def _known(name: str) -> Contestant:
    if name not in names():
        near = "; an estimator of your own is given as MODULE:FUNCTION or FILE.py:FUNCTION"
        raise ScenarioError(unknown("estimator", name, names(), listing="hmtb verify --list") + near)
    return contestant(name)


def _function(text: str, said: Said) -> Contestant:
    """A function of a module or of a file; its module is not imported here, but in its sandbox."""
    module, _, function = text.rpartition(":")
    if not FUNCTION.fullmatch(function):
        raise ScenarioError(f"{text!r} given, expected MODULE:FUNCTION or FILE.py:FUNCTION")
    home = ""
    if module.endswith(".py"):
        path = Path(module).expanduser()
        if not path.is_file():
            raise ScenarioError(f"{text!r} given, but there is no file {module!r}")
        if not FUNCTION.fullmatch(path.stem):
            raise ScenarioError(f"{module!r} given, expected a file whose name can be imported, such as my_module.py")
        # As a file, not as a module of its name: Python may have another one of that.
        home, module = "" if path.parent == Path() else str(path.parent), path.name
    elif not FUNCTION.fullmatch(module):
        raise ScenarioError(f"{text!r} given, expected MODULE:FUNCTION or FILE.py:FUNCTION")
    made = Contestant(
        said.name or function, f"{module}:{function}", structure=said.structure, method=said.method, home=home
    )
    if module_file(made) is None:
        raise ScenarioError(
            f"{text!r} given, but no module {module!r} is found in this folder or among the installed packages"
        )
    return made


def _program(command: str, said: Said) -> Contestant:
    try:
        words = shlex.split(command)
    except ValueError as error:
        raise ScenarioError(f"--command {command!r} given, which is no command line: {error}") from error
    if not words:
        raise ScenarioError("an empty --command given, expected a command line")
    name = said.name or next((Path(word).stem for word in words[1:] if Path(word).is_file()), Path(words[0]).name)
    return Contestant(name, command, program=True, stays=said.stays, structure=said.structure, method=said.method)
