"""Records as pandas tables and xarray data sets."""

from dataclasses import replace

import numpy as np
import pandas
import pytest
import xarray

import sysid
from sysid import IOData, from_dataframe, from_xarray
from tests.refusals import refused

U, *Y = np.random.default_rng(0).standard_normal((3, 50))
Y = np.column_stack(Y)
DATA = IOData(
    U, Y, 0.1, input_names=("valve",), input_units=("V",), output_names=("x", "p"), output_units=("m", "Pa"),
    intersample="foh", window=5, start=2.0, name="run",
)  # fmt: skip


@pytest.mark.parametrize("back", [from_dataframe(DATA.to_dataframe()), from_xarray(DATA.to_xarray())])
def test_names_units_and_time_survive(back):
    for name in ("input_names", "output_names", "input_units", "output_units", "intersample", "window", "name", "dt"):
        assert getattr(back, name) == getattr(DATA, name)
    np.testing.assert_array_equal(back.y, DATA.y)
    np.testing.assert_allclose(back.time, DATA.time, rtol=1e-12)


def test_a_data_set_survives_a_file(tmp_path):
    gaps = replace(DATA, y=np.where(np.arange(50)[:, None] == 20, np.nan, DATA.y), missing=True)
    gaps.to_xarray().to_netcdf(tmp_path / "run.nc", engine="h5netcdf")
    with xarray.open_dataset(tmp_path / "run.nc", engine="h5netcdf", decode_times=False) as stored:
        np.testing.assert_array_equal(from_xarray(stored).y, gaps.y)


def test_stamps_and_numbers_of_rows():
    frame = pandas.DataFrame({"u": Y[:, 0], "y": Y[:, 1], "note": "text"})
    stamps = frame.set_index(pandas.date_range("2026-01-01", periods=50, freq="20ms", tz="UTC"))
    assert from_dataframe(stamps, inputs=["u"], outputs=["y"]).dt == pytest.approx(0.02)
    series = from_dataframe(frame.set_index(pandas.to_timedelta(np.arange(50), "ms")), outputs="y")
    assert (series.nu, series.dt) == (0, pytest.approx(1e-3))
    assert from_dataframe(frame, inputs=["u"], outputs=["y"], dt=0.5).dt == 0.5
    uneven = frame.set_index(np.arange(50.0) ** 3)
    for table, arguments, message in (
        (frame, {"outputs": ["y"]}, "no sampling interval"),
        (frame, {"outputs": ["z"], "dt": 1.0}, "unknown column 'z'"),
        (frame, {"dt": 1.0}, "no column is marked as output"),
        (frame, {"outputs": ["note"], "dt": 1.0}, "unknown column 'note'; there are u, y"),
        (stamps, {"outputs": ["y"], "dt": 0.5}, "0.5 s by dt as given, 0.02 s by 'time'"),
        (uneven, {"outputs": ["y"]}, "not uniform"),
        (frame.set_index("note"), {"outputs": ["y"]}, "holds no times"),
        (frame.set_index(["u", "y"]), {"outputs": ["note"]}, "an index of time alone"),
        (Y, {"outputs": ["y"]}, "expected a pandas DataFrame"),
        (frame.assign(u=5j), {"inputs": ["u"], "outputs": ["y"], "dt": 0.1}, "complex"),
    ):
        refused(message, from_dataframe, table, **arguments)


def test_results_are_tables_with_the_names_of_their_channels():
    estimate = sysid.arx(DATA.select(outputs=["x"]), 1, 1, 1)
    frame = estimate.to_dataframe()
    assert list(frame.index) == list(estimate.parameter_names)
    np.testing.assert_allclose(frame.high - frame.low, 2 * 1.959963984540054 * frame.deviation)
    response = sysid.spa(DATA)
    row = response.to_dataframe().loc[(response.frequencies[3], "p", "valve")]
    assert row.response == response.response[3, 1, 0]
    assert row.magnitude_deviation == response.magnitude_deviation()[3, 1, 0]
    assert response.to_xarray().frequency.attrs["units"] == "Hz"
    assert list(sysid.spa(IOData(None, Y, 0.1)).to_xarray()) == ["noise_spectrum"]
    assert sysid.cra(DATA, lags=5).to_xarray().response.sel(lag=2, output="x").shape == (1,)
    table = sysid.selstruc(DATA.select(outputs=["x"]), range(1, 3), range(1, 3), [1])
    assert table.to_dataframe().iloc[0][list(table.names)].to_dict() == table.chosen
    recursive = sysid.rarx(DATA.select(outputs=["x"]), 1, 1)
    np.testing.assert_array_equal(recursive.to_dataframe()["a1"], recursive.parameters[:, 0])
    forecast = sysid.forecast(estimate, DATA.select(outputs=["x"]), 3, np.zeros((3, 1)))
    np.testing.assert_array_equal(forecast.to_dataframe().loc[(slice(None), "x"), "y"], forecast.y[:, 0])
