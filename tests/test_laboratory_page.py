"""The laboratory's page: its scenario and its operator run, and it names every link, parameter and flag."""

import re
import subprocess
import sys
from dataclasses import fields
from pathlib import Path

import numpy as np
import pytest

from hmtb_twin import PAYLOADS, VARIANTS, Chain, HandController, Plant, Status, simulate
from scenarios import Scenario

ROOT = Path(__file__).parents[1]
PAGE = (ROOT / "docs/laboratory.md").read_text(encoding="utf-8")


def block(language: str) -> str:
    (text,) = re.findall(rf"^```{language}\n(.*?)^```", PAGE, re.M | re.S)
    return text


def test_the_scenario_runs() -> None:
    scenario = Scenario.from_toml(block("toml"))
    assert scenario.plant.friction == "coulomb"
    (log,) = simulate([scenario])
    off = (log.status & Status.SHUT_DOWN) != 0
    np.testing.assert_array_equal(np.flatnonzero(off), np.arange(1000, 1250))


@pytest.mark.slow
def test_the_operator_runs(tmp_path: Path) -> None:
    path = tmp_path / "operator.py"
    path.write_text(f"import sys\nsys.path.insert(0, {str(ROOT)!r})\n{block('python')}", encoding="utf-8")
    done = subprocess.run([sys.executable, path], cwd=tmp_path, capture_output=True, text=True, timeout=60)
    assert done.returncode == 0, done.stderr
    risen = int(re.fullmatch(r"risen by (\d+) mm\n", done.stdout)[1])
    assert 45 <= risen <= 60


def test_links_parameters_and_flags_are_those_that_exist() -> None:
    rows = re.findall(r"^\| `(\w+)` \|", PAGE, re.M)
    assert rows == [*(field.name for kind in (Chain, Plant) for field in fields(kind)), *VARIANTS, *PAYLOADS]
    flags = dict(re.findall(r"^\| (\d+) \| `(\w+)` \|", PAGE, re.M))
    assert flags == {str(flag.value): flag.name for flag in Status}
    named = set(re.findall(r"`(\w+)`", PAGE)) | set(re.findall(r"^(\w+) = ", PAGE, re.M))
    assert set(HandController.__dataclass_fields__) <= named
