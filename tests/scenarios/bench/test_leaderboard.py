"""Result files as they are read for the leaderboard: what is refused, the order of rows, notes, the response error."""

import json
import os
from collections import Counter
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from scenarios.bench.leaderboard import ranked
from scenarios.bench.leaderboard_drawings import work_precision
from scenarios.bench.leaderboard_notes import notes
from scenarios.bench.leaderboard_tables import standing
from scenarios.bench.metric import Metric, Part, Verdict
from scenarios.bench.metrics import ALL_METRICS
from scenarios.bench.result import Result
from scenarios.estimators.estimator import Estimator, Limits
from scenarios.files.errors import ScenarioError
from tests.scenarios.bench.judging import changed, saved

# What all of them set up takes seconds.
pytestmark = pytest.mark.slow

ERRORS = {"p2": 0.1, "p3": 8.0, "p4": 0.3, "p5": 0.9}


def verdicts(metrics):
    return Counter(metric.verdict for metric in metrics.values())


def test_what_is_written_is_read_again_numbers_of_numpy_and_nan_included(tmp_path):
    number = np.float64(1.5)
    part = Part("p1", number, float("nan"), (0.0, 1.0), (-np.inf, number), False, draws=int(np.int64(3)))
    curves = {"count": np.int64(4), "grid": np.arange(2.0), "flag": np.bool_(True), "none": np.array([np.nan])}
    metric = Metric("few", "Few", "", number, 1.0, (1.0, 2.0), False, 1e-4, "why", (part,), curves)
    made = (Estimator("mine", "a:b"), Limits(), "quick", 0, "", "", {}, "", {"model": 1}, {}, 0.5, {"few": metric})
    assert part.surprises and not Result(*made).passed
    read = Result.read(saved(tmp_path / "mine.json", Result(*made)))
    assert read.metrics["few"].curves == {"count": 4, "grid": [0.0, 1.0], "flag": True, "none": [None]}
    (again,) = read.metrics["few"].parts
    assert (again.limits, again.passed, again.draws) == ((-np.inf, 1.5), False, 3)
    assert np.isnan(again.expected) and not read.passed


def test_files_that_cannot_be_read_are_refused(complaint, tmp_path):
    assert "no result given" in complaint("leaderboard")
    with pytest.raises(ScenarioError, match=r"expected one with results of hmtb verify in it"):
        ranked([tmp_path])
    with pytest.raises(ScenarioError, match="cannot read"):
        ranked([tmp_path / "missing.json"])
    os.mkfifo(tmp_path / "pipe.json")
    for path in (tmp_path / "pipe.json", tmp_path, Path("/dev/zero")):
        with pytest.raises(ScenarioError, match="is no ordinary file"):
            ranked([path])
    for text in ("", "{", "[" * 100_000, "\x00", "[1, 2]"):
        (tmp_path / "bad.json").write_text(text, encoding="utf-8")
        with pytest.raises(ScenarioError, match=r"bad\.json"):
            ranked([tmp_path / "bad.json"])


def test_two_of_one_name_are_refused(written, results):
    again = saved(written[0].with_name("again.json"), replace(results[1], seed=8))
    with pytest.raises(ScenarioError, match=r"again\.json and .*1\.json are both of 'armax'"):
        ranked([written[1], again])
    assert len(ranked([written[1], written[1]]).rows) == 1


@pytest.mark.parametrize(
    ("place", "value"),
    [
        ("format", 99),
        ("format", True),
        ("contestant name", "  "),
        ("contestant program", "x"),
        ("seed", {"a": 1}),
        ("limits seconds", 10**400),
        ("outcomes", {"model": -1}),
        ("reasons", ["late"]),
        ("figures efficiency value", 10**400),
        ("figures efficiency interval", [1.0]),
        ("figures efficiency false_alarm", None),
        ("figures efficiency false_alarm", 1.5),
        ("figures efficiency parts", None),
    ],
)
def test_a_damaged_result_is_refused(written, place, value):
    changed(json.loads(written[1].read_text(encoding="utf-8")), [(place, value)], written[1])
    with pytest.raises(ScenarioError, match=r"1\.json"):
        ranked([written[1]])


