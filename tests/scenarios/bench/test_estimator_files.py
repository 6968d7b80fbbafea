"""Hashes of what estimators are made of."""

from itertools import pairwise
from pathlib import Path

import pytest

from scenarios.bench.estimator_files import module_file, own_files, source_hash
from scenarios.estimators.estimator import Estimator


def test_that_of_a_function_follows_its_file(tmp_path: Path):
    mine = Estimator("mine", "mine:function", home=str(tmp_path))
    assert (source_hash(mine), module_file(mine)) == ("", None)
    path = tmp_path / "mine.py"
    path.write_text("a = 1\n")
    first = source_hash(mine)
    path.write_text("a = 2\n")
    assert len(first) == 64 and source_hash(mine) != first
    assert module_file(mine) == path
    assert module_file(Estimator("mine", "mine.py:function", home=str(tmp_path))) == path


def test_it_follows_what_is_imported_from_its_own_folder(tmp_path: Path):
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


def test_what_is_installed_below_its_folder_is_not_its_own(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    (tmp_path / "installed").mkdir()
    (tmp_path / "installed" / "elsewhere.py").write_text("")
    monkeypatch.syspath_prepend(tmp_path / "installed")
    mine = Estimator("mine", "elsewhere:function", home=str(tmp_path))
    assert own_files(mine) == {} and source_hash(mine)


def test_a_package_is_its_first_file(tmp_path: Path):
    (tmp_path / "pack" / "inner").mkdir(parents=True)
    (tmp_path / "pack" / "inner" / "__init__.py").write_text("")
    assert module_file(Estimator("mine", "pack.inner:function", home=str(tmp_path))) == (
        tmp_path / "pack" / "inner" / "__init__.py"
    )


@pytest.mark.parametrize("target", ["scenarios.estimators.ours:oe", "scipy.signal:lfilter"])
def test_modules_that_are_installed_are_found(target: str):
    path = module_file(Estimator("ours", target))
    assert path is not None and path.name in ("ours.py", "__init__.py")


def test_that_of_a_program_follows_every_file_that_it_names(tmp_path: Path):
    program = Estimator("program", "sh run.sh {mat} {task} {model}", program=True, home=str(tmp_path))
    bare = source_hash(program)
    (tmp_path / "run.sh").write_text("true\n")
    first = source_hash(program)
    (tmp_path / "run.sh").write_text("false\n")
    assert len({bare, first, source_hash(program)}) == 3
    assert module_file(program) is None


@pytest.mark.parametrize("words", ["--path {folder}", "--path={folder}"])
def test_that_of_a_program_follows_the_sources_in_folders_that_it_names(words: str, tmp_path: Path):
    folder = tmp_path / "functions"
    folder.mkdir()
    target = f"sh {words.format(folder='functions')} --eval 'exit(mine({{mat}}, {{task}}, {{model}}))'"
    program = Estimator("program", target, program=True, home=str(tmp_path))
    hashes = [source_hash(program)]
    for text in ("code = 1;", "code = 0;"):
        (folder / "mine.m").write_text(text)
        hashes.append(source_hash(program))
    assert len(set(hashes)) == 3
    (folder / "results.csv").write_text("1")
    assert source_hash(program) == hashes[-1]


def test_what_cannot_be_read_is_its_name(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    (tmp_path / "others.sh").write_text("true")
    program = Estimator("program", "sh --tmp=. {csv}", program=True, home=str(tmp_path))
    readable = source_hash(program)

    def refused(path: Path) -> bytes:
        raise PermissionError(path)

    monkeypatch.setattr(Path, "read_bytes", refused)
    assert source_hash(program) not in ("", readable)


def test_what_knows_the_truth_has_no_file():
    assert source_hash(Estimator("perfect", "bench:perfect")) == ""
