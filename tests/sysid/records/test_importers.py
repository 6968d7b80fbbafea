from functools import partial

import h5py
import numpy as np
import pytest
import xarray as xr
from scipy.io import savemat

from sysid import read_csv, read_experiments, read_mat, read_netcdf, read_npz
from sysid.records import reading_process
from tests.refusals import refused

U, Y = np.random.default_rng(0).standard_normal((2, 30))


def text(header, table, separator=","):
    return "\n".join([header, *(separator.join(f"{x:.17g}" for x in row) for row in table)])


@pytest.mark.parametrize(
    ("header", "separator", "scale"),
    [("t,u,y", ",", 1.0), ("Time (ms);u;y", ";", 1e3), ("time_s\tu\ty", "\t", 1.0), ("# note\nt u y", " ", 1.0)],
)
def test_csv(tmp_path, header, separator, scale):
    path = tmp_path / "robot.csv"
    path.write_text(text(header, np.column_stack((np.arange(30) * 0.02 * scale, U, Y)), separator))
    data = read_csv(path)
    np.testing.assert_array_equal(data.u[:, 0], U)
    np.testing.assert_array_equal(data.y[:, 0], Y)
    assert (data.dt, data.name, data.input_names) == (pytest.approx(0.02), "robot", ("u",))


def test_csv_with_several_channels_and_gaps(tmp_path):
    path = tmp_path / "arm.csv"
    path.write_text("a,b,angle,Ts\n1,2,3,0.5\n2,3,,0.5\n3,1,5,0.5\n4,2,nan,0.5\n5,4,6,0.5")
    data = read_csv(path, inputs=("b", "a"), outputs=("angle",), missing=True)
    assert data.input_names == ("b", "a")
    np.testing.assert_array_equal(data.u[0], [2.0, 1.0])
    np.testing.assert_array_equal(data.known[:, 0], [True, False, True, False, True])
    refused(r"arm\.csv: y: 2 sample.*missing=True", lambda: read_csv(path, inputs=("a",), outputs=("angle",)))
    bare = tmp_path / "bare.csv"
    bare.write_text("1 2\n3 4\n5 5")
    np.testing.assert_array_equal(read_csv(bare, dt=0.1).y[:, 0], [2.0, 4.0, 5.0])


def test_a_text_without_header_may_have_times_in_front(tmp_path):
    path = tmp_path / "robot.txt"
    rows = [f"{0.02 * k:.2f} {u} {y}" for k, (u, y) in enumerate(zip(U, Y, strict=True))]
    path.write_text("\n".join(rows))
    with pytest.warns(UserWarning, match="no header; the columns are taken for time, u, y, as the first rises"):
        data = read_csv(path)
    assert data.dt == pytest.approx(0.02)
    np.testing.assert_array_equal(data.y[:, 0], Y)
    path.write_text("\n".join(rows[::-1]))
    refused("3 columns without a header; expected a header, or the columns u, y", read_csv, path)


def test_signals_of_one_experiment_in_two_files_are_no_experiments(tmp_path):
    for name in ("u", "y"):
        (tmp_path / f"{name}.csv").write_text(text(f"t,{name}", np.column_stack((0.02 * np.arange(30), U))))
    message = "u.csv: unknown column 'y'; there are t, u; several files are experiments, each with all .*merge_asof"
    refused(message, read_experiments, [tmp_path / "u.csv", tmp_path / "y.csv"])


def test_npz(tmp_path):
    path = tmp_path / "robot.npz"
    np.savez(path, u=np.column_stack((U, Y)), y=Y, dt=0.02, note="x")
    data = read_npz(path)
    assert (data.u.shape, data.dt, data.name) == ((30, 2), 0.02, "robot")
    np.testing.assert_array_equal(data.y[:, 0], Y)
    np.savez_compressed(path, time=0.5 * np.arange(30), command=U[None], angle=Y)
    (data,) = read_experiments(path, inputs=("command",), outputs=("angle",))
    assert data.dt == 0.5
    np.savez(path, u=np.array([1.0, None]), y=Y, dt=0.1)
    refused("unknown column 'u'; there are y, dt .*arrays of Python objects are not read", read_npz, path)
    for content in (b"no archive", path.read_bytes()[:-60]):
        path.write_bytes(content)
        refused("robot.npz: not an .npz file, which numpy.savez writes", read_npz, path)


