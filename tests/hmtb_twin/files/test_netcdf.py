"""NetCDF4 files: what goes in comes out, in other readers too, and the same contents are the same bytes."""

import time

import h5netcdf
import numpy as np
import pytest
import xarray

from hmtb_twin.files.netcdf import Contents, Variable, read_netcdf
from tests.refusals import refused

RNG = np.random.default_rng(3)
LONG = 40_000
"""Rows of an array that does not fit in one chunk."""


@pytest.fixture(scope="module")
def contents():
    text = {"long_name": "°, µ and \n", "units": "V", "empty": ""}
    return Contents(
        {
            "sample": Variable(("sample",), np.arange(LONG), {"units": "1"}),
            "joint": Variable(("joint",), np.array(["elbow", "Schultergelenk"]), {}),
            "wide": Variable(("sample", "joint", "part"), RNG.standard_normal((LONG, 2, 3)), text),
            "square": Variable(("joint", "other"), RNG.standard_normal((2, 2)), {}),
            "scalar": Variable((), np.array(2.5), {"count": 3, "ratio": 0.1, "many": np.array([1.5, 2.5])}),
            "word": Variable((), np.array("rad"), {}),
            "none": Variable(("zero", "part"), np.empty((0, 3)), {}),
            "flags": Variable(("sample",), RNG.integers(0, 9, LONG).astype(np.uint16), {}),
            "small": Variable(("part",), np.array([1, 2, 3], np.int32), {}),
        },
        {"title": "a", "seed": 2**40, "step": 0.02, **{f"provenance_{n}": "x" * n for n in range(1, 30)}},
    )


@pytest.fixture(scope="module")
def path(contents, tmp_path_factory):
    path = tmp_path_factory.mktemp("netcdf") / "a.nc"
    path.write_bytes(contents.to_bytes())
    return path


def test_what_goes_in_comes_out(contents, path):
    read = read_netcdf(path)
    assert dict(read.attributes) == dict(contents.attributes)
    assert set(read.variables) == set(contents.variables)
    for name, variable in contents.variables.items():
        stored = read.variables[name]
        assert (stored.dims, stored.values.dtype) == (variable.dims, variable.values.dtype)
        np.testing.assert_array_equal(stored.values, variable.values)
        np.testing.assert_equal(dict(stored.attributes), dict(variable.attributes))
    assert read.array_hashes() == contents.array_hashes()


def test_xarray_reads_it(contents, path):
    with xarray.open_dataset(path, engine="h5netcdf") as outcome:
        assert outcome.sizes == {"sample": LONG, "joint": 2, "part": 3, "other": 2, "zero": 0}
        assert set(outcome.coords) == {"sample", "joint"}
        assert outcome["wide"].attrs == contents.variables["wide"].attributes
        np.testing.assert_array_equal(outcome["wide"], contents.variables["wide"].values)
        assert outcome["joint"].values.tolist() == ["elbow", "Schultergelenk"]
        assert outcome.attrs["seed"] == 2**40


def test_the_file_follows_the_rules_of_netcdf4(path):
    with h5netcdf.File(path, "r") as file:
        raw = file._h5file
        for name, dim in file.dimensions.items():
            assert raw[name].attrs["CLASS"] == b"DIMENSION_SCALE"
            assert "_Netcdf4Dimid" in raw[name].attrs
            without = b"This is a netCDF dimension but not a netCDF variable.%10d" % dim.size
            assert raw[name].attrs["NAME"] == (name.encode() if name in file.variables else without)
        for axis, name in enumerate(("sample", "joint", "part")):
            (scale,) = raw["wide"].dims[axis].values()
            assert scale.name == f"/{name}"
        assert raw["wide"].chunks[0] < LONG
        assert raw["wide"].nbytes > raw["wide"].id.get_storage_size()


def test_the_same_contents_are_the_same_bytes_at_another_time(contents, path):
    time.sleep(1.05)  # HDF5 counts in seconds
    assert contents.to_bytes() == path.read_bytes()


@pytest.mark.parametrize(
    ("variables", "says"),
    [
        ({"a": Variable(("x",), np.zeros(2), {}), "b": Variable(("x",), np.zeros(3), {})}, "b has 3 along x"),
        ({"a": Variable(("x",), np.zeros(2, complex), {})}, "complex128"),
        ({"a": Variable(("x",), np.array([object()]), {})}, "object"),
        ({"x": Variable(("y",), np.zeros(2), {}), "b": Variable(("x",), np.zeros(3), {})}, "x is a dimension"),
        ({"x": Variable(("x", "y"), np.zeros((2, 2)), {})}, "x is a dimension"),
    ],
)
def test_what_is_no_netcdf_is_refused(variables, says):
    refused(says, Contents(variables, {}).to_bytes)
