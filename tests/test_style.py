"""What a linter cannot see: no traces of a machine in the text, no dead links, no untyped pass-through of arguments."""

import ast
import os
import re
from importlib import import_module
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
PACKAGES = ("hmtb_twin/", "sysid/", "scenarios/")
TEXT = {
    "",
    *[".py", ".md", ".toml", ".txt", ".cff", ".xml", ".j2", ".html", ".css", ".js", ".csv", ".json", ".yml", ".yaml"],
}
MADE = {"thesis-report", "dist", "build", "__pycache__"}
MACHINE_PATH = re.compile(r"(?<![\w.<~-])/(?:work|root|tmp/dev|opt/pypi\S*|home/\w+)(?=[/\s\"'`,;:)]|$)", re.M)
REGISTRY_HOST = re.compile(r"\b(?:pypi|pythonhosted|npmjs|deb\.debian|archive\.ubuntu|anaconda)\.(?:org|com)\b")
LOCAL_LINK = re.compile(r"\[[^\]]*\]\((?!\w+:|#)([^)\s#]+)")


def is_made(folder: str) -> bool:
    """Whether tools or commands create a folder of this name."""
    return folder in MADE or folder.startswith((".venv", "venv"))


def is_hidden(name: str) -> bool:
    """Whether a file or folder in the root of the repository is none of the project's."""
    return name.startswith(".") and name not in {".ci", ".gitignore"}


def product_files() -> list[Path]:
    """Return every text file that belongs to the project; files that tools and commands create are left out."""
    files = []
    for folder, folders, names in os.walk(ROOT):
        top = Path(folder) == ROOT
        # Pruned here, not filtered below: an environment beside the sources holds a hundred thousand files.
        folders[:] = [name for name in folders if not is_made(name) and (not is_hidden(name) or not top)]
        paths = [Path(folder, name) for name in names if not is_hidden(name) or not top]
        files += [path for path in paths if path.suffix in TEXT and path.is_file()]
    return sorted(files)


FILES = {path.relative_to(ROOT).as_posix(): path.read_text(encoding="utf-8") for path in product_files()}


def test_text_names_no_machine_and_no_registry():
    names = {name: MACHINE_PATH.findall(text) + REGISTRY_HOST.findall(text) for name, text in FILES.items()}
    assert not {name: traces for name, traces in names.items() if traces}


def test_links_to_files_of_the_project_resolve():
    links = [(name, link) for name, text in FILES.items() if name.endswith(".md") for link in LOCAL_LINK.findall(text)]
    assert not [f"{name} points to {link}" for name, link in links if not (ROOT / name).parent.joinpath(link).exists()]


@pytest.mark.slow
def test_arguments_are_named_not_passed_through():
    """An untyped keyword pass-through hides which arguments exist: name them, or type them with Unpack."""
    untyped = [
        f"{name}, line {function.lineno}: {function.name}"
        for name, text in FILES.items()
        if name.endswith(".py") and name.startswith(PACKAGES)
        for function in ast.walk(ast.parse(text))
        if isinstance(function, ast.FunctionDef)
        and (rest := function.args.kwarg) is not None
        and (rest.annotation is None or ast.unparse(rest.annotation) in {"Any", "object"})
    ]
    assert not untyped


def test_the_patterns_find_what_they_look_for():
    """The pieces are joined here so that this file does not hold what it forbids."""
    assert MACHINE_PATH.search("see /" + "work/main/README.md")
    assert MACHINE_PATH.search("'/" + "home/someone'")
    assert not MACHINE_PATH.search("</root> frame/work src/root.py")
    assert REGISTRY_HOST.search("https://files.python" + "hosted.org/packages")
    assert LOCAL_LINK.findall("[a](b/c.md#d) [e](https://f.g) ![h](i.png)") == ["b/c.md", "i.png"]


@pytest.mark.parametrize("path", sorted((ROOT / "tests" / "benchmarks").glob("[!t]*.py")), ids=lambda path: path.stem)
def test_benchmarks_import_names_that_exist(path):
    """Benchmarks run rarely; an import of a name that has moved must not wait for their next run."""
    import_module(f"tests.benchmarks.{path.stem}")
