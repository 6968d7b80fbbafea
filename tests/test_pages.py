"""The README and the pages of docs: their examples run, their numbers are those of the code, what they name exists."""

import re
from contextlib import chdir, redirect_stdout
from dataclasses import fields
from functools import cache
from io import StringIO
from pathlib import Path

import numpy as np
import pytest

import sysid
from hmtb_twin import PAYLOADS, VARIANTS, Chain, HandController, Plant, Specimen, Status, load_arm, simulate
from hmtb_twin.parameters.specimen import FARTHEST, LARGEST
from hmtb_twin.parameters.specimen_draw import CUT, KINDS, TwinDistributions
from hmtb_twin.parameters.variants import LINKS
from scenarios import Scenario, load
from scenarios.commands.cli import COMMANDS
from scenarios.experiments.multisines import Multisines
from scenarios.truth.attainable import Attainable, Horizon
from scenarios.truth.best_linear import BestLinearTruth

ROOT = Path(__file__).parents[1]
NUMBER = re.compile(r"(?<![\w.])\d+(?:\.\d+)?(?:e-\d+)?")


@cache
def page(name: str) -> str:
    return (ROOT / name).read_text(encoding="utf-8")


def named(name: str) -> set[str]:
    """Words in backquotes."""
    return set(re.findall(r"`(\w+)`", page(name)))


def block(name: str, language: str) -> str:
    """Fenced text of one language, all blocks of a page in turn."""
    return "\n".join(re.findall(rf"^```{language}\n(.*?)^```", page(name), re.M | re.S))


def run_example(name: str, folder: Path) -> str:
    """Run the Python of a page; return what it printed."""
    with chdir(folder), redirect_stdout(StringIO()) as printed:
        exec(block(name, "python"), {"__name__": "__main__"})
    return printed.getvalue()


def assert_same_sentence(printed: str, expected: str) -> None:
    """Check words, and numbers but for one step in the last digit: that is left to other compilers and processors."""
    assert NUMBER.sub("#", printed) == NUMBER.sub("#", expected)
    for number, new in zip(NUMBER.findall(printed), NUMBER.findall(expected), strict=True):
        step = 10.0 ** -len(number.partition(".")[2]) if "e" not in number else float(number)
        assert float(number) == pytest.approx(float(new), abs=1.5 * step), printed


# --- README ---


@pytest.mark.pages
def test_readme_examples_print_what_is_shown(tmp_path):
    printed = run_example("README.md", tmp_path).strip().splitlines()
    # The last line of the example of sysid alone stands in a comment, the output of the other in a block of its own.
    (comparison,) = re.findall(r"^print\(\*sysid\.compare\(.*  # (.*)$", page("README.md"), re.M)
    recovered = block("README.md", "text").strip()
    first = len(printed) - len(recovered.splitlines())
    assert_same_sentence(comparison, printed[first - 1])
    assert_same_sentence(recovered, "\n".join(printed[first:]))


@pytest.mark.slow
def test_every_command_of_the_readme_exists():
    assert set(re.findall(r"`hmtb ([a-z]+)", page("README.md"))) <= set(COMMANDS)


def test_make_targets_of_the_readme_exist():
    targets = set(re.findall(r"^make ([a-z]+)", page("README.md"), re.M))
    assert targets == {"thesis", "test"}
    assert targets <= set(re.findall(r"^([a-z-]+):", page("Makefile"), re.M))


# --- docs/laboratory.md ---


@pytest.mark.slow
def test_the_scenario_of_the_laboratory_runs():
    scenario = Scenario.from_toml(block("docs/laboratory.md", "toml"))
    assert scenario.plant.friction == "coulomb"
    (log,) = simulate([scenario])
    np.testing.assert_array_equal(np.flatnonzero(log.status & Status.SHUT_DOWN), np.arange(1000, 1250))


@pytest.mark.pages
def test_the_operator_of_the_laboratory_runs(tmp_path):
    risen = int(re.fullmatch(r"risen by (\d+) mm\n", run_example("docs/laboratory.md", tmp_path))[1])
    assert 45 <= risen <= 60


def test_links_parameters_and_flags_of_the_laboratory_exist():
    text = page("docs/laboratory.md")
    rows = re.findall(r"^\| `(\w+)` \|", text, re.M)
    assert rows == [*(field.name for kind in (Chain, Plant) for field in fields(kind)), *VARIANTS, *PAYLOADS]
    flags = dict(re.findall(r"^\| (\d+) \| `(\w+)` \|", text, re.M))
    assert flags == {str(flag.value): flag.name for flag in Status}
    words = named("docs/laboratory.md") | set(re.findall(r"^(\w+) = ", text, re.M))
    assert set(HandController.__dataclass_fields__) <= words


# --- docs/maps.md ---

MAP_FINDINGS = "docs/measured/map-findings.md"


@pytest.mark.pages
def test_small_signal_sentences_of_the_maps_are_computed(small_signal_findings):
    """Those over amplitude and friction take a minute; docs/images/maps.py renews them."""
    (text,) = re.findall(r"<!-- findings -->\n(.*?)<!-- end -->", page(MAP_FINDINGS), re.S)
    shown = [line.removeprefix("- ") for line in text.strip().splitlines()]
    assert len(shown) == len(small_signal_findings) + 2
    for printed, sentence in zip(shown, small_signal_findings, strict=False):
        assert_same_sentence(printed, sentence)


