import ast
import importlib
from pathlib import Path

import pytest

from scenarios.estimators import catalogue_entry as entry
from scenarios.estimators import known_estimators as registry
from scenarios.estimators.entries_faulty import FAULTY
from scenarios.estimators.entries_ours import OURS
from scenarios.estimators.entries_peers import PEERS
from scenarios.files.errors import ScenarioError

ROOM = Path(registry.__file__).parent


def test_names_are_all_different() -> None:
    assert len(registry.names()) == len(OURS) + len(PEERS) + len(FAULTY)


def test_unknown_name_tells_the_near_one() -> None:
    with pytest.raises(ScenarioError, match=r"unknown contestant 'our-arma': did you mean 'our-arma?x?'"):
        registry.contestant("our-arma")


def test_missing_package_tells_what_installs_it(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(entry, "find_spec", lambda name: None)
    assert registry.available("pysib-oe")[0] is False
    with pytest.raises(ScenarioError, match=r"pysib-oe needs the package pysib: pip install 'hmtb-twin\[peers\]'"):
        registry.contestant("pysib-oe")
    assert registry.available("our-oe") == (True, "")


def test_missing_octave_tells_what_installs_it(monkeypatch: pytest.MonkeyPatch) -> None:
    entry.octave_version.cache_clear()
    monkeypatch.setattr(entry.shutil, "which", lambda name: None)
    can_run, why = registry.available("octave-arx")
    entry.octave_version.cache_clear()
    assert not can_run
    assert why == (
        "octave-arx needs the program octave-cli with its package control: apt-get install octave octave-control"
    )


def test_version_is_that_of_the_package() -> None:
    assert registry.contestant("control-era").version == f"control {importlib.metadata.version('control')}"


@pytest.mark.parametrize("one", [e for e in (*OURS, *PEERS, *FAULTY)], ids=lambda e: e.contestant.name)
def test_target_is_there(one: entry.Entry) -> None:
    """Files of peers are looked at without importing what may not be installed."""
    target = one.contestant.target
    if target == "bench:perfect":
        return
    if one.octave:
        assert (ROOM / "octave" / f"estimate_{target.split()[4]}.m").is_file()
        return
    module, _, function = target.partition(":")
    path = ROOM / f"{module.rpartition('.')[2]}.py"
    defined = {node.name for node in ast.parse(path.read_text()).body if isinstance(node, ast.FunctionDef)}
    assert function in defined
    if not one.module:
        assert callable(getattr(importlib.import_module(module), function))
    assert one.contestant.settings
