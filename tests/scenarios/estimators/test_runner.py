"""Whatever an estimator does is an outcome with a reason, and nothing is left running."""

import errno
import os
import re
import shlex
import shutil
import subprocess
import sys
import time
import types
from dataclasses import replace
from pathlib import Path

import numpy as np
import psutil
import pytest

import sysid
from scenarios.estimators import runner
from scenarios.estimators.estimator import Estimator, Limits
from scenarios.estimators.model_numbers import answer_of
from scenarios.estimators.python_child import load
from scenarios.estimators.returned import numbers_of
from scenarios.estimators.runner import EstimatorProcess
from scenarios.estimators.seeds import draw_run_seed, task_seed
from tests.refusals import refused
from tests.scenarios.estimators.estimators import BEHAVIOURS
from tests.scenarios.estimators.programs import KINDS

HERE = Path(__file__).parent
LIMIT = 5.0  # s: an answer takes a tenth of a second, on a busy machine many times that
EXAMPLES = Path(__file__).parents[3] / "docs/examples"
PROGRAMS = {
    "good": ("model", ""),
    "refuses": ("refused", "no such structure"),
    "fails": ("error", "exit code 2; it printed 'bad luck'"),
    "dies": ("crash", "signal SIGSEGV"),
    "hangs": ("hang", "no answer within 5 s"),
    "nothing": ("malformed", "no model file written"),
    "two": ("malformed", "model.json, model.mat written"),
    "damaged": ("malformed", "model.nc is not a NetCDF4 file, or a damaged one"),
    "leaves": ("model", ""),
    "twice": ("model", ""),
    "claims": ("model", ""),
    "removes": ("malformed", "no model file written"),
}
STAYS = {**PROGRAMS, "refuses": ("refused", "and so on"), "fails": ("error", "and so on")}
OTHERS = ({"structure": "oe", "orders": {"nb": 1, "nf": 1, "nk": 1}}, {"orders": {}})
"""Tasks that the examples refuse."""
BEGUN = time.time()


def left_running():
    """Processes that the behaviours start and nothing else ends."""
    new = (one.info for one in psutil.process_iter(["cmdline", "create_time"]) if one.info["create_time"] > BEGUN)
    return [line for one in new if "sleep 1000." in (line := " ".join(one["cmdline"] or ()))]


@pytest.mark.slow
def test_functions(data, task):
    named = replace(data, name="twin-elbow")
    files = len(os.listdir("/proc/self/fd"))
    # Other tests of this process may keep workers of their own.
    children = set(psutil.Process().children())
    limits = Limits(seconds=LIMIT, memory_bytes=2**27)
    with EstimatorProcess(Estimator("any", "estimators.py:by_seed", home=str(HERE)), limits) as process:
        for number, (behaviour, (kind, why)) in enumerate(BEHAVIOURS.items()):
            outcome = process.ask(named, replace(task, seed=number))
            assert (outcome.kind, why in outcome.why) == (kind, True), f"{behaviour.__name__}: {vars(outcome)}"
            assert outcome.why.isprintable() and outcome.wall < 12.0 * LIMIT
            assert (outcome.answer is not None) == (kind in ("model", "unstable"))
        outcome, folder = process.ask(data, replace(task, seed=0)), process._folder
    # Fewer where the process that reads files for earlier tests has ended meanwhile.
    assert not folder.exists() and len(os.listdir("/proc/self/fd")) <= files
    assert set(psutil.Process().children()) <= children and not left_running()
    # The answer is that of a direct call to the last bit, claims included; time and memory are measured.
    direct = sysid.arx(data, 1, 1, 1)
    for name in ("A", "B", "C", "D", "K", "innovation_covariance"):
        np.testing.assert_array_equal(getattr(outcome.answer.model, name), getattr(direct.model, name))
    np.testing.assert_array_equal(outcome.answer.covariance, direct.covariance)
    response = direct.frequency_response(task.frequencies)
    np.testing.assert_array_equal(outcome.answer.response_covariance, response.covariance)
    np.testing.assert_array_equal(outcome.answer.bandwidth_ci95, direct.bandwidth().ci95)
    assert 0.0 < outcome.seconds < 10.0 and outcome.peak_bytes > 2**20


@pytest.mark.slow
def test_the_process_of_a_function_loads_no_physics():
    """It would take half a second at each start, and count as memory that the function has."""
    code = "import sys, scenarios.estimators.python_child; sys.exit('mujoco' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0


