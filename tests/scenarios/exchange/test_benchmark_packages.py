"""Data sets in the installed packages nonlinear_benchmarks and IdentiBench: their code takes them, the scores agree."""

import identibench
import numpy as np
import pytest
from nonlinear_benchmarks.error_metrics import RMSE
from nonlinear_benchmarks.utilities import Input_output_data

from scenarios.datasets.score import score
from scenarios.exchange.benchmark_packages import identibench_spec, nonlinear_benchmark
from tests.refusals import refused

NAME = "tiny-v1"


@pytest.fixture
def cache(tiny, tiny_spec, monkeypatch):
    """The cache holds the tiny data set, as if the package had it."""
    monkeypatch.setattr("scenarios.datasets.canonical.shipped", lambda: {NAME: tiny_spec})
    return tiny.parent


def test_parts_are_theirs(cache, data_set):
    train, test = nonlinear_benchmark(NAME, joint="elbow_pitch", cache=cache)
    assert isinstance(test, Input_output_data | tuple)
    ours = data_set.select(joint="elbow_pitch")
    for theirs, records in ((train, (*ours.train, *ours.validation)), (test, ours.test)):
        theirs = (theirs,) if isinstance(theirs, Input_output_data) else theirs
        assert [one.name for one in theirs] == [one.name for one in records]
        for one, record in zip(theirs, records, strict=True):
            assert np.array_equal(one.u, record.u) and np.array_equal(one.y, record.y)
            assert one.sampling_time == 0.02
            assert one.state_initialization_window_length == record.state_initialization_window_length
            assert len(one[10:20]) == 10 and RMSE(one.y, one.y) == 0.0


@pytest.mark.slow
def test_shapes_and_tuples_as_they_name_them(cache, data_set):
    train, test = nonlinear_benchmark(NAME, block="noise", cache=cache, train_test_split=False, atleast_2d=True), None
    assert [one.y.shape for one in train] == [(200, 1)] and test is None
    pair = nonlinear_benchmark(NAME, joint="elbow_pitch", cache=cache, always_return_tuples_of_datasets=True)
    assert all(isinstance(part, tuple) for part in pair)
    refused("no training records selected", nonlinear_benchmark, NAME, block="noise", cache=cache)
    refused("unknown data set 'tiny'", nonlinear_benchmark, "tiny", cache=cache)


def mean_of_training(context):
    mean = np.concatenate([one.y for one in context.get_train_sequences()]).mean(axis=0)
    return lambda u, y_init, attrs: np.tile(mean, (len(u), 1))


@pytest.mark.slow
def test_identibench_gives_the_score_of_the_data_set(cache, data_set, tmp_path):
    with identibench.utils.data_root(tmp_path):
        spec = identibench_spec(NAME, joint="elbow_pitch", cache=cache)
        result = identibench.run_benchmark(spec, mean_of_training)
    ours = data_set.select(joint="elbow_pitch")
    mean = np.concatenate([one.y for one in ours.train]).mean()
    expected = score({one.name: np.full((len(one), 1), mean) for one in ours.test}, ours)
    assert result["metric_score"] == pytest.approx(expected.mean, rel=1e-4)
    assert result["benchmark_name"] == f"{NAME}-elbow_pitch"


def test_a_benchmark_has_one_set_of_channels(cache):
    refused("tiny-v1 has records of different joints; expected joint=", identibench_spec, NAME, cache=cache)
