from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.signal import butter, lfilter

from sysid import IOData, SysidError, arx, keep_band, prefilter, resample
from sysid.records import from_xarray
from sysid.records.data import as_experiments
from tests.refusals import refused


def record(samples=20, **kwargs):
    rng = np.random.default_rng(1)
    return IOData(rng.standard_normal((samples, 2)), rng.standard_normal((samples, 3)), 0.02, **kwargs)


def test_one_channel_may_be_one_dimensional_and_arrays_are_copied():
    data = IOData([1.0, 2.0, 4.0], [0, 1, 2], 0.5)
    assert data.u.shape == data.y.shape == (3, 1)
    assert data.y.dtype == np.float64
    assert data.input_names == ("u1",)
    np.testing.assert_array_equal(data.time, [0.0, 0.5, 1.0])
    u = np.arange(4.0)
    data = IOData(u, u, 1.0)
    u[0] = 99.0
    assert data.u[0, 0] == 0.0


@given(st.integers(0, 17), st.integers(3, 20), st.integers(0, 19))
def test_slices_keep_everything_and_shrink_the_window(start, length, window):
    data = record(window=window, input_names=("a", "b"), output_units=("rad", "m", ""), intersample="foh", name="run")
    stop = min(start + length, 20)
    left = max(window - start, 0)
    if left >= stop - start:
        refused("leaves nothing", lambda: data[start:stop])
        return
    part = data[start:stop]
    np.testing.assert_array_equal(part.y, data.y[start:stop])
    assert (part.window, part.input_names, part.output_units) == (left, ("a", "b"), ("rad", "m", ""))
    assert (part.intersample, part.name, part.dt) == ("foh", "run", 0.02)


@pytest.mark.parametrize("part", [3, slice(0, 10, 2), slice(5, 5), slice(30, 40)])
def test_bad_slices(part):
    with pytest.raises(SysidError):
        record()[part]


@pytest.mark.parametrize("order", [0, 1, 3])
def test_detrend_removes_polynomials_and_nothing_else(order):
    t = np.linspace(0, 1, 50)
    trend = np.polyval(np.arange(1, order + 2), t)
    wave = np.sin(40 * t)
    clean = IOData(wave, wave, 0.1).detrend(order)
    np.testing.assert_allclose(IOData(wave + trend, wave, 0.1).detrend(order).u, clean.u, atol=1e-12)
    np.testing.assert_allclose(clean.detrend(order).y, clean.y, atol=1e-13)
    if order == 0:
        np.testing.assert_allclose(clean.u[:, 0], wave - wave.mean(), atol=1e-14)


def test_the_trend_is_that_behind_the_initialisation_window():
    data = record(window=8).detrend()
    np.testing.assert_allclose(data.y[8:].mean(axis=0), 0.0, atol=1e-15)
    np.testing.assert_allclose(data.y[:8] - data.y[8], record().y[:8] - record().y[8], atol=1e-14)
    line = np.arange(20.0)
    spoilt = np.concatenate((np.full(8, 50.0), line[8:]))
    np.testing.assert_allclose(IOData(line, spoilt, 1.0, window=8).detrend(1).y[:, 0], spoilt - line, atol=1e-12)


def test_a_given_operating_point():
    data = record()
    part = data.subtract(u=[1.0, 2.0], y=0.5)
    np.testing.assert_allclose(part.u, data.u - [1.0, 2.0])
    np.testing.assert_allclose(part.y, data.y - 0.5)
    trend = np.arange(60.0).reshape(20, 3)
    np.testing.assert_allclose(data.subtract(y=trend).y, data.y - trend)
    np.testing.assert_array_equal(data.subtract(y=trend).u, data.u)
    refused(r"one per channel \(2,\)", lambda: data.subtract(u=[1.0, 2.0, 3.0]))


