"""`hmtb verify`: what is given is understood or refused in a line; results are printed, written, told as JSON."""

import json
from dataclasses import replace
from pathlib import Path

import pytest

from scenarios.bench.result import Result
from tests.refusals import refused
from tests.scenarios.bench.few import Few, Here

MODULE = """
import sysid

def my_estimator(data, task):
    raise RuntimeError("of no use")
"""

QUICK = ("verify", "perfect", "--quick", "--seed", "3")
"""A few of all seeds make one of the perfect estimator's four models unstable, and the figure of these tests fails."""


@pytest.fixture
def executor(monkeypatch, tmp_path):
    """In an empty folder, with one small figure, everything in this process."""
    monkeypatch.chdir(tmp_path)
    here = Here()
    monkeypatch.setattr("scenarios.bench.metrics.ALL_METRICS", (Few(),))
    monkeypatch.setattr("scenarios.jobs.executor.LocalProcesses", lambda *options: here)
    return here


def test_figures_are_printed_written_and_told(executor, tmp_path, run):
    code, out, err = run(*QUICK)
    assert code == 0
    assert "Parameters within their intervals" in out and "✓ passes" in out
    assert "4 requests, 4 answered by a stable model" in out
    assert "fails no figure that it should pass" in out
    # those of the first record of each problem come before
    assert "still to do, of 4 requests: 2 requests, " in err
    written = Result.read(tmp_path / "results" / "perfect.json")
    assert (written.effort, written.seed, written.outcomes) == ("quick", 3, {"model": 4})
    assert written.command == "hmtb verify perfect --quick --seed 3"
    output = json.loads(run(*QUICK, "--json")[1])
    assert executor.asked == 4  # nothing is done again
    assert output["passed"] is True
    figure = output["figures"]["few"]
    assert (figure["passed"], figure["expected"], figure["interval"]) == (True, 2.0, [1.0, 3.0])
    assert figure["value"] == written.metrics["few"].value


@pytest.mark.slow
def test_several_stand_side_by_side_and_one_that_fails_is_told_by_the_exit_code(executor, tmp_path, run):
    (tmp_path / "mine.py").write_text(MODULE)
    words = (*QUICK[:2], "mine.py:my_estimator", "--structure", "oe", "--figures", "few", *QUICK[2:])
    code, out, _ = run(*words)
    assert code == 1
    assert "Side by side" in out and "✗ fails" in out
    assert "4 x error: RuntimeError: of no use (mine.py, line 5)" in out
    assert "my_estimator: fails 1 figure: Parameters within their intervals" in out
    result = Result.read(tmp_path / "results" / "my_estimator.json")
    assert result.command == "hmtb verify mine.py:my_estimator --structure oe --quick --figures few --seed 3"
    assert (result.estimator.target, result.estimator.home) == ("mine.py:my_estimator", "")
    output = json.loads(run(*words, "--json")[1])
    verdicts = {name: entry["passed"] for name, entry in output["estimators"].items()}
    assert verdicts == {"perfect": True, "my_estimator": False}
    assert output["passed"] is False and output["estimators"]["my_estimator"]["outcomes"] == {"error": 4}


@pytest.mark.slow
@pytest.mark.parametrize("words", [("bench:perfect", "--name", "mine"), ("--command", ":perfect", "--name", "mine")])
def test_nobody_else_answers_from_the_truth(words, executor, tmp_path, run):
    (tmp_path / "bench.py").touch()
    code, out, err = run("verify", *words, "--quick", "--seed", "3")
    assert code in (1, 2) and "✓ passes" not in out and "4 answered" not in out, out + err


def test_a_result_of_the_truth_under_another_name_is_refused(executor, tmp_path, run):
    run(*QUICK)
    written = Result.read(tmp_path / "results" / "perfect.json")
    forged = replace(written, estimator=replace(written.estimator, name="mine"))
    (tmp_path / "mine.json").write_text(forged.to_json())
    refused("mine answers from the truth", Result.read, tmp_path / "mine.json")


