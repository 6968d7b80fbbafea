"""Hashes of what estimators are made of."""

from pathlib import Path

import pytest

from scenarios.bench_contract.contestant import Contestant
from scenarios.bench_trials.source import module_file, source_hash


def test_that_of_a_function_follows_its_file(tmp_path: Path):
    mine = Contestant("mine", "mine:function", home=str(tmp_path))
    assert (source_hash(mine), module_file(mine)) == ("", None)
    path = tmp_path / "mine.py"
    path.write_text("a = 1\n")
    first = source_hash(mine)
    path.write_text("a = 2\n")
    assert len(first) == 64 and source_hash(mine) != first
    assert module_file(mine) == path


def test_a_package_is_its_first_file(tmp_path: Path):
    (tmp_path / "pack" / "inner").mkdir(parents=True)
    (tmp_path / "pack" / "inner" / "__init__.py").write_text("")
    assert module_file(Contestant("mine", "pack.inner:function", home=str(tmp_path))) == (
        tmp_path / "pack" / "inner" / "__init__.py"
    )


@pytest.mark.parametrize("target", ["scenarios.contestants.ours:oe", "scipy.signal:lfilter"])
def test_modules_that_are_installed_are_found(target: str):
    path = module_file(Contestant("ours", target))
    assert path is not None and path.name in ("ours.py", "__init__.py")


def test_that_of_a_program_follows_every_file_that_it_names(tmp_path: Path):
    program = Contestant("program", "sh run.sh {mat} {task} {model}", program=True, home=str(tmp_path))
    bare = source_hash(program)
    (tmp_path / "run.sh").write_text("true\n")
    first = source_hash(program)
    (tmp_path / "run.sh").write_text("false\n")
    assert len({bare, first, source_hash(program)}) == 3
    assert module_file(program) is None


def test_what_knows_the_truth_has_no_file():
    assert source_hash(Contestant("perfect", "bench:perfect")) == ""
