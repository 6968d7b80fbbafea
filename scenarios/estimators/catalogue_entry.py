"""A contestant and what it needs to run."""

import shlex
import shutil
import subprocess
from dataclasses import dataclass, replace
from functools import lru_cache
from importlib.metadata import PackageNotFoundError, version
from importlib.util import find_spec

from scenarios.estimators.contestant import Contestant

OURS = "hmtb-twin"
PATIENCE = 60.0
"""How long Octave may take to tell its versions, s."""


@dataclass(frozen=True)
class Entry:
    """A contestant of the registry.

    Attributes:
        contestant: The contestant; its version is filled in when it is asked for.
        package: Python distribution that it comes from.
        module: To import from it; empty for what comes with this package.
        octave: Package of Octave that it needs instead; empty for none.
        install: Command that installs what it needs.
    """

    contestant: Contestant
    package: str = OURS
    module: str = ""
    octave: str = ""
    install: str = ""

    def available(self) -> tuple[bool, str]:
        """Whether it can be run here; where not, what is missing and how to get it."""
        if self.module and find_spec(self.module) is None:
            return False, f"{self.contestant.name} needs the package {self.package}: {self.install}"
        if self.octave and not octave_version(self._program, self.octave):
            needs = f"the program {self._program} with its package {self.octave}"
            return False, f"{self.contestant.name} needs {needs}: {self.install}"
        return True, ""

    def versioned(self) -> Contestant:
        """The contestant with the version of what it comes from."""
        told = octave_version(self._program, self.octave) if self.octave else _version(self.package)
        return replace(self.contestant, version=told)

    @property
    def _program(self) -> str:
        return shlex.split(self.contestant.target)[0]


@lru_cache(maxsize=8)
def octave_version(program: str, package: str) -> str:
    """Versions of Octave and of one of its packages; empty where one of them is not there.

    Args:
        program: Octave's.
        package: The package.
    """
    path = shutil.which(program)
    if path is None:
        return ""
    asks = (
        f"p = pkg ('list', '{package}'); printf ('%s', version ()); if numel (p), printf (' %s', p{{1}}.version); end"
    )
    try:
        told = subprocess.run(
            [path, "--quiet", "--norc", "--eval", asks], capture_output=True, text=True, timeout=PATIENCE, check=False
        ).stdout.split()
    except (OSError, subprocess.TimeoutExpired):
        return ""
    return f"octave {told[0]}, {package} {told[1]}" if len(told) == 2 else ""


def _version(package: str) -> str:
    try:
        return f"{package} {version(package)}"
    except PackageNotFoundError:
        # a checkout on the path
        return ""