def test_mat(tmp_path):
    path = tmp_path / "robot.mat"
    savemat(path, {"u": np.column_stack((U, Y)), "y": Y, "Ts": 0.02, "note": "x"})
    data = read_mat(path)
    assert data.u.shape == (30, 2)
    assert data.input_names == ("u1", "u2")
    assert data.dt == 0.02
    np.testing.assert_array_equal(data.y[:, 0], Y)
    savemat(path, {"u": np.ones((2, 50)), "y": np.ones(50), "dt": 0.1})  # never transposed
    refused("u has 2 samples, y has 50 samples; time is first", read_mat, path)
    for dt in (np.nan, [0.1, 0.2]):
        savemat(path, {"u": U, "y": Y, "dt": dt})
        refused(r"'dt' is (nan|0\.1 to 0\.2); expected one sampling interval above 0 s", read_mat, path)


def test_a_small_file_that_claims_all_memory_and_a_text_for_dt_are_refused(tmp_path):
    path = tmp_path / "huge.nc"
    with h5py.File(path, "w") as file:
        file.create_dataset("u", (2**40,), "f8", chunks=(65536,))
    refused("arrays of 1099511627776 numbers, expected at most 268435456", read_netcdf, path)
    xr.Dataset({"u": ("t", U), "y": ("t", Y)}, attrs={"dt": "0.1"}).to_netcdf(path, engine="h5netcdf")
    refused("attribute dt is the text '0.1'; expected a number", read_netcdf, path)


def test_netcdf(tmp_path):
    path = tmp_path / "robot.nc"
    variables = {
        "command": (("time", "joint"), np.column_stack((U, -U)), {"units": "rad"}),
        "angle": ("time", Y, {"units": "rad"}),
        "name": ((), "text"),
    }
    coordinates = {"time": ("time", np.arange(30) * 20.0, {"units": "ms"})}
    xr.Dataset(variables, coordinates).to_netcdf(path, engine="h5netcdf")
    read = partial(read_netcdf, inputs=("command",), outputs=("angle",))
    data = read(path)
    assert data.dt == pytest.approx(0.02)
    assert (data.input_names, data.input_units, data.output_units) == (("command1", "command2"), ("rad",) * 2, ("rad",))
    np.testing.assert_array_equal(data.u[:, 1], -U)
    refused(r"sampling interval 0\.1 s by dt as given", partial(read, path, dt=0.1))


@pytest.mark.reliability
def test_a_heap_of_texts_that_never_ends_is_refused(tmp_path, monkeypatch):
    """The HDF5 library loops on free space of no length."""
    monkeypatch.setattr(reading_process, "PATIENCE", 4.0)
    path = tmp_path / "robot.nc"
    xr.Dataset({"u": ("t", U), "y": ("t", Y, {"units": "rad"})}, attrs={"dt": 0.1}).to_netcdf(path, engine="h5netcdf")
    content = bytearray(path.read_bytes())
    heap = content.index(b"GCOL")
    content[heap + 16 : heap + 32] = bytes(16)
    path.write_bytes(content)
    refused("not a NetCDF4 file, or a damaged one .reading it did not end within 4 s", read_netcdf, path)


def test_packed_netcdf_and_dates(tmp_path):
    path, y = tmp_path / "packed.nc", np.round(Y, 2)
    y[3] = np.nan
    stamps = np.datetime64("2026-01-31T12:00", "ns") + 20_000_000 * np.arange(30)
    packed = {"dtype": "int16", "scale_factor": 0.01, "add_offset": 1.0, "_FillValue": -9999}
    data_set = xr.Dataset({"u": ("when", U), "y": ("when", y), "rest": ("mode", [1, 2])}, {"when": stamps})
    data_set.to_netcdf(path, engine="h5netcdf", encoding={"y": packed})
    data = read_netcdf(path, time="when", missing=True)
    np.testing.assert_allclose(data.y[:, 0], y, atol=1e-12)
    assert data.dt == 0.02
    with h5py.File(path, "a") as file:
        file["y"].attrs["scale_factor"] = [0.01, 0.02]
    refused("scale_factor is no number", read_netcdf, path, time="when")


