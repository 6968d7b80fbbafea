"""Programs that read files and write a model: started anew, or told of one record after the other."""

import os
import re
import shlex
import shutil
import sys
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import sysid
from scenarios.estimators import process_tree
from scenarios.estimators.answer import Answer
from scenarios.estimators.command_line import unfilled
from scenarios.estimators.contestant import Contestant, Limits
from scenarios.estimators.model_numbers import answer_of
from scenarios.estimators.python_child import load
from scenarios.estimators.returned import numbers_of
from scenarios.estimators.sandbox import open_sandbox
from scenarios.estimators.task import Task
from scenarios.files.errors import ScenarioError
from tests.scenarios.estimators.programs import KINDS

HERE = Path(__file__).parent
EXAMPLES = Path(__file__).parents[3] / "docs/examples"
EXPECTED = {
    "good": ("model", ""),
    "refuses": ("refused", "no such structure"),
    "fails": ("error", "exit code 2; it printed 'bad luck'"),
    "dies": ("crash", "signal SIGSEGV"),
    "hangs": ("hang", "no answer within 1 s"),
    "nothing": ("malformed", "no file of a model written"),
    "two": ("malformed", "model.json, model.mat written"),
    "pipe": ("malformed", "model.json is no ordinary file"),
    "damaged": ("malformed", "model.nc is not a NetCDF4 file, or a damaged one"),
    "children": ("model", ""),
    "escapes": ("model", ""),
    "twice": ("model", ""),
}
OTHERS = ({"structure": "oe", "orders": {"nb": 1, "nf": 1, "nk": 1}}, {"orders": {}})
"""What the examples refuse."""
STAYS = {**EXPECTED, "refuses": ("refused", "and so on"), "fails": ("error", "and so on")}


@pytest.mark.parametrize("stays", [False, True])
def test_whatever_it_does_is_an_outcome(data: sysid.IOData, task: Task, stays: bool) -> None:
    command = f"{sys.executable} -S programs.py {'stay' if stays else 'once'} {{task}} {{model}} {{csv}}"
    contestant = Contestant("program", command, program=True, stays=stays, home=str(HERE))
    with open_sandbox(contestant, Limits(seconds=1.0)) as sandbox:
        folder = sandbox._folder.path
        for number, name in enumerate(KINDS):
            if stays and name == "damaged":
                # Read by the same process; it takes a second to start.
                continue
            kind, why = (STAYS if stays else EXPECTED)[name]
            got = sandbox.ask(data, replace(task, seed=number))
            assert (got.kind, why in got.why) == (kind, True), f"{name}: {got}"
            assert got.why.isprintable()
            # The files of each request are gone, but for those of a program that was told where they are.
            assert stays or not list(folder.iterdir())
            if stays and name == "twice":
                # Its second answer is none to the next request.
                time.sleep(0.1)
        got = sandbox.ask(data, replace(task, seed=0))
        assert got.kind == "model", got.why
    assert not folder.exists()
    assert not [pid for pid in process_tree.family(os.getpid()) if b"sleep" in process_tree._read(pid, "cmdline")]
    assert not [pid for pid in process_tree._pids() if b"1000.25" in process_tree._read(pid, "cmdline")]


@pytest.mark.parametrize(
    ("command", "stays", "why"),
    [
        ("no-such-program {data} {model}", False, "no program 'no-such-program'"),
        ("true {model}", False, "expected one of {data}, {mat}, {csv} where it reads"),
        ("true {mat}", False, "{model} where it writes"),
        ("true '{mat} {model}", False, "No closing quotation"),
        ("echo {mat} {model}", True, "expected a program that stays to print the line 'ready 1'"),
    ],
)
def test_a_command_that_cannot_be_is_said_at_once(command: str, stays: bool, why: str) -> None:
    with (
        pytest.raises(ScenarioError, match=re.escape(why)),
        open_sandbox(Contestant("none", command, program=True, stays=stays), Limits()),
    ):
        raise AssertionError("it opened")


