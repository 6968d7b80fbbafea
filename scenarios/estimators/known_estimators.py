"""Estimators that the test bench knows by name: the toolbox's methods, and those of `known_estimators.toml`."""

import shlex
import subprocess
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import lru_cache
from importlib.metadata import PackageNotFoundError, version
from importlib.util import find_spec
from pathlib import Path
from types import MappingProxyType

from scenarios.estimators.estimator import Estimator
from scenarios.files.errors import ScenarioError, unknown
from scenarios.files.toml_file import read_toml
from scenarios.identification.methods import BENCH_ENTRIES

OCTAVE = Path(__file__).parent / "octave"

OCTAVE_SECONDS = 60.0
"""Time that Octave has to print its versions, s."""


@dataclass(frozen=True)
class KnownEstimator:
    """An estimator and what it needs to run.

    Attributes:
        estimator: The estimator, without the version of its package.
        package: Python distribution that it comes from; its module has the same name, with underscores.
        octave: Package of Octave that it needs instead; empty for none.
    """

    estimator: Estimator
    package: str = "hmtb-twin"
    octave: str = ""

    def missing(self) -> str:
        """What it needs that is not installed here, and how to get it; empty where it can be run."""
        name, program = self.estimator.name, shlex.split(self.estimator.target)[0]
        if find_spec(self.package.replace("-", "_")) is None:
            return f"{name} needs the package {self.package}: pip install 'hmtb-twin[peers]'"
        if self.octave and not octave_version(program, self.octave):
            command = f"apt-get install octave octave-{self.octave}"
            return f"{name} needs the program {program} with its package {self.octave}: {command}"
        return ""

    def versioned(self) -> Estimator:
        """The estimator with the version of the package that it comes from."""
        if self.octave:
            return replace(self.estimator, version=octave_version(shlex.split(self.estimator.target)[0], self.octave))
        with suppress(PackageNotFoundError):  # a checkout on the path
            return replace(self.estimator, version=f"{self.package} {version(self.package)}")
        return self.estimator


@lru_cache(maxsize=8)
def octave_version(program: str, package: str) -> str:
    """Versions of the program Octave and of one of its packages; empty where one of them is missing."""
    code = (
        f"p = pkg ('list', '{package}'); printf ('%s', version ()); if numel (p), printf (' %s', p{{1}}.version); end"
    )
    command = [program, "--quiet", "--norc", "--eval", code]
    try:
        done = subprocess.run(command, capture_output=True, text=True, timeout=OCTAVE_SECONDS, check=False)
    except (OSError, subprocess.TimeoutExpired):
        return ""
    versions = done.stdout.split()
    return f"octave {versions[0]}, {package} {versions[1]}" if len(versions) == 2 else ""


def estimator(name: str) -> Estimator:
    """The estimator of a name, with the version of its package as it is installed.

    Args:
        name: One of `KNOWN`.

    Raises:
        ScenarioError: No estimator has the name, or what it needs is not installed.
    """
    if name not in KNOWN:
        raise ScenarioError(unknown("estimator", name, KNOWN))
    if missing := KNOWN[name].missing():
        raise ScenarioError(missing)
    return KNOWN[name].versioned()


def _ours() -> dict[str, KnownEstimator]:
    """The methods of identification that have an entry for the bench."""
    estimators = {}
    for method_name, entry in BENCH_ENTRIES.items():
        name, target = f"our-{method_name.replace('_', '-')}", f"scenarios.estimators.ours:{method_name}"
        declared = Estimator(name, target, structure=entry.structure, method=entry.method, settings=entry.settings)
        estimators[name] = KnownEstimator(declared)
    return estimators


def _read() -> dict[str, KnownEstimator]:
    estimators = {}
    path = Path(__file__).with_suffix(".toml")
    for name, table in read_toml(path.read_text(encoding="utf-8"), path.name).items():
        needs = {key: table.pop(key) for key in ("package", "octave") if key in table}
        if "octave" in needs:
            # `serve.m` there reads requests until its input ends.
            table |= {"program": True, "stays": True, "home": str(OCTAVE)}
        estimators[name] = KnownEstimator(Estimator(name, **table), **needs)
    return estimators


KNOWN = MappingProxyType(_ours() | _read())
"""Known estimators by name, also those whose packages are not installed."""
