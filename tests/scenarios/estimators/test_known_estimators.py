import importlib
from pathlib import Path

import pytest

from scenarios.estimators import known_estimators
from scenarios.estimators.known_estimators import KNOWN, OCTAVE, KnownEstimator, available, estimator
from scenarios.files.errors import ScenarioError


def test_an_unknown_name_is_answered_with_a_similar_one() -> None:
    with pytest.raises(ScenarioError, match=r"unknown estimator 'our-arma': did you mean 'our-arma?x?'"):
        estimator("our-arma")


def test_missing_packages_come_with_the_command_that_installs_them(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(known_estimators, "find_spec", lambda name: None)
    monkeypatch.setattr(known_estimators.shutil, "which", lambda name: None)
    known_estimators.octave_version.cache_clear()
    with pytest.raises(ScenarioError, match=r"pysib-oe needs the package pysib: pip install 'hmtb-twin\[peers\]'"):
        estimator("pysib-oe")
    octave = "octave-arx needs the program octave-cli with its package control: apt-get install octave octave-control"
    assert available("octave-arx") == (False, octave)
    assert available("our-oe") == (True, "")
    known_estimators.octave_version.cache_clear()


def test_the_version_is_that_of_the_package() -> None:
    assert estimator("control-era").version == f"control {importlib.metadata.version('control')}"


@pytest.mark.parametrize("known", KNOWN.values(), ids=KNOWN)
def test_every_target_exists(known: KnownEstimator) -> None:
    """Adapters import their packages only when they are called, so that all of them can be loaded here."""
    one = known.estimator
    assert one.settings
    if known.octave:
        assert (Path(OCTAVE) / f"estimate_{one.target.split()[4]}.m").is_file()
    elif one.name != "perfect":
        module, _, function = one.target.partition(":")
        assert callable(getattr(importlib.import_module(module), function))
