"""The page on truth: its example runs, and what it names exists."""

import re
import subprocess
import sys
from dataclasses import fields
from pathlib import Path

import pytest

from scenarios.experiments.multisines import Multisines
from scenarios.truth.attainable import Attainable, Horizon
from scenarios.truth.best_linear import BestLinearTruth

ROOT = Path(__file__).parents[1]
PAGE = (ROOT / "docs/truth.md").read_text(encoding="utf-8")


@pytest.mark.slow
def test_the_example_runs(tmp_path: Path) -> None:
    (text,) = re.findall(r"^```python\n(.*?)^```", PAGE, re.M | re.S)
    path = tmp_path / "example.py"
    path.write_text(f"import sys\nsys.path.insert(0, {str(ROOT)!r})\n{text}", encoding="utf-8")
    done = subprocess.run([sys.executable, path], cwd=tmp_path, capture_output=True, text=True, timeout=120)
    assert done.returncode == 0, done.stderr
    small, best, low, high, distortion, any_model, linear = map(
        float, re.findall(r"(?<![\d.])\d+\.\d+(?= |,|$)", done.stdout, re.M)
    )
    assert low < best < high < small
    assert distortion > 1.0
    assert 98.0 < linear < any_model < 100.0


def test_what_it_names_exists() -> None:
    names = {"servo", "chain", "silent", "command_rms", "slewing", "servo_agreement"}
    assert all(f"`{name}`" in PAGE for name in names)
    assert all(hasattr(BestLinearTruth, name) or name in BestLinearTruth.__dataclass_fields__ for name in names)
    assert all(f"`{name}`" in PAGE for name in ("rms", "f_min", "f_max"))
    assert {"rms", "f_min", "f_max", "odd"} <= set(Multisines.__dataclass_fields__)
    assert all(f"`{field.name}`" in PAGE for field in fields(Horizon))
    assert {"right_order", "distortion"} <= set(Attainable.__dataclass_fields__)
