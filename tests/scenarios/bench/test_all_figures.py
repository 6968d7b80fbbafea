"""The list of figures."""

import itertools

import pytest

from scenarios.bench.measurement import Measurement
from scenarios.bench.metric import FALSE_ALARM
from scenarios.bench.metrics import ALL_METRICS, MODEL_METRICS, false_alarm_of_each
from scenarios.bench.verify import BenchPlan
from scenarios.estimators.estimator import Estimator
from scenarios.estimators.outcome import KINDS, MODEL

ANYONE = Estimator("anyone", "bench:perfect")


def test_names_are_different() -> None:
    names = [maker.name for maker in ALL_METRICS]
    assert len(names) == len(set(names))
    assert names[-2:] == ["reliability", "speed"]


def test_false_alarms_add_up() -> None:
    assert false_alarm_of_each() * sum(maker.verdicts for maker in ALL_METRICS) == pytest.approx(FALSE_ALARM)


def test_trials_are_told_once() -> None:
    trials = BenchPlan((ANYONE,), effort="quick").trials(ANYONE)
    assert len(trials) == len(set(trials))
    assert set(trials) == {trial for maker in MODEL_METRICS for trial in maker.trials("quick")}
    names = [trial.problem for trial in trials]
    assert len(set(names)) == 1 + sum(one != other for one, other in itertools.pairwise(names))


@pytest.mark.parametrize("kind", [kind for kind in KINDS if kind != MODEL])
def test_every_figure_copes_with_nothing_but_failures(kind: str) -> None:
    for maker in ALL_METRICS:
        measured = [Measurement(trial, kind, "so it is") for trial in maker.trials("quick")]
        found = maker.evaluate(measured, ANYONE, false_alarm_of_each(), ())
        judged = maker.name == "reliability" and kind != "refused"
        assert found.name == maker.name
        assert found.passed is (False if judged else None), maker.name


def test_every_figure_copes_with_nothing() -> None:
    for maker in ALL_METRICS:
        assert maker.evaluate([], ANYONE, false_alarm_of_each(), ()).passed is None
