"""Results made up as runs of the bench write them: good ones, biased ones, ones that fail, ones without a verdict."""

import json
import math
import shutil
from dataclasses import replace
from functools import reduce
from operator import getitem

import numpy as np
import pytest

from scenarios.bench.metric import Metric, Part
from scenarios.bench.result import Result
from scenarios.estimators.estimator import Estimator, Limits

PROBLEMS = ("p2", "p3", "p4", "p5")
NAN = math.nan
ANY = (-math.inf, math.inf)


def part(label, value, expected, limits, why="", **more):
    known = math.isfinite(value)
    interval = (value - 0.1 * abs(value), value + 0.1 * abs(value)) if known else (NAN, NAN)
    passed = limits[0] <= value <= limits[1] if known and limits != ANY else None
    return Part(label, value, expected, interval, limits, passed, why=why, draws=100 if known else 0, **more)


def figure(name, title, unit, parts, curves=None):
    judged = [p for p in parts if p.passed is not None and p.theory]
    worst = next((p for p in judged if not p.passed), (judged or parts)[0])
    passed = all(p.passed for p in judged) if judged else None
    numbers = (worst.value, worst.expected, worst.interval, passed)
    return Metric(name, title, unit, *numbers, 5e-4, f"{title} by problem", parts, curves or {})


def figures(*, efficiency=1.02, covered=95.0, bias=0.05, digits=13.2, failed=0, multiples=6.0, coloured=""):
    """Metrics of an estimator: error over bound, percent covered, bias, digits, failures in 100, times the reference,
    and why theory does not expect efficiency under coloured disturbances, where it does not.
    """
    rng = np.random.default_rng(1)
    factors = rng.uniform(0.97, 1.03, len(PROBLEMS)).tolist()
    none = failed > 50
    poor = {name: bool(coloured) and name in ("p3", "p4") for name in PROBLEMS}

    def on_problem(name, value, expected, limits, worse):
        if none:
            return part(name, NAN, expected, ANY, "no verdict: 3 of 100 records have a value")
        if poor[name]:
            return part(name, value * worse, expected, limits, coloured, theory=False)
        return part(name, value, expected, limits)

    def by_problem(value, expected, limits, worse=1.0):
        spread = zip(PROBLEMS, factors, strict=True)
        return tuple(on_problem(name, value * factor, expected, limits, worse) for name, factor in spread)

    quiet = tuple(part(f"quiet-{o}-{k}", digits - 0.3 * o, 14.0, (8.0, math.inf)) for o in (1, 2, 3, 4) for k in (1, 2))
    times = [part(name, multiples * f, NAN, ANY, "not judged") for name, f in zip(PROBLEMS, factors, strict=True)]
    hz = np.geomspace(0.1, 25.0, 30)
    gain = 1.0 / np.sqrt(1.0 + hz**2)
    deviation = 0.02 * np.sqrt(gain)
    curves = {
        name: {
            "frequencies_hz": hz.tolist(),
            "truth": gain[:, None, None].tolist(),
            "error": (np.sqrt(efficiency * (2.1 if poor[name] else 1.0)) * deviation)[:, None, None].tolist(),
            "claimed": deviation[:, None, None].tolist() if covered < 99.0 else None,
            "bound": deviation[:, None, None].tolist(),
            "relative_error_percent": 2.0 * factor * math.sqrt(efficiency),
        }
        for name, factor in zip(PROBLEMS, factors, strict=True)
        if not none
    }
    rows = {
        "mrad": [5, 10, 40],
        **{"systematic": [9.0 * efficiency, 2.0, 1.0], "noise": [2.0, 1.0, 0.0], "distortion": [8.0, 4.0, 1.5]},
        **{"expected_noise": [1.9, 0.9, 0.3], "expected_distortion": [7.0, 3.5, 1.4]},
        "systematic_limit": [5.5, 5.2, 5.1],
        "systematic_interval": [[8.0, 10.0 * efficiency], [1.0, 3.0], [NAN, NAN]],
        **{name: [[0.5, 9.0], [0.4, 5.0], [0.0, 2.0]] for name in ("noise_interval", "distortion_interval")},
    }
    split = {} if none else {"shoulder_yaw": rows, "elbow_pitch": rows}
    hertz = [
        {
            "label": f"{joint} {kind} {mrad:g} mrad", "mrad": mrad, "models": 10, "small_signal": 1.03,
            "best_linear": best,
            "hz": [] if none else rng.normal(best * math.sqrt(min(efficiency, 3.0)), 0.02, 10).tolist(),
        }
        for joint in ("shoulder_yaw", "elbow_pitch")
        for kind, mrad, best in (("multisine", 5.0, 0.7), ("multisine", 40.0, 0.95), ("prbs", 67.0, 0.98))
    ]  # fmt: skip
    kinds = ("unstable", "error", "crash", "hang", "memory")
    share = tuple(part(kind, float(failed) if kind == "unstable" else 0.0, 0.0, (0.0, 0.0)) for kind in kinds)
    made = (
        figure("noise_free_recovery", "Recovery without noise", "digits", quiet),
        figure("efficiency", "Efficiency: variance against the Cramér-Rao bound", "variance / bound",
               by_problem(efficiency, 1.0, (-math.inf, 1.3), 2.1)),
        figure("coverage", "Coverage of 95 % intervals", "%", by_problem(covered, 95.0, (91.0, 98.0), 0.8)),
        figure("frequency_response", "Error of the frequency response against the claimed band",
               "claimed standard deviations", by_problem(math.sqrt(efficiency), 1.0, (0.9, 1.15), 1.4), curves),
        figure("bias", "Bias under feedback and under a shared waveform", "deviations of one record",
               (part("feedback", bias, 0.0, (0.0, 0.9)), part("shared", NAN, NAN, ANY, "it takes one input"))),
        figure("amplitude_split", "Split over amplitude", "%",
               (part("shoulder_yaw 5 mrad, systematic", 9.0 * efficiency, 0.0, (-math.inf, 10.0)),), split),
        figure("reliability", "Failures", "%", share),
        figure("speed", "Time of an estimate", "times the reference", tuple(times)),
        figure("bandwidth", "Recovered bandwidth", "Hz", (part("elbow_pitch prbs 67 mrad", 0.98, 0.98, ANY),),
               {"classes": hertz, "about_1_hz": [0.9, 1.1], "near": 3, "models": 30}),
        *(figure(name, name, "", (part("all", NAN, NAN, ANY, "no verdict: no record was run"),))
          for name in ("consistency", "normalised_error", "tests_and_orders", "agreement")),
    )  # fmt: skip
    return {f.name: f for f in made}