@pytest.mark.parametrize(
    ("content", "options", "message"),
    [
        ("", {}, "the file is empty; expected columns u, y"),
        ("t,u,y\n", {}, "a header and no data"),
        ("time,u,y,time\n0,1,2,0\n1,1,2,2\n", {}, "2 columns are named 'time'"),
        ("u,y\n1,2\n#N/A,2\n", {"dt": 1.0}, "NaN"),
        ("u" * 200_000 + ",y\n1,2\n", {"dt": 1.0}, "characters cannot be read"),
        ("t,u,y\n0,1,2\n", {"time": "t"}, "1 time"),
        ("t,u,y\n0,1\n", {}, r"line 2: 2 values, expected 3 \(t, u, y\)"),
        ("t,u,y\n0,1,x\n", {}, "line 2: could not convert"),
        ("t,u,y\n0,1,2\n1,1,2\n5,3,4\n6,1,1", {}, "not uniform: 1 gap"),
        ("t (weeks),u,y\n0,1,2\n1,1,2", {}, "expected s, ms, us, ns, min, h or days"),
        ("u,y\n1,2\n2,2\n3,2", {}, "no sampling interval"),
        ("t,u,y\n0,1,2", {}, "1 sample, which tells no sampling interval; expected two or more"),
        ("u,y,dt\n1,2,0.1\n2,2,0.1\n3,2,0.1", {"dt": 0.2}, "omit the wrong one"),
        ("u,y,dt\n1,2,0.1\n2,2,0.2\n3,2,0.1", {}, "'dt' is 0.1 to 0.2; expected one sampling interval"),
        ("u,angle\n1,2\n2,2", {"dt": 0.2, "outputs": ("angel",)}, "did you mean 'angle'"),
        ("u,y\n1,2\n2,2", {"dt": 0.2, "outputs": ("u",)}, "different columns"),
        ("u,y\n1,2\n2,2", {"dt": -1.0}, "dt must be above 0"),
        ("u,y\n1,2\n2,2", {"dt": 1.0, "outputs": ()}, "no output named"),
        ("1,2,3\n2,2,3", {"dt": 0.1}, "3 columns without a header"),
    ],
)
def test_wrong_text(tmp_path, content, options, message):
    path = tmp_path / "bad.csv"
    path.write_text(content)
    refused(message, lambda: read_csv(path, **options))


FOREIGN = [bytes(range(128, 256)) * 9, b"", bytes(600), b"MATLAB 5.0" + bytes(10)]


@pytest.mark.slow
@pytest.mark.parametrize(
    ("read", "ending", "contents"),
    [(read_csv, "csv", FOREIGN[:1]), (read_mat, "mat", FOREIGN), (read_netcdf, "nc", FOREIGN)],
)
def test_foreign_files(tmp_path, read, ending, contents):
    refused("no data file", lambda: read(tmp_path / f"missing.{ending}"))
    path = tmp_path / f"binary.{ending}"
    for content in contents:
        path.write_bytes(content)
        refused(rf"binary\.{ending}: not a", lambda: read(path))


def test_text_of_spreadsheets(tmp_path):
    path = tmp_path / "log.csv"
    # A comma as decimal mark, the Windows character set, quoted names with commas, columns of words, ragged ends.
    path.write_bytes('t;u;"Drehmoment, Welle °";state\n0;1;0,5;on;\n0,5;2;1;off\n1;4;-1,5e1;on\n'.encode("cp1252"))
    data = read_csv(path, outputs=["Drehmoment, Welle °"])
    assert (data.dt, data.y[:, 0].tolist()) == (0.5, [0.5, 1.0, -15.0])
    for content in ("% time angle torque\n0 1.5 2\n\n1 2 3.5\n", "time angle torque\n0 1,5 2\n1 2 3,5\n"):
        data = read_csv(_text(tmp_path, content), inputs="torque", outputs="angle")
        assert (data.u[:, 0].tolist(), data.y[:, 0].tolist()) == ([2.0, 3.5], [1.5, 2.0])
    refused("log.csv, line 2: 3 values, expected 2", read_csv, _text(tmp_path, "u y\n1 2 3"), dt=1)
    refused("2 columns are named 'u'", read_csv, _text(tmp_path, "u,u,y\n1,2,3"), dt=1)
    refused("log.csv, line 5: could not convert 'x'", read_csv, _text(tmp_path, "# a\nu,y\n1,2\n\n1,x"), dt=1)


def _text(folder, content):
    (folder / "log.csv").write_text(content)
    return folder / "log.csv"


def matlab_7_3(path, variables, **objects):
    """Write HDF5 as MATLAB does: 512 bytes of its own, columns first, classes as attributes."""
    with h5py.File(path, "w", userblock_size=512) as file:
        for name, value in variables.items():
            value = np.asarray(value)
            packed = "gzip" if value.size > 9 else None
            array = file.create_dataset(name, data=np.atleast_2d(value).T, compression=packed)
            array.attrs["MATLAB_class"] = np.bytes_({"f": "double", "u": "uint8", "i": "int64"}[value.dtype.kind])
        for name, kind in objects.items():
            file.create_dataset(name, data=np.zeros((1, 6), np.uint32)).attrs["MATLAB_class"] = np.bytes_(kind)
    with path.open("r+b") as file:
        file.write(b"MATLAB 7.3 MAT-file, Platform: GLNXA64".ljust(124) + b"\x00\x02IM")
    return path


