from dataclasses import replace

import numpy as np
import pytest
import xarray as xr

from hmtb_twin import JointLog, TwinError, simulate


@pytest.fixture(scope="module")
def log(experiment):
    return simulate([experiment(duration=1.0)])[0]


def test_file_gives_back_every_bit(log, tmp_path):
    back = JointLog.load(log.save(tmp_path / "log.nc"))
    for name in ("commanded", "measured", "wrench", "true_angles", "load_pressure", "volts", "counts", "time"):
        np.testing.assert_array_equal(getattr(back, name), getattr(log, name))
    assert (back.name, back.seed, back.dt, back.axes) == (log.name, log.seed, log.dt, log.axes)
    assert dict(back.provenance) == dict(log.provenance)
    assert [path.name for path in tmp_path.iterdir()] == ["log.nc"]


def test_analyst_gets_command_and_measurement_only(log):
    data = log.iodata()
    np.testing.assert_array_equal(data.u[:, 0], log.commanded[:, 3])
    np.testing.assert_array_equal(data.y[:, 0], log.measured[:, 3])
    assert data.dt == 0.02
    np.testing.assert_array_equal(log.iodata("wrist_yaw").y[:, 0], log.measured[:, 5])
    with pytest.raises(TwinError, match=r"'knee'.*elbow_pitch"):
        log.iodata("knee")


def test_log_is_locked_and_its_channels_fit_together(log):
    with pytest.raises(ValueError, match="read-only"):
        log.measured[0, 0] = 0.0
    with pytest.raises(TwinError, match=r"wrench of shape .* expected"):
        replace(log, wrench=log.wrench[:-1])


def test_missing_and_foreign_files(log, tmp_path):
    with pytest.raises(TwinError, match="no file"):
        JointLog.load(tmp_path / "absent.nc")
    (tmp_path / "text.nc").write_text("u,y\n1,2\n")
    with pytest.raises(TwinError, match="not a NetCDF4 file"):
        JointLog.load(tmp_path / "text.nc")
    xr.Dataset({"tide": ("t", np.zeros(3))}).to_netcdf(tmp_path / "tide.nc", engine="h5netcdf")
    with pytest.raises(TwinError, match=r"no joint log.*tide"):
        JointLog.load(tmp_path / "tide.nc")


@pytest.mark.parametrize(
    "spoil",
    [
        lambda d: d.assign_attrs(seed="many"),
        lambda d: d.assign_attrs(sampling_time="slow"),
        lambda d: d.drop_attrs(),
        lambda d: d.isel(joint=slice(0, 3)),
        lambda d: d.isel(joint=slice(None, None, -1)),
        lambda d: d.isel(component=slice(0, 2)),
    ],
)
def test_damaged_logs_are_refused(log, tmp_path, spoil):
    path = log.save(tmp_path / "log.nc")
    spoil(xr.load_dataset(path, engine="h5netcdf")).to_netcdf(tmp_path / "bad.nc", engine="h5netcdf")
    with pytest.raises(TwinError, match=r"bad\.nc|joint log"):
        JointLog.load(tmp_path / "bad.nc")


def test_a_log_that_cannot_be_written_leaves_nothing(log, tmp_path):
    with pytest.raises(TwinError, match="cannot write"):
        log.save(tmp_path / "absent" / "log.nc")
    with pytest.raises(TwinError, match="cannot write"):
        replace(log, seed=2**70).save(tmp_path / "log.nc")
    assert list(tmp_path.iterdir()) == []
    (tmp_path / "taken.nc").mkdir()
    with pytest.raises(TwinError, match="folder"):
        log.save(tmp_path / "taken.nc")


def test_a_damaged_header_is_one_error_and_no_noise(log, tmp_path, capfd):
    whole = bytearray(log.save(tmp_path / "whole.nc").read_bytes())
    rng = np.random.default_rng(4)
    refused = 0
    for number in range(12):
        damaged = bytearray(whole)
        for place in rng.integers(0, 4000, 8):
            damaged[place] ^= 1 << int(rng.integers(8))
        path = tmp_path / f"{number}.nc"
        path.write_bytes(damaged)
        try:
            JointLog.load(path)
        except TwinError:
            refused += 1
    assert refused > 3
    assert "Traceback" not in capfd.readouterr().err
