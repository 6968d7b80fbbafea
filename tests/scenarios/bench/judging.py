"""Metrics evaluated on measurements that are made up, and their results in files."""

import json
from functools import reduce
from operator import getitem
from zlib import crc32

import numpy as np

from scenarios.bench.measurement import Measurement
from scenarios.bench.metric import Evidence
from scenarios.bench.tests_and_orders import order_of
from scenarios.estimators.estimator import Estimator
from scenarios.problems.registry import problem

ANYONE = Estimator("anyone", ":perfect")
ALARM = 1e-4
LINES = np.arange(1, 26) / 5.12
LINEAR = 1.0 / (1.0 + 1j * LINES) ** 2


def evaluated(definition, measurements, estimator=ANYONE, reference=()):
    return definition.evaluate(Evidence(measurements, estimator, ALARM, reference))


def parts_of(metric):
    return {part.label: part for part in metric.parts}


def failing(metric):
    return {part.label for part in metric.parts if part.passed is False}


def without_model(measurements, lost, kind="crash", why="so it is"):
    return [Measurement(m.trial, kind, why) if lost(m) else m for m in measurements]


def on_arm(trial, change=lambda response: response):
    """A response with half of the distortion and noise of the record, changed."""
    seeds = (crc32(text.encode()) for text in (trial.problem, trial.key))
    distortion, error = (np.random.default_rng(seed).standard_normal((25, 2)) @ (1, 1j) for seed in seeds)
    shown = LINEAR + 0.02 * distortion + 0.005 * error
    response = change(0.5 * (LINEAR + shown))
    return Measurement(trial, "model", response=response[:, None, None], nonparametric=shown[:, None, None])


def residuals(trial, rng, structure):
    """Order and p-values of a perfect estimator of a structure: orders too low are rejected."""
    task = problem(trial.problem).task(structure, "fit" if trial.ask == "select" else trial.ask)
    white, independent = (1e-9, 1e-9) if trial.ask == "underfit" else rng.uniform(size=2)
    return {"order": order_of(task), "whiteness_p": white, "independence_p": independent}


def saved(path, result):
    path.write_text(result.to_json(), encoding="utf-8")
    return path


def changed(table, changes, path):
    """Write the table of a result with other values at some places, named by their keys."""
    for place, value in changes:
        *keys, last = (int(key) if key.isdigit() else key for key in place.split())
        reduce(getitem, keys, table)[last] = value
    path.write_text(json.dumps(table), encoding="utf-8")
    return path