def test_memory_of_a_program_is_limited(data: sysid.IOData, task: Task) -> None:
    """All of it counts, that of its children too."""
    eats = "import time; held = b'1' * 2**28; time.sleep(99)"
    parent = f"import subprocess, sys; subprocess.run([sys.executable, '-S', '-c', {eats!r}])"
    command = shlex.join([sys.executable, "-S", "-c", parent, "{csv}", "{model}"])
    with open_sandbox(Contestant("eater", command, program=True), Limits(memory_bytes=2**27)) as sandbox:
        got = sandbox.ask(data, task)
    assert (got.kind, got.why) == ("memory", "more than 128 MiB")
    assert got.peak_bytes > 2**27


def test_the_example_in_python_is_our_arx(data: sysid.IOData, task: Task) -> None:
    estimate = load("arx_estimator.py:estimate", EXAMPLES)
    data = replace(data, window=0)
    check_example(answer_of(numbers_of(estimate(data, task), data, task), data, task), data, task)
    for other in OTHERS:
        with pytest.raises(NotImplementedError):
            estimate(data, replace(task, **other))


@pytest.mark.skipif(shutil.which("octave-cli") is None, reason="Octave is not installed")
@pytest.mark.parametrize("stays", [False, True])
def test_the_examples_in_octave_are_our_arx(data: sysid.IOData, task: Task, stays: bool) -> None:
    words = "serve_arx # {mat} {task} {model}" if stays else "exit(estimate_arx('{mat}', '{task}', '{model}'))"
    command = shlex.join(["octave-cli", "--norc", "--path", str(EXAMPLES), "--eval", words])
    data = replace(data, window=0)
    with open_sandbox(Contestant("example", command, program=True, stays=stays), Limits()) as sandbox:
        got = sandbox.ask(data, task)
        # Where it stays these cost nothing; elsewhere each is a start of Octave.
        others = [sandbox.ask(data, replace(task, **other)) for other in (OTHERS if stays else OTHERS[:1])]
    assert got.answer is not None, got
    check_example(got.answer, data, task)
    assert {other.kind for other in others} == {"refused"}


def check_example(answer: Answer, data: sysid.IOData, task: Task) -> None:
    """It is what `sysid.arx` gives, covariances included."""
    ours = sysid.arx(data, 1, 1, 1)
    np.testing.assert_allclose(answer.polynomials.A, ours.polynomials.A, rtol=1e-9)
    np.testing.assert_allclose(answer.polynomials.B, ours.polynomials.B, rtol=1e-9)
    np.testing.assert_allclose(answer.covariance, ours.covariance, rtol=1e-6)
    claimed = ours.frequency_response(task.frequencies).covariance
    np.testing.assert_allclose(answer.response_covariance, claimed, rtol=1e-4, atol=1e-12)
    np.testing.assert_allclose(answer.bandwidth_ci95, ours.bandwidth().ci95, rtol=1e-6)


@pytest.mark.parametrize("stays", [False, True])
def test_reasons_are_the_same_for_each_request(data: sysid.IOData, task: Task, stays: bool) -> None:
    """Its files stand as placeholders, also at the edge of what is told of a long text."""
    once = "import sys; sys.stderr.write('y' * 10 + ' '.join(sys.argv[1:]) + '.json ' + 'x' * 240); sys.exit(3)"
    stay = (
        "import json\nprint('ready 1', flush=True)\nwhile True:\n    places = json.loads(input())\n"
        "    print('error', 'x' * 280, places['csv'], places['model'], flush=True)"
    )
    command = f"{sys.executable} -S -c {shlex.quote(stay if stays else once)} {{csv}} {{model}}"
    reasons = set()
    for _ in range(2):
        with open_sandbox(Contestant("program", command, program=True, stays=stays), Limits(seconds=5.0)) as sandbox:
            reasons |= {sandbox.ask(data, task).why for _ in range(2)}
    (why,) = reasons
    expected = "x" * 280 + " {csv} {model}" if stays else "yyyyyyyyyy{csv} {model}.json xxx"
    assert expected in why
    assert "hmtb-estimator" not in why


def test_other_files_of_a_request_stand_in_its_folder(tmp_path: Path) -> None:
    """By the folder's own name, and by what a link of that name leads to."""
    real, link = tmp_path / "real", tmp_path / "link"
    real.mkdir()
    link.symlink_to(real)
    text = f"{link}/data.csv, {real}/data.csv and {real}/own.txt"
    assert unfilled(text, {"csv": f"{link}/data.csv"}, link) == "{csv}, {csv} and {folder}/own.txt"
