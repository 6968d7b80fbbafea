"""The input-output record."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from sysid import IOData, SysidError
from sysid.records.data import as_experiments
from tests.sysid.refusals import refused


def record(samples: int = 20, **kwargs: object) -> IOData:
    rng = np.random.default_rng(1)
    return IOData(rng.standard_normal((samples, 2)), rng.standard_normal((samples, 3)), 0.02, **kwargs)  # type: ignore[arg-type]


def test_one_channel_may_be_one_dimensional() -> None:
    data = IOData([1.0, 2.0, 4.0], [0, 1, 2], 0.5)
    assert data.u.shape == data.y.shape == (3, 1)
    assert data.y.dtype == np.float64
    assert data.input_names == ("u1",)
    np.testing.assert_array_equal(data.time, [0.0, 0.5, 1.0])


def test_arrays_are_locked_copies() -> None:
    u = np.arange(4.0)
    data = IOData(u, u, 1.0)
    u[0] = 99.0
    assert data.u[0, 0] == 0.0
    with pytest.raises(ValueError, match="read-only"):
        data.u[0, 0] = 1.0


@given(st.integers(0, 17), st.integers(3, 20), st.integers(0, 19))
def test_slices_keep_everything_and_shrink_the_window(start: int, length: int, window: int) -> None:
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
def test_bad_slices(part: object) -> None:
    with pytest.raises(SysidError):
        record()[part]  # type: ignore[index]


@pytest.mark.parametrize("order", [0, 1, 3])
def test_detrend_removes_polynomials_and_nothing_else(order: int) -> None:
    t = np.linspace(0, 1, 50)
    trend = np.polyval(np.arange(1, order + 2), t)
    wave = np.sin(40 * t)
    clean = IOData(wave, wave, 0.1).detrend(order)
    np.testing.assert_allclose(IOData(wave + trend, wave, 0.1).detrend(order).u, clean.u, atol=1e-12)
    np.testing.assert_allclose(clean.detrend(order).y, clean.y, atol=1e-13)
    if order == 0:
        np.testing.assert_allclose(clean.u[:, 0], wave - wave.mean(), atol=1e-14)


def test_the_trend_is_that_behind_the_initialisation_window() -> None:
    data = record(window=8).detrend()
    np.testing.assert_allclose(data.y[8:].mean(axis=0), 0.0, atol=1e-15)
    np.testing.assert_allclose(data.y[:8] - data.y[8], record().y[:8] - record().y[8], atol=1e-14)
    line = np.arange(20.0)
    spoilt = np.concatenate((np.full(8, 50.0), line[8:]))
    np.testing.assert_allclose(IOData(line, spoilt, 1.0, window=8).detrend(1).y[:, 0], spoilt - line, atol=1e-12)


def test_a_given_operating_point() -> None:
    data = record()
    part = data.subtract(u=[1.0, 2.0], y=0.5)
    np.testing.assert_allclose(part.u, data.u - [1.0, 2.0])
    np.testing.assert_allclose(part.y, data.y - 0.5)
    trend = np.arange(60.0).reshape(20, 3)
    np.testing.assert_allclose(data.subtract(y=trend).y, data.y - trend)
    np.testing.assert_array_equal(data.subtract(y=trend).u, data.u)
    refused(r"one per channel \(2,\)", lambda: data.subtract(u=[1.0, 2.0, 3.0]))


def test_select_by_name_and_index() -> None:
    data = record(input_names=("a", "b"), output_names=("x", "y", "z"), input_units=("V", "A"))
    part = data.select(inputs=["b"], outputs=[2, "x"])
    np.testing.assert_array_equal(part.y, data.y[:, [2, 0]])
    assert (part.input_names, part.input_units, part.output_names) == (("b",), ("A",), ("z", "x"))
    refused(r"available are .* x, y, z", lambda: data.select(outputs=["w"]))
    refused("at least one input", lambda: data.select(inputs=[]))


@pytest.mark.parametrize(
    ("u", "y", "dt", "message"),
    [
        ([1, 2, 3], [1, 2], 0.1, "u has 3 samples, y has 2"),
        ([[1, 0], [2, np.nan], [3, 0]], [1, 2, 3], 0.1, "channel 1 at index 1"),
        ([1, 2, 3], [1, np.inf, 3], 0.1, "y: 1 sample.* channel 0 at index 1"),
        ([1j, 2, 3], [1, 2, 3], 0.1, "real numbers"),
        (["a", "b"], [1, 2], 0.1, "real numbers"),
        ([], [], 0.1, "at least one sample"),
        (np.ones((2, 9)), np.ones(2), 0.1, "more channels than samples"),
        (np.ones((2, 2, 2)), np.ones(2), 0.1, "time first"),
        ([1, 2], [1, 2], 0.0, "positive"),
        ([1, 2], [1, 2], -1.0, "positive"),
        ([1, 2], [1, 2], np.nan, "positive"),
        ([1, 2], [1, 2], "fast", "positive"),
    ],
)
def test_bad_input_is_named(u: object, y: object, dt: float, message: str) -> None:
    refused(message, lambda: IOData(u, y, dt))  # type: ignore[arg-type]


@pytest.mark.parametrize(
    "options",
    [
        {"window": 3},
        {"window": -1},
        {"window": 1.5},
        {"input_names": ("a", "b")},
        {"intersample": "spline"},
    ],
)
def test_bad_options(options: dict[str, object]) -> None:
    with pytest.raises(SysidError):
        IOData([1, 2, 3], [1, 2, 3], 1.0, **options)  # type: ignore[arg-type]


def test_experiments_must_belong_together() -> None:
    a, b = IOData([1, 2], [1, 2], 1.0), IOData([1, 2], [1, 2], 2.0)
    assert as_experiments(a) == (a,)
    refused("sampled every", lambda: as_experiments([a, b]))
    refused("2 input", lambda: as_experiments([a, IOData(np.ones((3, 2)), np.ones(3), 1.0)]))
    refused("at least one", lambda: as_experiments([]))
    refused("got int", lambda: as_experiments([a, 3]))  # type: ignore[list-item]


def test_a_slice_keeps_the_time_of_the_whole() -> None:
    data = IOData(np.arange(10.0), np.arange(10.0), 0.5, start=3.0)
    np.testing.assert_allclose(data.time[[0, -1]], [3.0, 7.5])
    part = data[4:][1:3]
    np.testing.assert_allclose(part.time, data.time[5:7])
    assert part.detrend().start == part.start == 5.5
    refused("start must be a finite time in s, got inf", lambda: IOData(np.ones(3), np.ones(3), 0.5, start=np.inf))
