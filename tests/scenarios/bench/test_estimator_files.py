"""Hashes of what estimators are made of."""

from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import pytest

from scenarios.bench.estimator_files import module_file, own_files, source_hash
from scenarios.estimators.estimator import Estimator


def test_the_hash_of_a_function_follows_its_file(tmp_path, monkeypatch):
    mine = Estimator("mine", "mine:function", home=str(tmp_path))
    assert (source_hash(mine), module_file(mine)) == ("", None)
    path = tmp_path / "mine.py"
    path.write_text("a = 1\n")
    first = source_hash(mine)
    path.write_text("a = 2\n")
    assert len(first) == 64 and source_hash(mine) != first
    assert module_file(mine) == module_file(replace(mine, target="mine.py:function")) == path
    package = tmp_path / "pack" / "inner" / "__init__.py"
    package.parent.mkdir(parents=True)
    package.write_text("")
    assert module_file(replace(mine, target="pack.inner:function")) == package
    # What is installed below its folder is not its own.
    (tmp_path / "installed").mkdir()
    (tmp_path / "installed" / "elsewhere.py").write_text("")
    monkeypatch.syspath_prepend(tmp_path / "installed")
    installed = replace(mine, target="elsewhere:function")
    assert own_files(installed) == {} and source_hash(installed)
    assert source_hash(replace(mine, target=":perfect")) == ""


def test_it_follows_what_is_imported_from_its_own_folder(tmp_path):
    mine = Estimator("mine", "mine.py:function", home=str(tmp_path))
    (tmp_path / "parts").mkdir()
    files = {
        "mine.py": "import numpy\ndef function(data, task):\n    from parts.inner import deep\n",
        "parts/__init__.py": "",
        "parts/inner.py": "from . import deep\nimport beside\n",
        "parts/deep.py": "",
        "beside.py": "",
        "apart.py": "",
        "sysid.py": "",
    }
    for name, text in files.items():
        (tmp_path / name).write_text(text)
    assert list(own_files(mine)) == ["mine.py", "beside.py", "parts/__init__.py", "parts/deep.py", "parts/inner.py"]
    hashes = [source_hash(mine)]
    for name in files:
        (tmp_path / name).write_text(files[name] + "a = 1\n")
        hashes.append(source_hash(mine))
    assert [one != other for one, other in pairwise(hashes)] == [True] * 5 + [False] * 2
    (tmp_path / "mine.py").write_text("def (:\n")
    assert list(own_files(mine)) == ["mine.py"] and source_hash(mine) not in hashes


@pytest.mark.parametrize("target", ["scenarios.estimators.ours:oe", "scipy.signal:lfilter"])
def test_modules_that_are_installed_are_found(target):
    assert module_file(Estimator("ours", target)).name in ("ours.py", "__init__.py")


def test_the_hash_of_a_program_follows_every_file_that_it_names(tmp_path, monkeypatch):
    program = Estimator("program", "sh run.sh {mat} {task} {model}", program=True, home=str(tmp_path))
    hashes = [source_hash(program)]
    for text in ("true\n", "false\n"):
        (tmp_path / "run.sh").write_text(text)
        hashes.append(source_hash(program))
    assert len(set(hashes)) == 3
    assert module_file(program) is None

    def refused(path):
        raise PermissionError(path)

    monkeypatch.setattr(Path, "read_bytes", refused)
    assert source_hash(program) not in ("", *hashes)


@pytest.mark.parametrize("words", ["--path functions", "--path=functions"])
def test_the_hash_of_a_program_follows_the_sources_in_folders_that_it_names(words, tmp_path):
    folder = tmp_path / "functions"
    folder.mkdir()
    target = f"sh {words} --eval 'exit(mine({{mat}}, {{task}}, {{model}}))'"
    program = Estimator("program", target, program=True, home=str(tmp_path))
    hashes = [source_hash(program)]
    for text in ("code = 1;", "code = 0;"):
        (folder / "mine.m").write_text(text)
        hashes.append(source_hash(program))
    assert len(set(hashes)) == 3
    (folder / "results.csv").write_text("1")
    assert source_hash(program) == hashes[-1]