@pytest.mark.slow
@pytest.mark.parametrize("stays", [False, True])
def test_programs(data, task, stays):
    command = f"{sys.executable} -S programs.py {'stay' if stays else 'once'} {{task}} {{model}} {{csv}}"
    estimator = Estimator("program", command, program=True, stays=stays, home=str(HERE))
    with EstimatorProcess(estimator, Limits(seconds=LIMIT)) as process:
        for number, name in enumerate(KINDS):
            kind, why = (STAYS if stays else PROGRAMS)[name]
            outcome = process.ask(data, replace(task, seed=number))
            assert (outcome.kind, why in outcome.why) == (kind, True), f"{name}: {vars(outcome)}"
            assert outcome.why.isprintable() and outcome.seconds >= 0.0
            if stays and name == "twice":
                # Its second answer does not answer the next request.
                time.sleep(0.1)
        outcome = process.ask(data, replace(task, seed=0))
        assert outcome.kind == "model" and 0.0 < outcome.seconds < 1.0, outcome.why
    assert not left_running()


def test_memory_of_a_program_is_limited_with_that_of_its_children(data, task):
    eats = "import time; held = b'1' * 2**28; time.sleep(99)"
    parent = f"import subprocess, sys; subprocess.run([sys.executable, '-S', '-c', {eats!r}])"
    command = shlex.join([sys.executable, "-S", "-c", parent, "{csv}", "{model}"])
    with EstimatorProcess(Estimator("eater", command, program=True), Limits(memory_bytes=2**27)) as process:
        outcome = process.ask(data, task)
    assert (outcome.kind, outcome.why) == ("memory", "more than 128 MiB")
    assert outcome.peak_bytes > 2**27


@pytest.mark.parametrize("text", ["", "-5", "nan", "inf", "1e400", "soon"])
def test_a_processor_time_that_is_none_is_measured(text):
    assert runner._reported_seconds(text, 0.5) == 0.5
    assert runner._reported_seconds("0.0123", 0.5) == 0.0123


def test_a_function_that_removes_its_folder_is_asked_again(data, task, tmp_path):
    removes = "    shutil.rmtree(os.path.dirname(os.getcwd()))\n    os._exit(1)\n"
    code = f"import os, shutil\ndef estimate(data, task):\n{removes}"
    (tmp_path / "removes.py").write_text(code)
    with EstimatorProcess(Estimator("removes", "removes.py:estimate", home=str(tmp_path)), Limits()) as process:
        outcomes = [process.ask(data, task) for _ in range(2)]
    assert [outcome.kind for outcome in outcomes] == ["crash", "crash"]
    assert all("exit code 1" in outcome.why for outcome in outcomes)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("target", "options", "why"),
    [
        ("no_such_package:f", {}, "cannot load 'no_such_package:f' of 'none'"),
        ("no-such-program {data} {model}", {"program": True}, "no program 'no-such-program'"),
        ("true {model}", {"program": True}, "expected one of {data}, {mat}, {csv}, {npz} where it reads"),
        ("true {mat}", {"program": True}, "{model} where it writes"),
        ("true '{mat} {model}", {"program": True}, "No closing quotation"),
        ("echo {mat} {model}", {"program": True, "stays": True}, "to print the line 'ready 1'"),
    ],
)
def test_estimators_that_cannot_start_end_the_run_at_once(target, options, why):
    refused(re.escape(why), EstimatorProcess(Estimator("none", target, **options), Limits()).__enter__)


@pytest.mark.parametrize(
    ("target", "why"),
    [
        ("estimators.py:arxx", "has no 'arxx'; it has arx, "),
        ("estimators.py:BEHAVIOURS", "is of type dict, expected a function"),
        ("estimator.py:arx", "no file "),
        ("estimators.py", "expected module:function or path/to/file.py:function"),
    ],
)
def test_targets_that_are_no_functions(target, why, monkeypatch):
    monkeypatch.setattr(sys, "path", [*sys.path])
    monkeypatch.setitem(sys.modules, "estimators", types.ModuleType("estimators"))
    with pytest.raises(ImportError, match=re.escape(why)):
        load(target, HERE)
    assert load("estimators.py:GOOD.is_stable", HERE)()


