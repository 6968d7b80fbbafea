"""Another sampling rate."""

import numpy as np
import pytest

from sysid import IOData, SysidError, resample

T = np.arange(1200) * 0.01


def test_slow_signals_stay_and_fast_ones_do_not_alias() -> None:
    slow, fast = np.sin(2 * np.pi * 1.3 * T), np.sin(2 * np.pi * 38.0 * T)
    found = resample(IOData(slow + 5.0, slow + fast, 0.01, window=20, output_units=("rad",)), 1, 4)
    assert (len(found), found.dt, found.window, found.intersample) == (300, 0.04, 5, "bl")
    assert found.output_units == ("rad",)
    middle = slice(30, -30)
    np.testing.assert_allclose(found.u[middle, 0], 5.0 + slow[::4][middle], atol=2e-3)
    # 38 Hz would come back at 12 Hz
    np.testing.assert_allclose(found.y[middle, 0], slow[::4][middle], atol=5e-3)


@pytest.mark.parametrize(("up", "down"), [(3, 2), (2, 1), (4, 6)])
def test_rational_ratios(up: int, down: int) -> None:
    slow = np.sin(2 * np.pi * 1.3 * T)
    found = resample(IOData(slow, 2 * slow, 0.01), up, down)
    assert found.dt == pytest.approx(0.01 * down / up)
    np.testing.assert_allclose(found.time[60:-60], np.arange(len(found))[60:-60] * 0.01 * down / up)
    np.testing.assert_allclose(found.u[60:-60, 0], np.sin(2 * np.pi * 1.3 * found.time[60:-60]), atol=2e-3)
    np.testing.assert_allclose(found.y, 2 * found.u, rtol=1e-9, atol=1e-12)


def test_refusals() -> None:
    data = IOData(T, T, 0.01)
    assert resample(data, 3, 3) is data
    with pytest.raises(SysidError, match="down must be"):
        resample(data, 1, 0)
    with pytest.raises(SysidError, match="of 1200 samples only 1 would remain"):
        resample(data, 1, 1200)
    with pytest.raises(SysidError, match="complete_parts"):
        resample(IOData([1.0, 2.0, 3.0], [1.0, np.nan, 2.0], 0.1, missing=True), 2)
