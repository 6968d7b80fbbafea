"""Estimators that the test bench knows by name: ours, a second implementation, and other packages at their best."""

import shlex
import shutil
import subprocess
from dataclasses import dataclass, replace
from functools import lru_cache
from importlib.metadata import PackageNotFoundError, version
from importlib.util import find_spec
from pathlib import Path
from types import MappingProxyType

from scenarios.estimators.estimator import Estimator
from scenarios.estimators.referee import REFEREE
from scenarios.files.errors import ScenarioError, unknown

OCTAVE = Path(__file__).parent / "octave"
INSTALL = "pip install 'hmtb-twin[peers]'"
INSTALL_OCTAVE = "apt-get install octave octave-control"

OCTAVE_SECONDS = 60.0
"""Time that Octave has to print its versions, s."""


@dataclass(frozen=True)
class KnownEstimator:
    """An estimator and what it needs to run.

    Attributes:
        estimator: The estimator; its version is filled in when it is asked for.
        package: Python distribution that it comes from.
        module: To import from it; empty for what comes with this package.
        octave: Package of Octave that it needs instead; empty for none.
        install: Command that installs what it needs.
    """

    estimator: Estimator
    package: str = "hmtb-twin"
    module: str = ""
    octave: str = ""
    install: str = ""

    def available(self) -> tuple[bool, str]:
        """Whether it can be run here; where not, what is missing and how to get it."""
        needs = ""
        if self.module and find_spec(self.module) is None:
            needs = f"the package {self.package}"
        elif self.octave and not octave_version(self._program, self.octave):
            needs = f"the program {self._program} with its package {self.octave}"
        return not needs, needs and f"{self.estimator.name} needs {needs}: {self.install}"

    def versioned(self) -> Estimator:
        """The estimator with the version of the package that it comes from."""
        if self.octave:
            return replace(self.estimator, version=octave_version(self._program, self.octave))
        try:
            return replace(self.estimator, version=f"{self.package} {version(self.package)}")
        except PackageNotFoundError:  # a checkout on the path
            return self.estimator

    @property
    def _program(self) -> str:
        return shlex.split(self.estimator.target)[0]


@lru_cache(maxsize=8)
def octave_version(program: str, package: str) -> str:
    """Versions of Octave and of one of its packages; empty where one of them is missing.

    Args:
        program: Octave's.
        package: The package.
    """
    path = shutil.which(program)
    if path is None:
        return ""
    code = (
        f"p = pkg ('list', '{package}'); printf ('%s', version ()); if numel (p), printf (' %s', p{{1}}.version); end"
    )
    command = [path, "--quiet", "--norc", "--eval", code]
    try:
        versions = subprocess.run(
            command, capture_output=True, text=True, timeout=OCTAVE_SECONDS, check=False
        ).stdout.split()
    except (OSError, subprocess.TimeoutExpired):
        return ""
    return f"octave {versions[0]}, {package} {versions[1]}" if len(versions) == 2 else ""


def _ours(name: str, structure: str | None, method: str, settings: str) -> KnownEstimator:
    target = f"scenarios.estimators.ours:{name}"
    label = f"our-{name.replace('_', '-')}"
    return KnownEstimator(Estimator(label, target, structure=structure, method=method, settings=settings))


def _peer(
    label: str, structure: str, method: str | None, settings: str, *, package: str, module: str = ""
) -> KnownEstimator:
    """A function of one of the peers' files, named as its label; a state space where it has no polynomials."""
    file = "state_space_peers" if structure == "ss" or module == "jax_sysid" else "polynomial_peers"
    target = f"scenarios.estimators.{file}:{label.replace('-', '_')}"
    estimator = Estimator(label, target, structure=structure, method=method, settings=settings)
    return KnownEstimator(estimator, package=package, module=module or package, install=INSTALL)


def _octave(function: str, structure: str, method: str, settings: str) -> KnownEstimator:
    """A function of the folder `octave`, which needs a package of Octave's."""
    estimator = Estimator(
        f"octave-{function}",
        f"octave-cli --quiet --norc main.m {function} {{mat}} {{task}} {{model}}",
        program=True,
        stays=True,
        structure=structure,
        method=method,
        settings=settings,
        home=str(OCTAVE),
    )
    return KnownEstimator(estimator, octave="control", install=INSTALL_OCTAVE)


_BIC = "orders, where they are open, by the least BIC"
_ONE_DEGREE = f"initial state estimated; {_BIC}, one degree for all"
_FILTERED = "search from ARX; anew with filtered data where the predictor is not stable, as its warning advises"
_IPOPT = "optimisation by IPOPT (OPT), 200 iterations, no constraint of stability"
_ROWS = "block rows 20, or twice the order where that is more"
_GAP = "orders, where they are open, at the largest gap of singular values"
_CHOLESKY = f"{_ROWS}; factor by Cholesky"
_SIPPY = {"package": "sippy-unipi", "module": "sippy_unipi"}
_PERFECT = "the truth and an error of the best covariance"

