"""Metrics evaluated on measurements that are made up."""

from scenarios.bench.measurement import Measurement
from scenarios.bench.metric import Evidence
from scenarios.estimators.estimator import Estimator

ANYONE = Estimator("anyone", "bench:perfect")
ALARM = 1e-4


def evaluated(definition, measurements, estimator=ANYONE, reference=()):
    return definition.evaluate(Evidence(measurements, estimator, ALARM, reference))


def parts_of(metric):
    return {part.label: part for part in metric.parts}


def failing(metric):
    return {part.label for part in metric.parts if part.passed is False}


def without_model(measurements, lost, kind="crash", why="so it is"):
    return [Measurement(m.trial, kind, why) if lost(m) else m for m in measurements]