def test_verdicts_and_failures_that_theory_does_not_know_weigh_most(written):
    board = ranked(written)
    by_name = {row.name: row.result.metrics for row in board.rows}
    names = list(by_name)
    assert names.index("armax") < names.index("oe") < names.index("okid")
    failures = [verdicts(row.result.metrics)[Verdict.FAILS] for row in board.rows]
    assert failures == sorted(failures) and failures[0] == 0 < failures[-1]
    assert by_name["oe"]["efficiency"].verdict is Verdict.FAILS_AS_THEORY_SAYS
    assert by_name["armax"]["agreement"].verdict is board.rows[0].verdict("no metric") is Verdict.NONE
    unjudged = {name for name, metric in by_name["armax"].items() if metric.passed is None}
    assert unjudged >= {"agreement", "bandwidth"}
    counts = verdicts(by_name["armax"])
    assert counts[Verdict.PASSES] == len(ALL_METRICS) - len(unjudged)
    assert (counts[Verdict.NONE], counts[Verdict.FAILS]) == (len(unjudged), 0)
    # A file whose figure says that it passes and whose part says otherwise fails.
    assert replace(by_name["okid"]["efficiency"], passed=True).verdict is Verdict.FAILS


def test_what_could_not_be_judged_is_no_advantage_and_time_no_harm(written, results):
    """One that passes all of what is left of it stands behind one that was judged by more and fails as theory says."""

    def without(name):
        left = replace(results[1].metrics[name], passed=None, parts=())
        return ranked([saved(written[1], replace(results[1], metrics={**results[1].metrics, name: left})), written[2]])

    board = without("bias")
    assert [row.name for row in board.rows] == ["oe", "armax"]
    oe, armax = (verdicts(result.metrics) for result in (results[2], results[1]))
    assert oe[Verdict.FAILS_AS_THEORY_SAYS] >= 4
    passes, judged = (oe[Verdict.PASSES], armax[Verdict.PASSES] - 1), len(board.judged)
    assert judged == len(ALL_METRICS) - 1  # the bandwidth has no verdict
    assert [(row[1].text, row[4].text) for row in standing(board).rows] == [
        (f"{passes[0]} of {judged}", "1"),
        (f"{passes[1]} of {judged}", "2"),
    ]
    assert [row.name for row in without("speed").rows] == ["armax", "oe"]
    # Figures that were not made are as figures that were not judged.
    made = {name: metric for name, metric in results[1].metrics.items() if name != "bias"}
    board = ranked([saved(written[1], replace(results[1], metrics=made)), written[2]])
    assert [row.name for row in board.rows] == ["oe", "armax"]


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"seed": 8}, "Rows differ in seed, so they saw different records"),
        ({"effort": "full"}, "Rows differ in effort"),
        ({"limits": Limits(seconds=5.0)}, "Rows differ in limits"),
        ({"protocol": 2}, "Rows differ in protocol"),
        ({"machine": "another"}, "Rows differ in machine, so speeds compare as multiples of the reference time only"),
        ({"versions": {"hmtb-twin": "0.2.0"}}, "Rows differ in version of the bench"),
        ({"run": "two"}, "Rows are not all of one run"),
        ({"run": ""}, "each run on its own: oe"),
    ],
)
def test_rows_that_do_not_compare_are_named(written, results, change, words):
    assert notes(ranked(written[:3])) == []
    saved(written[2], replace(results[2], **change))
    (note,) = notes(ranked(written[1:4]))
    assert words in note and "oe" in note and "armax" in note


def test_rows_that_are_not_whole_are_named(written, results):
    part = {name: results[1].metrics[name] for name in ("efficiency", "speed")}
    saved(written[1], replace(results[1], metrics=part))
    nothing = {name: replace(f, passed=None, parts=()) for name, f in results[2].metrics.items()}
    saved(written[2], replace(results[2], metrics=nothing, outcomes={"refused": 853}))
    saved(written[3], replace(results[3], metrics=nothing))
    texts = notes(ranked(written[:4]))
    assert len(texts) == 3
    whole = len(ALL_METRICS)
    assert f"all {whole} figures, of which {whole - 1} give verdicts" in texts[0]
    assert f"2 of {whole} computed: armax." in texts[0]
    assert any("oe gave no model at all (853 × refused)" in text for text in texts)
    assert any("Nothing of okid could be judged" in text for text in texts)
    outcomes = {"model": 780, "refused": 120}
    saved(written[1], replace(results[1], outcomes=outcomes, refused={"p2": 80, "p3, select": 40}))
    saved(written[2], replace(results[2], outcomes=outcomes))
    assert notes(ranked(written[1:3])) == [
        "armax refused 120 of 900 requests (80 × p2, 40 × p3, select), and is judged by the others only.",
        "oe refused 120 of 900 requests, and is judged by the others only.",
    ]


