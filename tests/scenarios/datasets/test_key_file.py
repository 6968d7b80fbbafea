"""The key of data sets with hidden truth."""

import json
import stat
import zipfile
from dataclasses import replace
from pathlib import Path

import pytest

from scenarios.datasets.challenge_build import private_folder
from scenarios.datasets.challenge_key import read_key, unpack
from scenarios.datasets.spec import DataSetSpec
from scenarios.files.errors import ScenarioError
from tests.scenarios.conftest import Class


def test_the_key_is_a_plain_archive_of_its_owner(hidden: Class) -> None:
    assert stat.S_IMODE(hidden.key.stat().st_mode) == 0o600
    assert not private_folder(hidden.key).exists()
    with zipfile.ZipFile(hidden.key) as archive:
        assert {one.compress_type for one in archive.infolist()} == {zipfile.ZIP_STORED}
        names = archive.namelist()
        head = json.loads(archive.read("key.json"))
    assert (
        "class-v1-ann/truth/arms/ann-twin-0-arm-0.nc" in names and "class-v1-bob/data/test/bob-twin-0-noise.nc" in names
    )
    assert not [name for name in names if "/data/train/" in name]
    assert len(bytes.fromhex(head["salt"])) == 16 and DataSetSpec.from_toml(head["spec"]).secret_seed


def test_a_damaged_key_is_refused(hidden: Class, tmp_path: Path) -> None:
    content = bytearray(hidden.key.read_bytes())
    position = content.index(b"truth/arms") + 5000
    content[position] ^= 1
    (tmp_path / "key").write_bytes(content)
    with pytest.raises(ScenarioError, match="damaged"):
        unpack(read_key(tmp_path / "key"), "class-v1-ann", tmp_path / "x")
    (tmp_path / "none").write_bytes(b"no zip")
    for name in ("none", "absent"):
        with pytest.raises(ScenarioError, match=r"no key"):
            read_key(tmp_path / name)


def test_what_a_key_keeps_is_what_its_own_spec_gives(hidden: Class, tmp_path: Path) -> None:
    key = read_key(hidden.key)
    other = replace(key, spec=replace(key.spec, secret_seed="7a" * 16))
    with pytest.raises(ScenarioError, match="what it keeps of class-v1-ann is not what its own spec and secret give"):
        unpack(other, "class-v1-ann", tmp_path)
    assert not list(tmp_path.iterdir())
