"""The page for those who bring an estimator: its function works, its faults show, its lists are whole."""

import re
import shlex
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest

from scenarios.bench.leaderboard_verdict import GUIDE
from scenarios.bench.metrics import ALL_METRICS
from scenarios.commands.cli import parse
from scenarios.problems.registry import names, problem
from sysid.models import innovations_form

ROOT = Path(__file__).parents[3]
PAGE = (ROOT / "docs/your-estimator.md").read_text(encoding="utf-8")


@pytest.fixture(scope="module")
def mine() -> ModuleType:
    """The page's Python, as the module that it names."""
    module = ModuleType("my_estimator")
    exec("\n".join(re.findall(r"^```python\n(.*?)^```", PAGE, re.M | re.S)), module.__dict__)
    return module


def digits(mine: ModuleType, function: str, name: str) -> float:
    """Correct digits of the response from one record."""
    one = problem(name)
    polynomials, _ = getattr(mine, function)(one.draw(1), one.task("arx"))
    found = innovations_form(polynomials, one.truth.dt).frequency_response(one.frequencies)
    true = one.truth.frequency_response(one.frequencies)
    return float(-np.log10(np.linalg.norm(found - true) / np.linalg.norm(true)))


def test_the_function_is_right_without_noise_and_the_late_one_has_no_digit(mine: ModuleType) -> None:
    for name in ("quiet-1-1", "quiet-3-2", "quiet-6-3"):
        assert digits(mine, "arx", name) > 10.0
        assert digits(mine, "arx_own_delay", name) > 10.0
        assert digits(mine, "late", name) < 1.0


def test_the_boastful_one_claims_a_quarter(mine: ModuleType) -> None:
    one = problem("p5")
    bound = one.bound("arx")
    assert bound is not None
    errors: dict[str, list[float]] = {"arx": [], "boastful": []}
    for draw in range(40):
        record = one.draw(draw)
        for name, found in errors.items():
            polynomials, covariance = getattr(mine, name)(record, one.task("arx"))
            nk = 2
            error = np.concatenate((polynomials.A[1:], polynomials.B.ravel()[nk:])) - bound.parameters
            found.append(float(error @ np.linalg.solve(covariance, error)) / len(error))
    assert np.mean(errors["arx"]) == pytest.approx(1.0, abs=0.3)
    assert np.mean(errors["boastful"]) == pytest.approx(4.0 * np.mean(errors["arx"]), rel=1e-9)


def test_it_refuses_what_it_does_not_do(mine: ModuleType) -> None:
    one = problem("p5")
    with pytest.raises(NotImplementedError):
        mine.arx(one.draw(0), one.task("arx", "select"))


def table(heading: str) -> set[str]:
    section = PAGE.split(f"\n## {heading}\n")[1].split("\n## ")[0]
    rows = [line.split(" | ")[0] for line in section.splitlines() if line.startswith("| `")]
    return {name for row in rows for name in re.findall(r"`([^`]+)`", row)}


def test_every_figure_stands_on_the_page_and_is_told_on_the_leaderboard() -> None:
    assert {maker.name for maker in ALL_METRICS} <= set(GUIDE) == table("The figures")


def test_every_family_of_problems_stands_on_the_page() -> None:
    told = table("The problems")
    families = {re.split(r"[-\d.]", name)[0] for name in told}
    assert families == {re.split(r"[-\d.]", some[0])[0] for some in names().values()} | {"twin"}


def test_its_commands_are_understood(monkeypatch: pytest.MonkeyPatch) -> None:
    lines = [line for block in re.findall(r"^```sh\n(.*?)^```", PAGE, re.M | re.S) for line in block.splitlines()]
    assert len(lines) >= 4
    for line in lines:
        program, *words = shlex.split(line)
        assert program == "hmtb"
        assert callable(parse(words))


def test_its_links_lead_somewhere() -> None:
    for link in re.findall(r"\]\(([^)#]+)\)", PAGE):
        assert (ROOT / "docs" / link).exists(), link


def test_readers_are_led_to_it() -> None:
    for page in ("README.md", "docs/toolbox.md"):
        assert "your-estimator.md" in (ROOT / page).read_text(encoding="utf-8")
