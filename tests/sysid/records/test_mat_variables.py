"""Variables of MATLAB files: as SciPy reads them, without what ends its reader."""

import struct

import numpy as np
import pytest
from scipy.io import loadmat, savemat
from scipy.sparse import csc_array

from sysid.records.mat_variables import MOST_NUMBERS, read_variables
from tests.mat_bytes import CELL, HEAD, TEXT, nested, packed, part, variable
from tests.refusals import refused

RNG = np.random.default_rng(0)
NUMBERS = {
    **{kind: (100 * RNG.standard_normal((3, 2))).astype(kind) for kind in ("f8", "f4", "i1", "i2", "i4", "i8", "c16")},
    **{kind: RNG.integers(0, 200, (2, 5)).astype(kind) for kind in ("u1", "u2", "u4", "u8")},
    "flags": np.array([[True, False]]),
    "empty": np.empty((0, 3)),
    "scalar": np.array([[2.5]]),
    "cube": RNG.standard_normal((2, 3, 4)),
}
OTHERS = {
    "text": "elbow pitch",
    "cells": np.array(["a", "bcdef", 1.0], dtype=object),
    "deep": np.array([np.array(["a", "b"], dtype=object), 1.0], dtype=object),
    "table": {"name": "x", "inner": {"gain": 2.0}},
    "sparse": csc_array(np.eye(3)),
}
DAMAGED = {
    "numbers of an unknown type": variable("y", part(200, bytes(8))),
    "numbers of a type without a size": variable("y", part(8, bytes(8))),
    "a text of an unknown type": variable("y", part(77, b"a"), TEXT),
    "fewer numbers than stated": variable("y", part(9, bytes(8)), dims=(1000, 1000)),
    "a negative dimension": variable("y", part(9, bytes(8)), dims=(-1, -1)),
    "no imaginary part": variable("y", part(9, bytes(8)), flags=1 << 11),
    "a cell less than stated": variable("y", variable("", part(9, bytes(8))), CELL, (2, 1)),
    "a part behind its end": variable("y", struct.pack("<II", 9, 2**31)),
    "a variable in place of a number": part(9, bytes(8)),
    "too many numbers": variable("y", part(2, b""), dims=(2**16, 2**15)),
}


@pytest.fixture(scope="module")
def without_end():
    return nested(20_000)


@pytest.mark.parametrize("compressed", [False, True])
def test_variables_are_those_that_scipy_reads(compressed, tmp_path):
    path = tmp_path / "all.mat"
    savemat(path, {**NUMBERS, **OTHERS}, do_compression=compressed)
    stored = loadmat(path)
    numbers = read_variables(path)
    assert list(numbers) == list(NUMBERS)
    for name, values in {**numbers, **read_variables(path, ("text", "cells"))}.items():
        assert values.dtype == stored[name].dtype
        np.testing.assert_array_equal(values, stored[name])
    assert read_variables(path, ("f8", "absent", "deep", "table", "sparse")).keys() == {"f8"}


def test_files_of_version_4_and_of_the_other_byte_order_are_read(tmp_path):
    path = tmp_path / "old.mat"
    savemat(path, {"y": np.arange(3.0), "text": "x"}, format="4")
    np.testing.assert_array_equal(read_variables(path)["y"], [[0.0, 1.0, 2.0]])
    swapped = struct.pack(">8I", 14, 64, 6, 8, 6, 0, 5, 8) + struct.pack(">2i2H4s", 1, 2, 1, 1, b"y")
    path.write_bytes(b"MATLAB 5.0".ljust(124) + b"\x01\x00MI" + swapped + struct.pack(">2I2d", 9, 16, 1.5, -2.0))
    np.testing.assert_array_equal(read_variables(path)["y"], [[1.5, -2.0]])


@pytest.mark.slow
@pytest.mark.parametrize("store", [bytes, packed], ids=["v6", "v7"])
@pytest.mark.parametrize("damage", DAMAGED)
def test_a_damaged_variable_is_refused_also_where_scipy_crashes(damage, store, tmp_path):
    path = tmp_path / "a.mat"
    path.write_bytes(HEAD + store(DAMAGED[damage]))
    refused(r"^a\.mat: not a \.mat file of version 7\.2 or older", read_variables, path, ("y",))


@pytest.mark.slow
@pytest.mark.parametrize("store", [bytes, packed], ids=["v6", "v7"])
def test_cells_within_cells_are_left_out_and_those_without_end_refused(store, without_end, tmp_path):
    path = tmp_path / "deep.mat"
    number = store(variable("u", part(9, struct.pack("<d", 3.0))))
    path.write_bytes(HEAD + store(nested(20)) + number)
    assert read_variables(path, ("u", "y")) == {"u": 3.0}
    path.write_bytes(HEAD + store(without_end) + number)
    assert read_variables(path) == {"u": 3.0}
    refused(r"^deep\.mat: not a \.mat file .*\(reading it crashed\)$", read_variables, path, ("u", "y"))


def test_a_small_file_does_not_fill_the_memory(tmp_path):
    path = tmp_path / "zeros.mat"
    savemat(path, {"y": np.zeros((2**11, 2**10), np.int8)}, do_compression=True)
    content = path.read_bytes()
    assert read_variables(path)["y"].shape == (2**11, 2**10)
    copies = 1 + MOST_NUMBERS // 2**21
    path.write_bytes(content[:128] + content[128:] * copies)
    refused(f"numbers in 'y' of shape .* expected at most {MOST_NUMBERS}", read_variables, path)
    path.write_bytes(HEAD + packed(variable("y", part(9, bytes(8))) + bytes(2**20)))
    refused("Did not fully consume compressed contents", read_variables, path)
    path.write_bytes(content[:-1])
    refused("1 bytes behind the file", read_variables, path)


def test_the_reason_of_a_refusal_is_short(tmp_path):
    path = tmp_path / "old.mat"
    path.write_bytes(struct.pack("<5i", 0, 9, 9, 0, 100_000) + b"\x1b[2Jname" * 12_500)
    with pytest.raises(ValueError, match=r"Not enough bytes to read matrix") as refusal:
        read_variables(path)
    assert len(str(refusal.value)) < 400
    assert str(refusal.value).isprintable()
