"""Reading results: what is none, what cannot stand on one page, and where rows are not comparable."""

import json
import os
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from scenarios.bench.leaderboard_notes import notes
from scenarios.bench.leaderboard_rows import ranked
from scenarios.bench.leaderboard_tables import standing
from scenarios.bench.leaderboard_verdict import Verdict, count, verdict
from scenarios.bench.result import Result
from scenarios.commands.cli import main
from scenarios.estimators.estimator import Limits
from scenarios.files.errors import ScenarioError

Save = Callable[[Path, Result], Path]


def test_none_given_is_said(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    assert main(["leaderboard"]) == 2
    assert "no result given" in capsys.readouterr().err
    with pytest.raises(ScenarioError, match=r"expected one with results of hmtb verify in it"):
        ranked([tmp_path])
    with pytest.raises(ScenarioError, match="cannot read"):
        ranked([tmp_path / "missing.json"])


def test_two_of_one_name_are_refused(written: list[Path], results: tuple[Result, ...], saved: Save) -> None:
    again = saved(written[0].with_name("again.json"), replace(results[1], seed=8))
    with pytest.raises(ScenarioError, match=r"again\.json and .*1\.json are both of 'armax'"):
        ranked([written[1], again])
    assert len(ranked([written[1], written[1]])) == 1


@pytest.mark.parametrize(
    ("keys", "value"),
    [
        ((), [1, 2]),
        (("format",), 99),
        (("format",), True),
        (("contestant", "name"), 5),
        (("contestant", "program"), "x"),
        (("seed",), {"a": 1}),
        (("seconds",), "x"),
        (("seconds",), 10**400),
        (("limits", "seconds"), 10**400),
        (("limits", "memory_bytes"), float("nan")),
        (("figures", "efficiency", "value"), 10**400),
        (("figures", "efficiency", "parts", 0, "draws"), "all"),
        (("outcomes",), {"model": -1}),
        (("contestant", "name"), "  "),
        (("figures", "efficiency", "value"), "wide"),
        (("figures", "efficiency", "interval"), [1.0]),
        (("figures", "efficiency", "passed"), "yes"),
        (("figures", "efficiency", "false_alarm"), [1]),
        (("figures", "efficiency", "false_alarm"), None),
        (("figures", "efficiency", "false_alarm"), 1.5),
        (("figures", "efficiency", "curves"), 3),
        (("figures", "efficiency", "parts", 0, "label"), None),
        (("figures", "efficiency", "parts"), None),
        (("outcomes",), {"model": "many"}),
        (("reasons",), ["late"]),
        (("refused",), {"p2": "all"}),
        (("versions",), {"numpy": 2}),
        (("machine",), None),
    ],
)
def test_what_is_no_result_is_named(written: list[Path], keys: tuple[Any, ...], value: object) -> None:
    table = json.loads(written[1].read_text(encoding="utf-8"))
    if keys:
        place = table
        for key in keys[:-1]:
            place = place[key]
        place[keys[-1]] = value
    path = written[1]
    path.write_text(json.dumps(table if keys else value), encoding="utf-8")
    with pytest.raises(ScenarioError, match=r"1\.json"):
        ranked([path])


def test_what_never_ends_is_not_read(tmp_path: Path) -> None:
    pipe = tmp_path / "pipe.json"
    os.mkfifo(pipe)
    for path in (pipe, tmp_path, Path("/dev/zero")):
        with pytest.raises(ScenarioError, match="is no ordinary file"):
            ranked([path])


def test_texts_that_are_no_json_are_refused(tmp_path: Path) -> None:
    for text in ("", "{", "[" * 100_000, "\x00"):
        path = tmp_path / "bad.json"
        path.write_text(text, encoding="utf-8")
        with pytest.raises(ScenarioError, match=r"bad\.json"):
            ranked([path])


def test_failures_that_theory_does_not_know_weigh_most(
    written: list[Path], results: tuple[Result, ...], saved: Save
) -> None:
    """One figure that fails outweighs any number that fail as theory says."""
    names = [entry.name for entry in ranked(written)]
    assert names.index("oe") < names.index("okid")
    assert names.index("armax") < names.index("oe")
    failures = [count(entry.result.figures.values())[Verdict.FAILS] for entry in ranked(written)]
    assert failures == sorted(failures) and failures[0] == 0 < failures[-1]


def test_what_could_not_be_judged_is_no_advantage_and_time_no_harm(
    written: list[Path], results: tuple[Result, ...], saved: Save
) -> None:
    """One that passes all of what is left of it stands behind one that was judged by more and fails as theory says."""

    def without(result: Result, *names: str) -> Result:
        figures = {name: replace(f, passed=None, parts=()) for name, f in result.figures.items() if name in names}
        return replace(result, figures={**result.figures, **figures})

    paths = [saved(written[1], without(results[1], "bias")), written[2]]
    entries = ranked(paths)
    assert [entry.name for entry in entries] == ["oe", "armax"]
    passed = [count(entry.result.figures.values())[Verdict.PASSES] for entry in entries]
    assert passed == [4, 6]
    assert [row[1].text for row in standing(entries).rows] == ["4 of 12", "6 of 12"]
    assert [row[4].text for row in standing(entries).rows] == ["5", "6"]
    timed = {name: replace(f, passed=True) if name == "speed" else f for name, f in results[2].figures.items()}
    saved(written[1], results[1])
    saved(written[2], replace(results[2], figures=timed))
    assert [entry.name for entry in ranked(paths)] == ["armax", "oe"]
    # Figures that were not made are as figures that were not judged.
    saved(written[1], replace(results[1], figures={name: f for name, f in timed.items() if name != "bias"}))
    assert [entry.name for entry in ranked(paths)] == ["oe", "armax"]


def test_rows_of_one_run_need_no_note(written: list[Path]) -> None:
    assert notes(ranked(written[:3])) == []


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"seed": 8}, "Rows differ in seed, so they saw different records"),
        ({"effort": "full"}, "Rows differ in effort"),
        ({"limits": Limits(seconds=5.0)}, "Rows differ in limits"),
        ({"protocol": 2}, "Rows differ in protocol"),
        ({"machine": "another"}, "Rows differ in machine, so speeds compare as multiples of the ruler only"),
        ({"versions": {"hmtb-twin": "0.2.0"}}, "Rows differ in version of the bench"),
        ({"run": "two"}, "Rows are not all of one run"),
        ({"run": ""}, "each run on its own: oe"),
    ],
)
def test_rows_that_do_not_compare_are_named(
    written: list[Path], results: tuple[Result, ...], saved: Save, change: dict[str, Any], words: str
) -> None:
    saved(written[2], replace(results[2], **change))
    (note,) = notes(ranked(written[1:4]))
    assert words in note
    assert "oe" in note
    assert "armax" in note


