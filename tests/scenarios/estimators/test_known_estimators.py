"""Estimators known by name, ours and those of installed packages: right without noise, near the bound with it."""

import importlib
from pathlib import Path

import numpy as np
import pytest

from scenarios.estimators import known_estimators
from scenarios.estimators.estimator import Limits
from scenarios.estimators.known_estimators import KNOWN, OCTAVE, estimator
from scenarios.estimators.outcome import MODEL, REFUSED
from scenarios.estimators.python_child import load
from scenarios.estimators.runner import EstimatorProcess
from scenarios.problems.registry import problem
from tests.refusals import refused

QUIET, NOISY = "quiet-2-2@800", "p3@800"
INSTALLED = [known.estimator for known in KNOWN.values() if not known.missing()]
PYTHON = [one for one in INSTALLED if not one.program and one.name != "perfect"]

DIGITS = {f"pysib-{structure}": 3 for structure in ("armax", "oe", "bj")}
DIGITS |= {f"sippy-{structure}": 6 for structure in ("armax", "oe", "bj")} | {"jax-sysid-oe": 5}
"""Of a record without noise; searches stop when they have come near. The others have ten at least."""

WRONG = {"slicot-moesp", "slicot-n4sid"}
"""Without noise they find something else; see their docstrings."""

FACTOR = 12.0
"""Error of a consistent method in an open loop, on a short record, at most, as a multiple of the bound."""


def response_error(answer, name):
    of = problem(name)
    return answer.model.frequency_response(of.frequencies) - of.truth.frequency_response(of.frequencies)


def called(one, name, ask="fit"):
    return load(one.target, OCTAVE)(problem(name).draw(1), problem(name).task(one.structure, ask))


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore::sysid.SysidWarning")
@pytest.mark.parametrize("one", PYTHON, ids=lambda one: one.name)
def test_quiet_record_is_recovered(one):
    truth = problem(QUIET).truth.frequency_response(problem(QUIET).frequencies)
    error = np.linalg.norm(response_error(called(one, QUIET), QUIET)) / np.linalg.norm(truth)
    assert (error < 10.0 ** -DIGITS.get(one.name, 10)) == (one.name not in WRONG)


@pytest.mark.slow
@pytest.mark.parametrize("one", PYTHON, ids=lambda one: one.name)
def test_noisy_record_is_near_the_bound(one):
    bound = problem(NOISY).bound(None)
    scale = (bound.response_directions**2).sum(axis=(0, -1))
    ratio = np.mean(np.abs(response_error(called(one, NOISY), NOISY)) ** 2 / scale)
    assert (ratio < FACTOR) == (one.method != "least_squares" and one.name != "slicot-moesp")


@pytest.mark.parametrize("one", [one for one in PYTHON if one.structure], ids=lambda one: one.name)
def test_other_structures_are_refused(one):
    other = "ss" if one.structure != "ss" else "arx"
    task = problem(NOISY).task(other)
    with pytest.raises(NotImplementedError, match=f"structure '{other}' asked for"):
        load(one.target, OCTAVE)(problem(NOISY).draw(1), task)


@pytest.mark.parametrize("name", ["slicot-moen4", "sippy-n4sid"])
def test_orders_are_found(name):
    if missing := KNOWN[name].missing():
        pytest.skip(missing)
    assert called(estimator(name), "p3", "select").model.order == 2


@pytest.fixture(scope="module", params=["octave-arx", "octave-moen4"])
def octave(request):
    """What a program that stays answers: a record without noise, one with, one whose structure it has not."""
    if missing := KNOWN[request.param].missing():
        pytest.skip(missing)
    one = estimator(request.param)
    with EstimatorProcess(one, Limits()) as process:
        outcomes = [process.ask(problem(name).draw(1), problem(name).task(one.structure)) for name in (QUIET, NOISY)]
        other = problem(NOISY).task("ss" if one.structure != "ss" else "arx")
        return [*outcomes, process.ask(problem(NOISY).draw(1), other)]


def test_octave_answers(octave):
    quiet, noisy, refused = octave
    assert [one.kind for one in octave] == [MODEL, MODEL, REFUSED], [one.why for one in octave]
    assert np.abs(response_error(quiet.answer, QUIET)).max() < 1e-9
    assert noisy.answer.model.gain.any()
    assert refused.why.startswith("structure")


def test_an_unknown_name_is_answered_with_a_similar_one():
    refused(r"unknown estimator 'our-arma': did you mean 'our-arma?x?'", estimator, "our-arma")


def test_missing_packages_come_with_the_command_that_installs_them(monkeypatch, tmp_path):
    monkeypatch.setattr(known_estimators, "find_spec", lambda name: name if name == "hmtb_twin" else None)
    monkeypatch.setenv("PATH", str(tmp_path))
    known_estimators.octave_version.cache_clear()
    refused(r"pysib-oe needs the package pysib: pip install 'hmtb-twin\[peers\]'", estimator, "pysib-oe")
    octave = "octave-arx needs the program octave-cli with its package control: apt-get install octave octave-control"
    assert KNOWN["octave-arx"].missing() == octave
    assert KNOWN["our-oe"].missing() == ""
    known_estimators.octave_version.cache_clear()


def test_the_version_is_that_of_the_package():
    assert estimator("control-era").version == f"control {importlib.metadata.version('control')}"


@pytest.mark.parametrize("known", KNOWN.values(), ids=KNOWN)
def test_every_target_exists(known):
    """Adapters import their packages only when they are called, so that all of them can be loaded here."""
    one = known.estimator
    assert one.settings
    if known.octave:
        assert (Path(OCTAVE) / f"estimate_{one.target.split()[4]}.m").is_file()
    elif one.name != "perfect":
        module, _, function = one.target.partition(":")
        assert callable(getattr(importlib.import_module(module), function))