def test_an_interrupted_run_says_how_to_go_on(executor, run):
    executor.after = 3
    code, _, err = run(*QUICK)
    assert code == 130
    kept = f"3 of 4 trials kept in {Path('results') / 'journals'}"
    assert f"interrupted; {kept}; run the command again to resume: hmtb verify perfect --quick" in err
    executor.after = 10
    assert run(*QUICK)[0] == 0
    assert executor.asked == 4


def test_a_lesser_run_is_refused_beside_a_fuller_result_and_a_fuller_one_is_not(complaint, executor, tmp_path, run):
    fewer = (*QUICK, "--records", "1")
    assert run(*fewer)[0] == 1  # too few for its figure
    assert run(*QUICK)[0] == 0
    says = complaint(*fewer)
    assert "perfect.json has the result of a more complete run, with records that this run does not ask" in says
    assert executor.asked == 4
    assert run(*fewer, "--out", "less")[0] == 1
    assert run("verify", "perfect", "--seed", "3")[0] == 0
    assert Result.read(tmp_path / "results" / "perfect.json").effort == "full"


def test_the_list_says_what_can_run_here(executor, result, printed):
    output = result("verify", "--list")["estimators"]
    assert output["our-oe"]["available"] and output["our-oe"]["structure"] == "oe"
    assert all(entry["available"] or entry["why"] for entry in output.values())
    out = printed("verify", "--list")
    assert all(name[:12] in out for name in output)


@pytest.mark.parametrize(
    ("words", "says"),
    [
        ((), "no estimator given; expected MODULE:FUNCTION"),
        (("our-oee",), "unknown estimator 'our-oee': did you mean 'our-oe'"),
        (("nowhere:estimator",), "no module 'nowhere' is found"),
        (("nowhere.py:estimator",), "there is no file 'nowhere.py'"),
        (("mine:",), "expected MODULE:FUNCTION or FILE.py:FUNCTION"),
        (("my-file.py:estimator",), "expected a file whose name can be imported"),
        (("our-oe", "our-oe"), "given twice: our-oe"),
        (("our-oe", "--name", "mine"), "--name mine given without an estimator of your own"),
        (("mine:a", "mine:b", "--name", "c"), "--name c given with 2 estimators of your own, expected one"),
        (("mine:my_estimator", "--stays"), "--stays given without --command"),
        (("--command", "'"), "which is no command line"),
        (("--command", " "), "an empty --command given"),
        (("perfect", "--figures", "fewer"), "unknown figure 'fewer': did you mean 'few'?"),
        (("perfect", "--seed", "-1"), "seed -1 given"),
        (("perfect", "--seconds", "0"), "a limit of 0 s given, expected a finite time"),
        (("perfect", "--memory-gib", "0.01"), "bytes given, expected at least"),
        (("perfect", "--memory-gib", "nan"), "--memory-gib nan given, expected more than 0"),
        (("perfect", "--memory-gib", "1e300"), "--memory-gib 1e+300 given"),
        (("mine.py:my_estimator", "--name", "\x1b[31m"), "that can be printed; --name"),
        (("mine.py:my_estimator", "--name", "m" * 101), "expected at most 100 characters"),
        (("perfect", "--cluster", "here"), "expected the address of a Dask scheduler"),
        (("perfect", "--cluster", "tcp://a:1", "--workers", "2"), "--workers and --cluster given"),
        (("perfect", "--structure", "tf"), "structure"),
    ],
)
def test_what_cannot_be_is_refused_before_anything_is_made(complaint, executor, tmp_path, words, says):
    (tmp_path / "mine.py").write_text(MODULE)
    (tmp_path / "my-file.py").write_text(MODULE)
    assert says in complaint("verify", *words)
    assert not (tmp_path / "results").exists()