def result(name, made, **more):
    plain = Result(
        estimator=Estimator(name, f"my_module:{name.split()[0]}", version="1.2.3", method="pem", structure="oe"),
        limits=Limits(),
        effort="quick",
        seed=7,
        command=f"hmtb verify my_module:{name.split()[0]} --name '{name}' --seed 7",
        source="ab" * 32,
        versions={"hmtb-twin": "0.1.0", "numpy": "2.3.1"},
        machine="a processor, 2 cores",
        outcomes={"model": 900},
        reasons={},
        seconds=36.5,
        metrics=made,
        run="one",
    )
    return replace(plain, **more)


HOSTILE = "<script>alert('1')</script> | `rm` $x^2$ [a](javascript:b) \u202eesrever"


@pytest.fixture(scope="session")
def results():
    """Seven estimators: one passes all, one fails where theory says, others fail in their own ways."""
    late = "delays are one sample too long"
    coloured = "under a coloured disturbance output error is not efficient [Ljung1999, theorem 8.4]"
    return (
        result("one_sample_late", figures(efficiency=240.0, covered=3.0, bias=9.0, digits=1.3), reasons={late: 2}),
        result("armax", figures()),
        result("oe", figures(coloured=coloured, multiples=9.0)),
        result("okid", figures(efficiency=1.9, digits=11.0, multiples=2.0)),
        result("n4sid", figures(efficiency=1.25, multiples=0.8)),
        result("a programme of another language with a name too long for any column", figures(multiples=900.0)),
        result(
            HOSTILE, figures(failed=97), outcomes={"model": 27, "unstable": 873}, reasons={f"{HOSTILE}\nTraceback": 873}
        ),
    )


@pytest.fixture(scope="session")
def originals(results, tmp_path_factory):
    folder = tmp_path_factory.mktemp("originals")
    for number, made in enumerate(results):
        save(folder / f"{number}.json", made)
    return folder


@pytest.fixture
def written(originals, tmp_path):
    """Their files, to be changed at will."""
    folder = shutil.copytree(originals, tmp_path / "results")
    return sorted(folder.iterdir())


def save(path, made):
    path.write_text(made.to_json(), encoding="utf-8")
    return path


@pytest.fixture
def saved():
    """Writes a result."""
    return save


@pytest.fixture
def changed():
    """Writes the table of a result with other values at some places, named by their keys."""

    def write(table, changes, path):
        for place, value in changes:
            *keys, last = (int(key) if key.isdigit() else key for key in place.split())
            reduce(getitem, keys, table)[last] = value
        path.write_text(json.dumps(table), encoding="utf-8")
        return path

    return write
