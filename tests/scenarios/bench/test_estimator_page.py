"""The page for those who bring an estimator: its function works, its faults show, its lists are whole."""

import re
import shlex

import numpy as np
import pytest

from scenarios.bench.leaderboard_words import GUIDE
from scenarios.bench.metrics import ALL_METRICS
from scenarios.commands.cli import parse
from scenarios.problems.registry import names, problem
from sysid.models import innovations_form
from tests.benchmarks.tables import ROOT

PAGE = (ROOT / "docs/your-estimator.md").read_text(encoding="utf-8")
FAULTS = (ROOT / "docs/measured/faulty-estimators.md").read_text(encoding="utf-8")
PROTOCOL = (ROOT / "docs/estimator-protocol.md").read_text(encoding="utf-8")


@pytest.fixture(scope="module")
def mine():
    """The file that the page writes, and the faults to append to it."""
    names = {}
    file = re.findall(r"^cat > my_estimator.py <<'END'\n(.*?)^END\n", PAGE, re.M | re.S)
    exec("\n".join(file + re.findall(r"^```python\n(.*?)^```", FAULTS, re.M | re.S)), names)
    return names


@pytest.mark.parametrize("name", ["quiet-1-1", "quiet-3-2", "quiet-6-3"])
@pytest.mark.parametrize(("function", "right"), [("arx", True), ("arx_own_delay", True), ("late", False)])
def test_the_function_is_right_without_noise_and_the_late_one_has_no_digit(mine, function, right, name):
    one = problem(name)
    polynomials, _ = mine[function](one.draw(1), one.task("arx"))
    true = one.truth.frequency_response(one.frequencies)
    error = innovations_form(polynomials, one.truth.dt).frequency_response(one.frequencies) - true
    digits = -np.log10(np.linalg.norm(error) / np.linalg.norm(true))
    assert digits > 10.0 if right else digits < 1.0


def test_the_boastful_one_claims_a_quarter(mine):
    one = problem("p5")
    truth = one.bound("arx").parameters
    errors = {"arx": [], "boastful": []}
    for draw in range(40):
        record = one.draw(draw)
        for name, normalised in errors.items():
            polynomials, covariance = mine[name](record, one.task("arx"))
            error = np.concatenate((polynomials.A[1:], polynomials.B.ravel()[2:])) - truth  # nk = 2
            normalised.append(error @ np.linalg.solve(covariance, error) / len(error))
    assert np.mean(errors["arx"]) == pytest.approx(1.0, abs=0.3)
    assert np.mean(errors["boastful"]) == pytest.approx(4.0 * np.mean(errors["arx"]), rel=1e-9)


def test_it_refuses_what_it_does_not_do(mine):
    one = problem("p5")
    with pytest.raises(NotImplementedError):
        mine["arx"](one.draw(0), one.task("arx", "select"))


def table(heading):
    section = PAGE.split(f"\n## {heading}\n")[1].split("\n## ")[0]
    rows = [line.split(" | ")[0] for line in section.splitlines() if line.startswith("| `")]
    return {name for row in rows for name in re.findall(r"`([^`]+)`", row)}


def test_every_metric_and_family_of_problems_stands_on_the_page():
    assert {metric.name for metric in ALL_METRICS} <= set(GUIDE) == table("The figures")
    families = {re.split(r"[-\d.]", name)[0] for name in table("The problems")}
    assert families == {re.split(r"[-\d.]", some[0])[0] for some in names().values()} | {"twin"}


def test_its_commands_are_understood():
    programs = re.findall(r"`((?:--stays )?--command .*)`", PROTOCOL)
    lines = re.findall(r"^hmtb .*", PAGE, re.M) + [f"hmtb verify {words}" for words in programs]
    assert len(lines) >= 4
    for line in lines:
        program, *words = shlex.split(line)
        assert program == "hmtb" and callable(parse(words))


def test_readers_are_led_to_it():
    for page in ("README.md", "docs/toolbox.md"):
        assert "your-estimator.md" in (ROOT / page).read_text(encoding="utf-8")