def test_the_record_keeps_its_operating_point():
    data = record()
    about = data.subtract(u=[0.1, 2.0], y=0.3).subtract(y=[1.0, 0.0, 0.0])[3:].select(inputs=[1])
    np.testing.assert_array_equal(about.input_offset, [2.0])
    np.testing.assert_allclose(about.output_offset, [1.3, 0.3, 0.3], rtol=1e-15)
    np.testing.assert_allclose(about.retrend().y, data.y[3:], atol=1e-14)
    assert data.input_offset is data.output_offset is about.retrend().input_offset is None
    np.testing.assert_allclose(data.detrend(1).output_offset, data.y.mean(axis=0))
    np.testing.assert_array_equal(from_xarray(about.to_xarray()).output_offset, about.output_offset)
    refused("output_offset: expected one value per channel", lambda: replace(data, input_offset=[1.0, 2.0]))


def test_select_by_name_and_index():
    data = record(input_names=("a", "b"), output_names=("x", "y", "z"), input_units=("V", "A"))
    part = data.select(inputs=["b"], outputs=[2, "x"])
    np.testing.assert_array_equal(part.y, data.y[:, [2, 0]])
    assert (part.input_names, part.input_units, part.output_names) == (("b",), ("A",), ("z", "x"))
    refused(r"available: .*x, y, z", lambda: data.select(outputs=["w"]))
    refused("at least one input", lambda: data.select(inputs=[]))


@pytest.mark.parametrize(
    ("u", "y", "dt", "message"),
    [
        ([1, 2, 3], [1, 2], 0.1, "u has 3 samples, y has 2"),
        ([[1, 0], [2, np.nan], [3, 0]], [1, 2, 3], 0.1, "channel 1 at index 1"),
        ([1, 2, 3], [1, np.inf, 3], 0.1, "y: 1 sample.* channel 0 at index 1"),
        ([1j, 2, 3], [1, 2, 3], 0.1, "real numbers"),
        ([], [], 0.1, "at least one sample"),
        (np.ones((2, 9)), np.ones(2), 0.1, "more channels than samples"),
        (np.ones((2, 2, 2)), np.ones(2), 0.1, "time first"),
        ([1, 2], [1, 2], 0.0, "1e-15 and 1e15 s"),
        ([1, 2], [1, 2], 5e-324, "1e-15 and 1e15 s"),
        ([1, 2], [1, 2], "fast", "1e-15 and 1e15 s"),
    ],
)
def test_bad_input_is_named(u, y, dt, message):
    refused(message, lambda: IOData(u, y, dt))


@pytest.mark.slow
@pytest.mark.parametrize(
    "options", [{"window": 3}, {"window": -1}, {"window": 1.5}, {"input_names": ("a", "b")}, {"intersample": "spline"}]
)
def test_bad_options(options):
    refused(".", IOData, [1, 2, 3], [1, 2, 3], 1.0, **options)


def test_experiments_must_belong_together():
    a, b = IOData([1, 2], [1, 2], 1.0), IOData([1, 2], [1, 2], 2.0)
    assert as_experiments(a) == (a,)
    refused("sampled every", lambda: as_experiments([a, b]))
    refused("2 input", lambda: as_experiments([a, IOData(np.ones((3, 2)), np.ones(3), 1.0)]))
    refused("at least one", lambda: as_experiments([]))
    refused("got int", lambda: as_experiments([a, 3]))


def test_a_slice_keeps_the_time_of_the_whole():
    data = IOData(np.arange(10.0), np.arange(10.0), 0.5, start=3.0)
    np.testing.assert_allclose(data.time[[0, -1]], [3.0, 7.5])
    part = data[4:][1:3]
    np.testing.assert_allclose(part.time, data.time[5:7])
    assert part.detrend().start == part.start == 5.5
    refused("start must be a finite time in s, got inf", lambda: IOData(np.ones(3), np.ones(3), 0.5, start=np.inf))


