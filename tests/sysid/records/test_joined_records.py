"""Records joined by `+`, and their figures."""

import numpy as np
import pytest
from scipy.signal import lfilter

import sysid
from sysid import IOData, SysidError


def _record(seed, **labels):
    u = np.random.default_rng(seed).standard_normal(200)
    return IOData(u, lfilter([0.0, 0.5], [1.0, -0.8], u), 0.1, **labels)


def test_sums_are_experiments_that_estimators_take():
    data = _record(1) + _record(2) + _record(3)
    assert len(data) == 3
    assert len(data + data) == 6
    np.testing.assert_allclose(sysid.oe(data, 1, 1, 1).parameters, [0.5, -0.8], rtol=1e-6)
    assert str(data).count("200 samples") == 3


def test_channels_are_brought_in_the_sequence_of_the_first():
    values = np.random.default_rng(1).standard_normal((20, 2))
    first = IOData(values, values[:, 0], 0.1, input_names=("a", "b"))
    second = IOData(values[:, ::-1], values[:, 0], 0.1, input_names=("b", "a"))
    np.testing.assert_array_equal((first + second)[1].u, values)


@pytest.mark.parametrize(
    ("other", "message"),
    [
        (IOData(np.ones(9), np.ones(9), 0.2), "sampled every 0.2 s, the first every 0.1 s"),
        (IOData(np.ones((9, 2)), np.ones(9), 0.1), "2 input"),
        (_record(2, output_units=("deg",)), "output_units are .*deg.*, those of the first .*rad"),
        (_record(2, output_names=("elbow",)), "elbow"),
    ],
)
def test_records_that_do_not_belong_together(other, message):
    with pytest.raises(SysidError, match=message):
        _record(1, output_units=("rad",), output_names=("wrist",)) + other


def test_only_records_are_joined():
    with pytest.raises(TypeError):
        _record(1) + 1.0
    arrays = [np.ones(3)]
    with pytest.raises(SysidError, match="experiment 1: expected an IOData"):
        _record(1) + arrays


def test_figures_have_a_panel_for_each_channel_and_a_line_for_each_experiment():
    record = _record(1, output_units=("rad",), input_units=("V",), output_names=("elbow",))
    figure = record.plot()
    assert [axes.get_ylabel() for axes in figure.axes] == ["elbow / rad", "u1 / V"]
    several = (record + _record(2, output_names=("elbow",))).plot()
    assert [text.get_text() for text in several.legends[0].get_texts()] == ["experiment 1", "experiment 2"]


def test_sum_joins_records_and_each_loses_its_own_mean():
    one, other = _record(1), _record(2).subtract(y=-5.0)
    together = sum([one, other])
    assert list(map(len, together)) == [200, 200]
    for experiment in together.detrend():
        np.testing.assert_allclose(experiment.y.mean(axis=0), 0.0, atol=1e-12)
    with pytest.raises(TypeError):
        3 + one
