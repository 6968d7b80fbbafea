"""Data sets that are the same for all: the canonical hash on this machine, with any workers, and damaged copies."""

import subprocess
import sys
from dataclasses import replace

import pytest

import scenarios
from scenarios.datasets import canonical_verdict, open_data_set
from scenarios.datasets.canonical import Canonical, canonical
from scenarios.datasets.data_set import cache_folder
from scenarios.datasets.spec import shipped
from tests.refusals import refused


@pytest.mark.reliability
@pytest.mark.parametrize("workers", [1, 2])
def test_the_records_are_canonical_with_any_number_of_workers(workers, tmp_path, monkeypatch):
    monkeypatch.setattr("scenarios.datasets.build.STAGES", ())
    monkeypatch.setenv("HMTB_CACHE", str(tmp_path / "new" / "cache"))
    data_set = scenarios.load_dataset("hmtb-siso-v1", workers=workers)
    assert data_set.folder == tmp_path / "new" / "cache" / "hmtb-siso-v1"
    assert data_set.records_hash == canonical()["hmtb-siso-v1"].records
    assert canonical_verdict(data_set)[0] and "the canonical ones" in canonical_verdict(data_set)[1]


@pytest.fixture
def cached(tiny_spec, copy, monkeypatch):
    """The tiny data set as one of the package, in a cache."""
    monkeypatch.setattr("scenarios.datasets.canonical.shipped", lambda: {copy.name: tiny_spec})
    return copy


@pytest.mark.slow
def test_a_copy_in_the_cache_is_opened(cached):
    assert scenarios.load_dataset(cached.name, cache=cached.parent).folder == cached


def test_a_name_opens_the_copy_in_the_cache(tiny, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    refused("or the name of one that hmtb dataset get has put into", open_data_set, "tiny-v1")
    monkeypatch.setenv("HMTB_CACHE", str(tiny.parent))
    assert open_data_set("tiny-v1").folder == tiny
    (tmp_path / "tiny-v1").mkdir()
    refused("no experiments.json in it", open_data_set, "tiny-v1")  # a folder here comes first


@pytest.mark.slow
def test_a_script_without_a_guard_may_load_a_copy(tiny, tmp_path):
    """Processes that read files do not run it again."""
    script = tmp_path / "script.py"
    script.write_text(
        f"from scenarios.datasets.check import examine\nfrom pathlib import Path\n"
        f"print(examine(Path({str(tiny)!r}), regenerate=0).problems, 'once')\n"
    )
    done = subprocess.run([sys.executable, script], capture_output=True, text=True, timeout=120)
    assert (done.stdout, done.returncode) == ("() once\n", 0), done.stderr


@pytest.mark.slow
def test_a_flipped_bit_is_told(cached):
    path = next((cached / "data").rglob("*.nc"))
    content = bytearray(path.read_bytes())
    content[len(content) // 2] ^= 1
    path.write_bytes(content)
    refused(f"data/{path.relative_to(cached / 'data')}", scenarios.load_dataset, cached.name, cache=cached.parent)
    refused("Remove the folder", scenarios.load_dataset, cached.name, cache=cached.parent)


def test_verdicts(tiny, monkeypatch):
    data_set = open_data_set(tiny)
    assert canonical_verdict(data_set) == (True, canonical_verdict(data_set)[1])
    assert "names no canonical hash" in canonical_verdict(data_set)[1]
    monkeypatch.setattr("scenarios.datasets.canonical.canonical", lambda: {data_set.label: Canonical("0" * 64, 1, 1.0)})
    same, line = canonical_verdict(data_set)
    assert not same and "not the canonical ones 000000000000" in line
    # The truth does not matter to it.
    first, *others = data_set.index
    changed = replace(data_set, index=(replace(first, arrays={**first.arrays, "u": "1" * 64}), *others), hash="")
    assert changed.records_hash != data_set.records_hash == replace(data_set, hash="").records_hash


def test_every_canonical_hash_is_of_a_data_set_of_the_package():
    assert set(canonical()) <= set(shipped())
    assert all(len(bytes.fromhex(one.records)) == 32 for one in canonical().values())


def test_where_copies_lie(monkeypatch, tmp_path):
    monkeypatch.delenv("HMTB_CACHE", raising=False)
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    assert cache_folder() == tmp_path / "hmtb-twin"
    monkeypatch.delenv("XDG_CACHE_HOME")
    monkeypatch.setenv("HOME", str(tmp_path))
    assert cache_folder() == tmp_path / ".cache" / "hmtb-twin"
    refused("unknown data set", scenarios.load_dataset, "hmtb-none-v1", cache=tmp_path)