def test_the_command_writes_both_pages(results, tmp_path, result, complaint):
    folder = tmp_path / "results"
    folder.mkdir()
    for made in results[1:3]:  # a drawing or two less, to be quick
        few = {name: figure for name, figure in made.metrics.items() if name in ("coverage", "speed", "reliability")}
        saved(folder / f"{made.estimator.name}.json", replace(made, metrics=few))
    out = tmp_path / "new" / "pages"
    rows = result("leaderboard", folder, "--out", out)["rows"]
    assert [row["name"] for row in rows] == ["armax", "oe"]
    assert rows[1]["verdicts"]["coverage"] == "fails as theory says"
    assert rows[0]["values"]["speed"] > 0
    assert {path.name for path in out.iterdir()} == {"leaderboard.html", "leaderboard.md"}
    assert "cannot write to folder" in complaint("leaderboard", folder, "--out", folder / "oe.json")


def errors(result, percent, *, posed=()):
    """A result with these errors of the response, in percent; problems that were posed and not answered are parts."""
    metric = result.metrics["frequency_response"]
    curves = {name: {**metric.curves["p2"], "relative_error_percent": value} for name, value in percent.items()}
    parts = tuple(replace(metric.parts[0], label=name) for name in posed or percent)
    return replace(result, metrics={**result.metrics, metric.name: replace(metric, curves=curves, parts=parts)})


@pytest.fixture
def board_of(written, results):
    def ranked_pair(armax, oe=None):
        return ranked([saved(written[1], armax), saved(written[2], oe or errors(results[2], ERRORS))])

    return ranked_pair


def cells(board):
    table = standing(board)
    column = table.columns.index("Response error / %")
    return {row.name: line[column].text for row, line in zip(board.rows, table.rows, strict=True)}


def test_leaving_out_a_hard_problem_is_no_advantage(board_of, results):
    easy = {name: value for name, value in ERRORS.items() if name != "p3"}
    board = board_of(errors(results[1], easy, posed=tuple(ERRORS)))
    assert cells(board) == {"armax": "– (3 of 4)", "oe": "0.6"}
    figure, caption = work_precision(board)
    assert caption.endswith("Not drawn, since a number of theirs is missing: armax.")
    assert "asked of all rows (p2, p3, p4, p5)" in caption
    assert len(figure.axes[0].lines) == 2  # of one estimator
    (note,) = notes(board)
    assert note.startswith("armax answered too few records of p3 for a verdict: no response error")


def test_too_few_records_are_no_answer(board_of, results):
    whole = errors(results[1], ERRORS)
    metric = whole.metrics["efficiency"]
    parts = tuple(replace(p, passed=None, draws=9) if p.label == "p5" else p for p in metric.parts)
    few = replace(whole, metrics={**whole.metrics, metric.name: replace(metric, parts=parts)})
    assert cells(board_of(few))["armax"] == "– (3 of 4)"


def test_problems_that_were_not_posed_to_all_do_not_count(board_of, results):
    """Another effort, or a structure that cannot hold a system, poses other problems."""
    board = board_of(errors(results[1], {**ERRORS, "mimo": 70.0, "random-easy-1": 50.0}))
    assert board.problems == tuple(ERRORS)
    assert cells(board) == {"armax": "0.6", "oe": "0.6"}
    assert notes(board) == []
    medians = {row.name: row.median_error(("p2", "mimo", "p3")) for row in board.rows}
    assert medians["armax"] == 8.0 and np.isnan(medians["oe"])
    board = board_of(errors(results[1], {"p2": 0.1}), errors(results[2], {"p3": 0.1}))
    assert cells(board) == {"armax": "–", "oe": "–"}
    assert work_precision(board) is None
    assert "no problem was asked of all rows" in standing(board).caption