@pytest.mark.parametrize("number", [errno.ENOSPC, errno.EIO])
def test_a_full_disk_ends_the_bench(number, data, task, monkeypatch):
    def fail(*_):
        raise OSError(number, os.strerror(number))

    monkeypatch.setattr(runner, "write_request", fail)
    with EstimatorProcess(Estimator("any", "true {csv} {model}", program=True), Limits()) as process:
        if number == errno.ENOSPC:
            refused(r"No space left on device; expected space in", process.ask, data, task)
        else:
            assert process.ask(data, task).kind == "error"


def test_seeds_of_a_run_and_of_its_tasks():
    """The seed of a run is drawn anew each time; that of a task depends on both, fits other languages."""
    seeds = {draw_run_seed(["hash"]) for _ in range(5)}
    assert len(seeds) == 5 and all(0 <= seed < 2**53 for seed in seeds)
    tasks = [task_seed(run, key) for run in (0, 1) for key in ("p1#0/fit", "p1#1/fit")]
    assert len(set(tasks)) == 4 and all(0 <= seed < 2**31 for seed in tasks)
    assert task_seed(0, "p1#0/fit") == tasks[0]


def test_the_example_in_python_is_our_arx(data, task):
    estimate = load("arx_estimator.py:estimate", EXAMPLES)
    data = replace(data, window=0)
    check_example(answer_of(numbers_of(estimate(data, task), data, task), data, task), data, task)
    for other in OTHERS:
        with pytest.raises(NotImplementedError):
            estimate(data, replace(task, **other))


@pytest.mark.slow
@pytest.mark.skipif(shutil.which("octave-cli") is None, reason="Octave is not installed")
@pytest.mark.parametrize("stays", [False, True])
def test_the_examples_in_octave_are_our_arx(data, task, stays):
    words = "serve_arx # {mat} {task} {model}" if stays else "exit(estimate_arx('{mat}', '{task}', '{model}'))"
    command = shlex.join(["octave-cli", "--norc", "--path", str(EXAMPLES), "--eval", words])
    data = replace(data, window=0)
    with EstimatorProcess(Estimator("example", command, program=True, stays=stays), Limits()) as process:
        outcome = process.ask(data, task)
        others = [process.ask(data, replace(task, **other)) for other in (OTHERS if stays else OTHERS[:1])]
    check_example(outcome.answer, data, task)
    assert {other.kind for other in others} == {"refused"}


def check_example(answer, data, task):
    """It is what `sysid.arx` returns, covariances included."""
    ours = sysid.arx(data, 1, 1, 1)
    np.testing.assert_allclose(answer.polynomials.A, ours.polynomials.A, rtol=1e-9)
    np.testing.assert_allclose(answer.polynomials.B, ours.polynomials.B, rtol=1e-9)
    np.testing.assert_allclose(answer.covariance, ours.covariance, rtol=1e-6)
    claimed = ours.frequency_response(task.frequencies).covariance
    np.testing.assert_allclose(answer.response_covariance, claimed, rtol=1e-4, atol=1e-12)
    np.testing.assert_allclose(answer.bandwidth_ci95, ours.bandwidth().ci95, rtol=1e-6)


@pytest.mark.parametrize("stays", [False, True])
def test_reasons_are_the_same_for_each_request(data, task, stays):
    """Paths of files stand as placeholders, so that reasons can be counted."""
    once = "import sys; sys.stderr.write('y' * 10 + ' '.join(sys.argv[1:]) + '.json ' + 'x' * 240); sys.exit(3)"
    stay = (
        "import json\nprint('ready 1', flush=True)\nwhile True:\n    places = json.loads(input())\n"
        "    print('error', 'x' * 280, places['csv'], places['model'], flush=True)"
    )
    command = f"{sys.executable} -S -c {shlex.quote(stay if stays else once)} {{csv}} {{model}}"
    estimator, reasons = Estimator("program", command, program=True, stays=stays), set()
    for _ in range(2):
        with EstimatorProcess(estimator, Limits(seconds=5.0)) as process:
            reasons |= {process.ask(data, task).why for _ in range(2)}
    assert len(reasons) == 1, reasons
    (why,) = reasons
    expected = "x" * 280 + " {csv} {model}" if stays else "yyyyyyyyyy{csv} {model}.json xxx"
    assert expected in why and "hmtb-estimator" not in why
