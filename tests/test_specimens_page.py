"""The page on specimens: its table is read, its examples run, and it names every quantity."""

import re
import subprocess
import sys
from dataclasses import fields
from pathlib import Path

import pytest

from hmtb_twin import Specimen, load_arm
from hmtb_twin.parameters.specimen import FARTHEST, LARGEST
from hmtb_twin.parameters.specimen_draw import CUT, KINDS, TwinDistributions
from hmtb_twin.parameters.values import LINKS
from scenarios import Scenario, load

ROOT = Path(__file__).parents[1]
PAGE = (ROOT / "docs/specimens.md").read_text(encoding="utf-8")


def test_the_table_is_one_of_a_scenario() -> None:
    (text,) = re.findall(r"^```toml\n(.*?)^```", PAGE, re.M | re.S)
    plain = load("siso-5-elbow_pitch").to_toml()
    specimen = Scenario.from_toml(plain.replace("[[excitation]]", text + "\n[[excitation]]", 1)).specimen
    assert specimen.deviations.keys() == {"mass", "payload_mass", "dry_friction", "kp", "leakage"}
    assert load_arm(specimen=specimen).specimen == specimen


@pytest.mark.slow
def test_the_examples_run(tmp_path: Path) -> None:
    text = "\n".join(re.findall(r"^```python\n(.*?)^```", PAGE, re.M | re.S))
    path = tmp_path / "example.py"
    path.write_text(f"import sys\nsys.path.insert(0, {str(ROOT)!r})\n{text}", encoding="utf-8")
    done = subprocess.run([sys.executable, path], cwd=tmp_path, capture_output=True, text=True, timeout=60)
    assert done.returncode == 0, done.stderr
    pitch, gain = re.findall(r"droops by ([\d.]+) mrad\nand has a gain of ([\d.]+) at 0 Hz", done.stdout)[0]
    assert 0.9 < float(pitch) < 1.1
    assert 0.999 < float(gain) < 0.9999
    assert 'oil_temperature = { kind = "uniform", spread = 15.0, centre = 45.0 }' in done.stdout


def test_quantities_and_limits_are_those_that_exist() -> None:
    named = set(re.findall(r"`(\w+)`", PAGE))
    assert {entry.name for kind in (Specimen, TwinDistributions) for entry in fields(kind)} <= named
    assert set(KINDS) <= named
    assert f"between {1 / LARGEST:g} and {LARGEST:g}" in PAGE
    assert f"within {FARTHEST:g} either way" in PAGE
    assert f"beyond {CUT:g} standard deviations" in PAGE


def test_the_extent_of_the_upper_arm_is_what_it_says() -> None:
    link = LINKS["shoulder_pitch"]
    along, across = (
        1e3 * (moments / link.mass) ** 0.5
        for moments in (link.transverse_inertia - 0.5 * link.axial_inertia, 0.5 * link.axial_inertia)
    )
    assert f"of the upper arm {along:.0f} mm along and {across:.0f} mm across" in PAGE
