"""An estimator on the test bench: how to call it, what it declares about itself, and its limits."""

from dataclasses import dataclass

from scenarios.files.errors import ScenarioError
from sysid.polynomial.structures import STRUCTURES

METHODS = {
    "pem": "prediction error, all parameters of the structure free",
    "least_squares": "linear least squares on past inputs and outputs",
    "instrumental": "instrumental variables built from the input",
    "subspace": "subspace projection",
    "observer": "observer Markov parameters and a realisation",
}
"""Kinds of methods of which theory says what to expect."""

PERFECT = ":perfect"
"""Target of the perfect estimator, which nobody can give: no module has an empty name."""


@dataclass(frozen=True)
class Estimator:
    """An estimator and how to call it.

    Attributes:
        name: Label in tables and files.
        target: `module:function`, `path/to/file.py:function`, or the command line of a program.
        program: Whether `target` is a command line.
        stays: Of a program: it is started once and reads one request per line, instead of being started for each.
        structure: Its structure, one of `STRUCTURES`; None: it takes each that is asked.
        method: One of `METHODS`; None: not declared, and then every metric is expected to pass.
        version: Of the package that it comes from.
        settings: Its settings in words, where it has choices.
        home: Folder in which its module is looked for or its program runs; the working folder when empty.
    """

    name: str
    target: str
    program: bool = False
    stays: bool = False
    structure: str | None = None
    method: str | None = None
    version: str = ""
    settings: str = ""
    home: str = ""

    @property
    def is_perfect(self) -> bool:
        """Whether it is the bench's own, which runs in the bench's process, since no other process sees the truth."""
        return self.target == PERFECT and not self.program

    def __post_init__(self) -> None:
        if self.structure is not None and self.structure not in STRUCTURES:
            raise ScenarioError(f"structure {self.structure!r} given, expected one of {', '.join(STRUCTURES)}")
        if self.method is not None and self.method not in METHODS:
            raise ScenarioError(f"method {self.method!r} given, expected one of {', '.join(METHODS)}")
        if not self.name or not self.target:
            raise ScenarioError(f"name {self.name!r} and target {self.target!r} given, expected both")


@dataclass(frozen=True)
class Limits:
    """Limits of one answer.

    Attributes:
        seconds: Time until the answer, s.
        memory_bytes: Memory, bytes: of a function beyond what it holds once loaded, of a program all of it.
    """

    seconds: float = 30.0
    memory_bytes: int = 2 * 2**30

    def __post_init__(self) -> None:
        if not 0.0 < self.seconds < float("inf"):
            raise ScenarioError(f"a limit of {self.seconds:g} s given, expected a finite time above 0")
        if self.memory_bytes < 2**26:
            raise ScenarioError(f"a limit of {self.memory_bytes} bytes given, expected at least {2**26}")
