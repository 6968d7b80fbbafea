import pickle
from dataclasses import replace

import numpy as np
import pytest
import xarray as xr

from hmtb_twin import JointLog, Plant, TwinError, simulate
from tests.hmtb_twin.altered_arms import equal
from tests.refusals import refused

KINDS = {"plain": {}, "worksite": {"worksite": True}, "servo valves": {"plant": Plant("orifice")}}
PARTS = {"worksite": ("unit_pose", "contact_force"), "servo valves": ("spool", "supply_pressure")}


@pytest.fixture(scope="module")
def log(experiment):
    return simulate([experiment(duration=1.0)])[0]


@pytest.mark.parametrize("kind", KINDS)
def test_file_gives_back_every_bit(experiment, kind, tmp_path):
    log = simulate([experiment(duration=1.0, **KINDS[kind])])[0]
    back = JointLog.load(log.save(tmp_path / "log.nc"))
    assert equal(back, log)
    np.testing.assert_array_equal(back.time, log.time)
    for owner, names in PARTS.items():
        assert [getattr(back, name) is not None for name in names] == 2 * [owner == kind]
    for name in ("measured", "status", *PARTS.get(kind, ())):
        with pytest.raises(ValueError, match="read-only"):
            getattr(back, name)[0] = 0
    assert (back.name, back.seed, back.dt, back.axes) == (log.name, log.seed, log.dt, log.axes)
    assert dict(back.provenance) == dict(log.provenance)
    assert [path.name for path in tmp_path.iterdir()] == ["log.nc"]
    sent = pickle.loads(pickle.dumps(log))
    assert equal(sent, log) and dict(sent.provenance) == dict(log.provenance)


def test_analyst_gets_command_and_measurement_only(log):
    data = log.iodata()
    np.testing.assert_array_equal(data.u[:, 0], log.commanded[:, 3])
    np.testing.assert_array_equal(data.y[:, 0], log.measured[:, 3])
    assert data.dt == 0.02
    np.testing.assert_array_equal(log.iodata("wrist_yaw").y[:, 0], log.measured[:, 5])
    refused(r"'knee'.*elbow_pitch", log.iodata, "knee")


def test_channels_of_a_log_fit_together(log):
    refused(r"wrench of shape .* expected", replace, log, wrench=log.wrench[:-1])


def test_missing_and_foreign_files(log, tmp_path):
    refused("no file", JointLog.load, tmp_path / "absent.nc")
    (tmp_path / "text.nc").write_text("u,y\n1,2\n")
    refused("not a NetCDF4 file", JointLog.load, tmp_path / "text.nc")
    xr.Dataset({"tide": ("t", np.zeros(3))}).to_netcdf(tmp_path / "tide.nc", engine="h5netcdf")
    refused(r"no joint log.*tide", JointLog.load, tmp_path / "tide.nc")


@pytest.mark.slow
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
    refused(r"bad\.nc|joint log", JointLog.load, tmp_path / "bad.nc")


def test_a_log_that_cannot_be_written_leaves_nothing(log, tmp_path):
    refused("cannot write", log.save, tmp_path / "absent" / "log.nc")
    refused("cannot write", replace(log, seed=2**70).save, tmp_path / "log.nc")
    assert list(tmp_path.iterdir()) == []
    (tmp_path / "taken.nc").mkdir()
    refused("folder", log.save, tmp_path / "taken.nc")


@pytest.mark.slow
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