def test_a_prefiltered_record_has_the_same_model():
    u = np.random.default_rng(0).standard_normal(400)
    data = IOData(u, lfilter([0, 1, 0.5], [1, -1.5, 0.7], u), 0.1, window=5, name="run")
    filtered = prefilter(data, *butter(2, 0.4))
    assert (filtered.window, filtered.name) == (5, "run")
    assert np.abs(filtered.y - data.y).max() > 0.1
    fit = arx(filtered[100:], 2, 2)
    np.testing.assert_allclose(fit.parameters, [-1.5, 0.7, 1.0, 0.5], atol=1e-7)


def test_a_constant_passes_without_a_transient():
    data = IOData(np.full(50, 2.0), np.full(50, -3.0), 0.1)
    np.testing.assert_allclose(prefilter(data, *butter(3, 0.2)).u, 2.0, rtol=1e-9)
    np.testing.assert_allclose(prefilter(data, [0.5]).y, -1.5)


def test_a_band():
    t = np.arange(1000) * 0.01
    slow, middle, fast = (np.sin(2 * np.pi * f * t) for f in (1.0, 5.0, 20.0))
    data = IOData(slow + middle + fast + 4.0, middle + fast, 0.01)
    np.testing.assert_allclose(keep_band(data, 2.0, 10.0).u[:, 0], middle, atol=1e-12)
    np.testing.assert_allclose(keep_band(data, 2.0).u[:, 0], middle + fast, atol=1e-12)
    np.testing.assert_allclose(keep_band(data, high_hz=1.0).u[:, 0], 4.0 + slow, atol=1e-12)


def test_refusals():
    data = IOData(np.arange(20.0), np.arange(20.0), 0.1)
    refused(r"not stable: largest pole modulus 1\.5", lambda: prefilter(data, 1.0, [1.0, -1.5]))
    refused("rows of coefficients", lambda: prefilter(data, 1.0, [0.0, 1.0]))
    refused(r"they are 0 to 5 Hz in steps of 0\.5", lambda: keep_band(data, 5.1, 6.0))
    assert resample(data, 3, 3) is data
    refused("down must be", lambda: resample(data, 1, 0))
    refused("of 20 samples only 1 would remain", lambda: resample(data, 1, 20))
    gapped = IOData([1.0, 2.0, 3.0], [1.0, np.nan, 2.0], 0.1, missing=True)
    for function in (keep_band, lambda one: prefilter(one, [1.0, 2.0]), lambda one: resample(one, 2)):
        refused("complete_parts", function, gapped)


T = np.arange(1200) * 0.01


def test_slow_signals_stay_and_fast_ones_do_not_alias():
    slow, fast = np.sin(2 * np.pi * 1.3 * T), np.sin(2 * np.pi * 38.0 * T)
    filtered = resample(IOData(slow + 5.0, slow + fast, 0.01, window=20, output_units=("rad",)), 1, 4)
    assert (len(filtered), filtered.dt, filtered.window, filtered.intersample) == (300, 0.04, 5, "bl")
    assert filtered.output_units == ("rad",)
    middle = slice(30, -30)
    np.testing.assert_allclose(filtered.u[middle, 0], 5.0 + slow[::4][middle], atol=2e-3)
    # 38 Hz would come back at 12 Hz
    np.testing.assert_allclose(filtered.y[middle, 0], slow[::4][middle], atol=5e-3)


@pytest.mark.parametrize(("up", "down"), [(3, 2), (2, 1), (4, 6)])
def test_rational_ratios(up, down):
    slow = np.sin(2 * np.pi * 1.3 * T)
    filtered = resample(IOData(slow, 2 * slow, 0.01), up, down)
    assert filtered.dt == pytest.approx(0.01 * down / up)
    np.testing.assert_allclose(filtered.time[60:-60], np.arange(len(filtered))[60:-60] * 0.01 * down / up)
    np.testing.assert_allclose(filtered.u[60:-60, 0], np.sin(2 * np.pi * 1.3 * filtered.time[60:-60]), atol=2e-3)
    np.testing.assert_allclose(filtered.y, 2 * filtered.u, rtol=1e-9, atol=1e-12)