def test_readme_and_page_quote_the_maps():
    (turn, amplitude) = re.findall(r"more than (\d+)°, and from ([\d.]+) rad", page("README.md"))[0]
    assert f"turn every joint at once by up to {turn}°" in page(MAP_FINDINGS)
    assert f"Turn every joint at once by up to {turn}°" in page("docs/maps.md")
    within = re.findall(r"(?:shoulder|elbow) \w+ from ([\d.]+) to", page(MAP_FINDINGS).partition("- Amplitude")[2])
    assert f"From {max(within, key=float)} rad rms (yaw) or {min(within, key=float)} rad" in page("docs/maps.md")
    assert len(within) == 3 and max(map(float, within)) == float(amplitude)


# --- docs/specimens.md ---


def test_the_table_of_specimens_is_one_of_a_scenario():
    plain, table = load("siso-5-elbow_pitch").to_toml(), block("docs/specimens.md", "toml")
    specimen = Scenario.from_toml(plain.replace("[[excitation]]", table + "\n[[excitation]]", 1)).specimen
    assert specimen.deviations.keys() == {"mass", "payload_mass", "dry_friction", "kp", "leakage"}
    assert load_arm(specimen=specimen).specimen == specimen


@pytest.mark.pages
def test_the_examples_of_specimens_run(tmp_path):
    printed = run_example("docs/specimens.md", tmp_path)
    pitch, gain = re.findall(r"droops by ([\d.]+) mrad\nand has a gain of ([\d.]+) at 0 Hz", printed)[0]
    assert 1.3 < float(pitch) < 1.55
    assert 0.999 < float(gain) < 0.9999
    assert 'oil_temperature = { kind = "uniform", spread = 15.0, centre = 45.0 }' in printed


def test_quantities_and_limits_of_specimens_exist():
    text = page("docs/specimens.md")
    quantities = {entry.name for kind in (Specimen, TwinDistributions) for entry in fields(kind)}
    assert quantities | set(KINDS) <= named("docs/specimens.md")
    assert f"between {1 / LARGEST:g} and {LARGEST:g}" in text
    assert f"within {FARTHEST:g} either way" in text
    assert f"beyond {CUT:g} standard deviations" in text
    link = LINKS["shoulder_pitch"]
    across = link.axial_inertia / 2
    extents = [1e3 * (moment / link.mass) ** 0.5 for moment in (link.transverse_inertia - across, across)]
    assert "of the upper arm {:.0f} mm along and {:.0f} mm across".format(*extents) in text


# --- docs/toolbox.md ---


@pytest.mark.pages
def test_every_row_of_the_toolbox_runs_after_its_session(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    names: dict = {}
    session, *further = re.findall(r"^```python\n(.*?)^```", page("docs/toolbox.md"), re.M | re.S)
    exec(session, names)
    assert "{'nb': 2, 'nf': 2, 'nk': 2}" in capsys.readouterr().out
    assert (tmp_path / "bode.png").stat().st_size > 10_000
    rows = [line.split("|")[2] for line in page("docs/toolbox.md").splitlines() if line.count("|") == 4]
    code = [expression for row in rows[1:] for expression in re.findall("`([^`]+)`", row)]
    for line in (*code, *further):
        exec(line, names)
    called = set(re.findall(r"sysid\.((?:plots\.)?\w+)", "\n".join(code)))
    expected = {name for name in sysid.__all__ if name.islower()} | {
        f"plots.{name}" for name in sysid.plots.__all__ if name.islower()
    }
    assert not expected - called - {"plots.show"}, "functions without a row in docs/toolbox.md"


# --- docs/truth.md ---


@pytest.mark.pages
def test_the_example_of_truth_runs(tmp_path):
    numbers = re.findall(r"(?<![\d.])\d+\.\d+(?= |,|$)", run_example("docs/truth.md", tmp_path), re.M)
    small, best, low, high, distortion, any_model, linear = map(float, numbers)
    assert low < best < high < small
    assert distortion > 1.0
    assert 98.0 < linear < any_model < 100.0


def test_names_of_truth_exist():
    names = {"servo", "chain", "silent", "command_rms", "slewing", "servo_agreement"}
    assert all(hasattr(BestLinearTruth, name) or name in BestLinearTruth.__dataclass_fields__ for name in names)
    assert {"rms", "f_min", "f_max", "odd"} <= set(Multisines.__dataclass_fields__)
    assert {"right_order", "distortion"} <= set(Attainable.__dataclass_fields__)
    assert names | {"rms", "f_min", "f_max"} | {field.name for field in fields(Horizon)} <= named("docs/truth.md")


# --- docs/reliability.md ---


def test_each_word_of_the_page_on_reliability_selects_a_test():
    sources = [path.read_text(encoding="utf-8") for path in (ROOT / "tests").rglob("test_*.py")]
    tests = re.findall(r"^def (test_\w+)", "\n".join(sources), re.M)
    words = re.findall(r"\| `([\w ]+)` \|$", page("docs/reliability.md"), re.M)
    assert len(words) >= 10
    for word in " or ".join(words).split(" or "):
        assert any(word in name for name in tests), word
