"""A contestant and what it needs to run."""

import shutil
from dataclasses import dataclass, replace
from importlib.metadata import PackageNotFoundError, version
from importlib.util import find_spec

from scenarios.bench_contract.contestant import Contestant

OURS = "hmtb-twin"


@dataclass(frozen=True)
class Entry:
    """A contestant of the registry.

    Attributes:
        contestant: The contestant; its version is filled in when it is asked for.
        package: Distribution that it comes from.
        module: To import from it; empty for what comes with this package.
        program: Program that it needs on the path; empty for none.
        install: Command that installs what it needs.
    """

    contestant: Contestant
    package: str = OURS
    module: str = ""
    program: str = ""
    install: str = ""

    def available(self) -> tuple[bool, str]:
        """Whether it can be run here; where not, what is missing and how to get it."""
        if self.module and find_spec(self.module) is None:
            return False, f"{self.contestant.name} needs the package {self.package}: {self.install}"
        if self.program and shutil.which(self.program) is None:
            return False, f"{self.contestant.name} needs the program {self.program}: {self.install}"
        return True, ""

    def versioned(self) -> Contestant:
        """The contestant with the version of its package."""
        return replace(self.contestant, version=self.contestant.version or _version(self.package))


def _version(package: str) -> str:
    try:
        return f"{package} {version(package)}"
    except PackageNotFoundError:
        # a checkout on the path
        return ""