def test_mat_7_3(tmp_path):
    path = tmp_path / "robot.mat"
    stamps = 1_767_225_600_000_000_000 + 20_000_000 * np.arange(30)
    matlab_7_3(path, {"u": np.column_stack((U, Y)), "log/angle": Y[:, None], "log/time": stamps[None]}, note="char")
    with pytest.warns(match="'log.time' are taken for ns since 1970"):
        data = read_mat(path, outputs="log.angle")
    assert (data.dt, data.input_names, data.output_names) == (0.02, ("u1", "u2"), ("log.angle",))
    np.testing.assert_array_equal(data.u, np.column_stack((U, Y)))
    refused("unknown column 'y'; there are log.angle, log.time, u", read_mat, path)
    matlab_7_3(path, {}, data="iddata")
    refused(r"no arrays of numbers, but data \(iddata\); expected the arrays of such objects", read_mat, path)
    matlab_7_3(path, {"u": U, "y": Y, "Ts": 0.02})
    assert read_mat(path).dt == 0.02
    path.write_bytes(path.read_bytes()[:1500])
    refused("robot.mat: a damaged .mat file of version 7.3", read_mat, path)


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["external", "virtual", "soft", "link"])
def test_arrays_outside_the_file_are_refused(kind, tmp_path):
    secret, path = tmp_path / "secret.h5", tmp_path / "robot.mat"
    with h5py.File(secret, "w") as file:
        file["y"] = U[None]
    matlab_7_3(path, {"u": U})
    with h5py.File(path, "r+") as file:
        if kind == "external":
            file.create_dataset("y", (1, 30), "f8", external=[(secret, 0, 240)])
        elif kind == "virtual":
            layout = h5py.VirtualLayout((1, 30), "f8")
            layout[:] = h5py.VirtualSource(secret, "y", (1, 30))
            file.create_virtual_dataset("y", layout)
        else:
            file["y"] = h5py.SoftLink("/u") if kind == "soft" else h5py.ExternalLink(secret, "y")
    for read in (read_mat, read_netcdf):
        refused("'y' may lead to another file; expected arrays in this one", read, path)


def test_links_in_circles_are_followed_once(tmp_path):
    path = matlab_7_3(tmp_path / "circles.mat", {"log/u": U, "log/y": Y})
    with h5py.File(path, "r+") as file:
        for k in range(8):
            file[f"g{k}"] = file["/"]
            file[f"log/g{k}"] = file["/log"]
    np.testing.assert_array_equal(read_mat(path, inputs="log.u", outputs="log.y", dt=1.0).y[:, 0], Y)


@pytest.mark.parametrize("encoding", ["utf-16", "utf-8-sig", "cp1252"])
def test_encodings_of_tables(encoding, tmp_path):
    (tmp_path / "log.csv").write_text(text("t,u,y", np.column_stack((np.arange(30), U, Y))), encoding=encoding)
    np.testing.assert_allclose(read_csv(tmp_path / "log.csv").y[:, 0], Y)


def test_columns_may_end_in_a_tab_or_blanks(tmp_path):
    file = tmp_path / "columns.dat"
    for between, ending in (("\t", "\t"), (" ", "  ")):
        file.write_text("".join(f"{k}{between}{2 * k}{ending}\n" for k in range(5)))
        np.testing.assert_array_equal(read_csv(file, dt=1.0).y[:, 0], 2.0 * np.arange(5))


@pytest.mark.parametrize(
    ("dt", "samples", "message"),
    [
        (0.01, 0, "u has shape .0,.; expected at least 2 samples"),
        ([], 40, "attribute dt is .*; expected a real number"),
        ([0.01, 0.02], 40, "attribute dt is .*; expected a real number"),
        (1e308, 40, "last longer than any number"),
    ],
)
def test_netcdf_without_samples_or_an_interval_is_refused(tmp_path, dt, samples, message):
    path = tmp_path / "bad.nc"
    with h5py.File(path, "w") as file:
        file.attrs["dt"] = dt
        for name in ("u", "y"):
            file[name] = np.arange(float(samples))
    refused(message, lambda: read_netcdf(path))