_ALL = (
    _ours("arx", "arx", "least_squares", f"{_BIC} of all structures (selstruc)"),
    _ours("armax", "armax", "pem", _ONE_DEGREE),
    _ours("oe", "oe", "pem", _ONE_DEGREE),
    _ours("bj", "bj", "pem", _ONE_DEGREE),
    _ours("iv4", "arx", "instrumental", f"{_BIC} of the simulated output; no model of the noise claimed"),
    _ours(
        "okid",
        "ss",
        "observer",
        "p = 20 observer Markov parameters and two more per state, five equations for each unknown at least; realised "
        f"by ERA; D = 0; {_BIC}",
    ),
    _ours("era", "ss", "observer", "200 values of the pulse response by least squares on past inputs; D = 0"),
    _ours("n4sid", "ss", "subspace", f"2.5 block rows per state, at least 10; D = 0; no covariance claimed; {_BIC}"),
    _ours("pem_ss", "ss", "pem", f"from n4sid; D = 0; {_BIC}"),
    _ours("pem", None, "pem", f"arx, armax, oe, bj or pem_ss, whichever is asked; {_BIC}"),
    KnownEstimator(REFEREE),
    KnownEstimator(Estimator("perfect", "bench:perfect", method="pem", settings=_PERFECT)),
    _peer("pysib-arx", "arx", "least_squares", "as it comes", package="pysib"),
    _peer("pysib-armax", "armax", "pem", _FILTERED, package="pysib"),
    _peer("pysib-oe", "oe", "pem", _FILTERED, package="pysib"),
    _peer("pysib-bj", "bj", "pem", _FILTERED, package="pysib"),
    _peer("sippy-arx", "arx", "least_squares", "linear least squares (LLS)", **_SIPPY),
    _peer("sippy-armax", "armax", "pem", _IPOPT, **_SIPPY),
    _peer("sippy-oe", "oe", "pem", _IPOPT, **_SIPPY),
    _peer("sippy-bj", "bj", "pem", _IPOPT, **_SIPPY),
    _peer("sippy-n4sid", "ss", "subspace", f"{_ROWS}; D = 0; orders, where they are open, by its BIC", **_SIPPY),
    _peer(
        "control-era",
        "ss",
        "observer",
        "markov of 200 values, truncate=True; eigensys_realization, its Hankel matrix of all",
        package="control",
    ),
    _peer("slicot-moen4", "ss", "subspace", f"{_CHOLESKY}; {_GAP}; no gain", package="ctrlsys"),
    _peer("slicot-n4sid", "ss", "subspace", f"{_CHOLESKY}; {_GAP}; no gain", package="ctrlsys"),
    _peer("slicot-moesp", "ss", "subspace", f"{_CHOLESKY}, B and D the MOESP way; {_GAP}; no gain", package="ctrlsys"),
    _peer("nfoursid-n4sid", "ss", "subspace", f"{_ROWS}; Kalman gain from its covariances", package="nfoursid"),
    _peer(
        "jax-sysid-oe",
        "oe",
        "pem",
        "64 bits, channels scaled to one, no penalties, x0 fitted; 1000 steps of Adam, 2000 of L-BFGS",
        package="jax-sysid",
        module="jax_sysid",
    ),
    _peer(
        "sysidentpy-arx",
        "arx",
        "least_squares",
        "FROLS with LeastSquares, degree 1; terms, where orders are open, by BIC",
        package="sysidentpy",
    ),
    _peer(
        "sysidentpy-armax",
        "armax",
        None,
        "FROLS with LeastSquares(unbiased=True): extended least squares of 60 rounds, degree 1",
        package="sysidentpy",
    ),
    _octave("arx", "arx", "least_squares", "as it comes"),
    _octave("moen4", "ss", "subspace", f"{_ROWS}; {_GAP}; gain from its covariances"),
)

KNOWN = MappingProxyType({entry.estimator.name: entry for entry in _ALL})
"""Known estimators by name, also those whose packages are not installed."""


def available(name: str) -> tuple[bool, str]:
    """Whether an estimator can be run here.

    Args:
        name: One of `KNOWN`.

    Returns:
        The answer, and where it is no, what is missing and how to get it.

    Raises:
        ScenarioError: No estimator has the name.
    """
    return _known(name).available()


def estimator(name: str) -> Estimator:
    """The estimator of a name, with the version of its package as it is installed.

    Args:
        name: One of `KNOWN`.

    Raises:
        ScenarioError: No estimator has the name, or what it needs is not installed.
    """
    entry = _known(name)
    can_run, why = entry.available()
    if not can_run:
        raise ScenarioError(why)
    return entry.versioned()


def _known(name: str) -> KnownEstimator:
    if name not in KNOWN:
        raise ScenarioError(unknown("estimator", name, KNOWN))
    return KNOWN[name]


ENTRIES = KNOWN
contestant = estimator


def names() -> tuple[str, ...]:
    """Names of all known estimators."""
    return tuple(KNOWN)