def test_rows_that_are_not_whole_are_named(written: list[Path], results: tuple[Result, ...], saved: Save) -> None:
    part = {name: results[1].figures[name] for name in ("efficiency", "speed")}
    saved(written[1], replace(results[1], figures=part))
    nothing = {name: replace(f, passed=None, parts=()) for name, f in results[2].figures.items()}
    saved(written[2], replace(results[2], figures=nothing, outcomes={"refused": 853}))
    saved(written[3], replace(results[3], figures=nothing))
    said = notes(ranked(written[:4]))
    assert len(said) == 3
    assert "2 of 13: armax." in said[0]
    assert any("oe gave no model at all (853 × refused)" in note for note in said)
    assert any("Nothing of okid could be judged" in note for note in said)


def test_who_is_judged_by_a_part_of_the_requests_is_named(
    written: list[Path], results: tuple[Result, ...], saved: Save
) -> None:
    outcomes = {"model": 780, "refused": 120}
    saved(written[1], replace(results[1], outcomes=outcomes, refused={"p2": 80, "p3, select": 40}))
    saved(written[2], replace(results[2], outcomes=outcomes))
    assert notes(ranked(written[1:3])) == [
        "armax refused 120 of 900 requests (80 × p2, 40 × p3, select), and is judged by the others only.",
        "oe refused 120 of 900 requests, and is judged by the others only.",
    ]


def test_verdicts_of_figures(written: list[Path]) -> None:
    by_name = {entry.name: entry.result for entry in ranked(written)}
    assert verdict(by_name["oe"].figures["efficiency"]) is Verdict.FAILS_AS_THEORY_SAYS
    assert verdict(by_name["okid"].figures["efficiency"]) is Verdict.FAILS
    assert verdict(by_name["armax"].figures["speed"]) is Verdict.NONE
    assert verdict(None) is Verdict.NONE
    found = count(by_name["armax"].figures.values())
    assert (found[Verdict.PASSES], found[Verdict.NONE], found[Verdict.FAILS]) == (7, 6, 0)
    # A file whose figure says that it passes and whose part says otherwise fails.
    figure = by_name["okid"].figures["efficiency"]
    assert verdict(replace(figure, passed=True)) is Verdict.FAILS


def test_the_command_writes_both_pages(
    results: tuple[Result, ...], saved: Save, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    folder = tmp_path / "results"
    folder.mkdir()
    for made in results[1:3]:  # a drawing or two less, to be quick
        few = {name: figure for name, figure in made.figures.items() if name in ("coverage", "speed", "reliability")}
        saved(folder / f"{made.contestant.name}.json", replace(made, figures=few))
    out = tmp_path / "new" / "pages"
    assert main(["leaderboard", str(folder), "--out", str(out), "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    assert [row["name"] for row in told["rows"]] == ["armax", "oe"]
    assert told["rows"][1]["verdicts"]["coverage"] == "fails as theory says"
    assert told["rows"][0]["values"]["speed"] > 0
    assert {path.name for path in out.iterdir()} == {"leaderboard.html", "leaderboard.md"}
    assert main(["leaderboard", str(folder), "--out", str(folder / "oe.json")]) == 2
    assert "cannot write to folder" in capsys.readouterr().err
