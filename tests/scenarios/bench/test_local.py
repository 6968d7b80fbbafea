"""Processes of this machine: one that dies is replaced, and a piece that no process survives is named."""

from pathlib import Path
from typing import Any

import pytest

from scenarios.bench.local import Local
from scenarios.files.errors import ScenarioError
from tests.scenarios.bench import mortals
from tests.scenarios.bench.mortals import Deed


@pytest.fixture(autouse=True)
def die(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("scenarios.bench.local.work", mortals.work)


def test_a_piece_whose_process_died_is_done_by_another(tmp_path: Path):
    deeds: Any = [Deed("well", 0), Deed("once", 1, str(tmp_path / "mark")), Deed("well", 2)]
    bench: Any = None
    with Local(2).crew(bench) as crew:
        assert sorted(map(str, crew(deeds))) == ["once 1", "well 0", "well 2"]
        deadly: Any = [Deed("well", 3), Deed("always", 4)]
        with pytest.raises(ScenarioError, match=r"always, record 4: 2 processes .* died, the last with exit code 7"):
            list(crew(deadly))


def test_an_error_of_a_process_is_one_here():
    bench: Any = None
    deeds: Any = [Deed("error", 0)]
    with Local(1).crew(bench) as crew, pytest.raises(ValueError, match="of the worker"):
        list(crew(deeds))
