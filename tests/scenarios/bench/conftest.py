"""Results of simulated estimators: good ones, biased ones, ones that fail, ones without a verdict."""

import shutil
from dataclasses import replace

import numpy as np
import pytest

from scenarios.bench.bias import ALONE
from scenarios.bench.measurement import Measurement
from scenarios.bench.metrics import ALL_METRICS
from scenarios.bench.result import Result
from scenarios.bench.tests_and_orders import PROBLEMS
from scenarios.estimators.estimator import Estimator, Limits
from scenarios.problems.trial import TWIN
from tests.scenarios.bench.judging import evaluated, on_arm, residuals, saved
from tests.scenarios.bench.simulated import Fault, simulated

TRIALS = sorted({t for metric in ALL_METRICS for t in metric.trials("quick") if t.problem != ALONE})


def measured(trial, fault, rng):
    if trial.problem.startswith(TWIN):
        if rng.random() < fault.failing:
            return Measurement(trial, "unstable")
        return replace(on_arm(trial, lambda response: fault.gain * response), bandwidth_hz=rng.normal(1.0, 0.1, (1, 1)))
    (one,) = simulated([trial], fault, rng)
    tested = trial.problem in PROBLEMS and one.kind == "model"
    return replace(one, **residuals(trial, rng, None)) if tested else one


def result(name, fault=Fault(), coloured=None, multiples=6.0, **more):  # noqa: B008
    """Result of an estimator with a fault; under coloured disturbances with another one, where it is output error."""
    rng = np.random.default_rng(1)
    target = f"my_module:{name.split()[0]}"
    estimator = Estimator(name, target, version="1.2.3", method="pem", structure="oe" if coloured else None)
    data = {}
    for trial in TRIALS:
        one = measured(trial, coloured if coloured and trial.problem[:2] in ("p3", "p4") else fault, rng)
        data[trial] = replace(one, seconds=1e-3 * multiples * rng.uniform(0.97, 1.03), ruler_seconds=1e-3)
    made = [evaluated(m, [data[t] for t in m.trials("quick") if t in data], estimator) for m in ALL_METRICS]
    plain = Result(
        estimator=estimator,
        limits=Limits(),
        effort="quick",
        seed=7,
        command=f"hmtb verify {target} --name '{name}' --seed 7",
        source="ab" * 32,
        versions={"hmtb-twin": "0.1.0", "numpy": "2.3.1"},
        machine="a processor, 2 cores",
        outcomes={"model": 900},
        reasons={},
        seconds=36.5,
        metrics={metric.name: metric for metric in made},
        run="one",
    )
    return replace(plain, **more)


HOSTILE = "<script>alert('1')</script> | `rm` $x^2$ [a](javascript:b) \u202eesrever"


@pytest.fixture(scope="session")
def results():
    """Seven estimators: one passes all, one fails where theory says, others fail in their own ways."""
    late = {"delays are one sample too long": 2}
    unstable = {"outcomes": {"model": 27, "unstable": 873}, "reasons": {f"{HOSTILE}\nTraceback": 873}}
    truth = {"small_signal": 1.03, "best_linear": 0.95, "best_linear_ci95": [0.93, 0.97], "published": {}}
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("scenarios.bench.bandwidth.true_bandwidths", lambda name: (0.2, truth))
        return (
            result("one_sample_late", Fault(delay=1, gain=1.1, claimed=0.1), reasons=late),
            result("armax"),
            result("oe", coloured=Fault(variance=4.0, claimed=0.25), multiples=9.0),
            result("okid", Fault(variance=1.9), multiples=2.0),
            result("n4sid", Fault(variance=1.25, claimed_share=0.0), multiples=0.8),
            result("a programme of another language with a name too long for any column", multiples=900.0),
            result(HOSTILE, Fault(failing=0.97), **unstable),
        )


@pytest.fixture(scope="session")
def originals(results, tmp_path_factory):
    folder = tmp_path_factory.mktemp("originals")
    for number, made in enumerate(results):
        saved(folder / f"{number}.json", made)
    return folder


@pytest.fixture
def written(originals, tmp_path):
    """Their files, to be changed at will."""
    folder = shutil.copytree(originals, tmp_path / "results")
    return sorted(folder.iterdir())
