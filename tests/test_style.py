"""What a linter cannot see: no traces of a machine in the text, no dead links, no untyped pass-through of arguments."""

import ast
import re
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
PACKAGES = ("hmtb_twin", "sysid", "scenarios")
TEXT = {
    ".py",
    ".md",
    ".toml",
    ".txt",
    ".cff",
    ".xml",
    ".j2",
    ".html",
    ".css",
    ".js",
    ".csv",
    ".json",
    ".yml",
    ".yaml",
    "",
}
MADE = {"thesis-report", "dist", "build", "__pycache__"}
MACHINE_PATH = re.compile(r"(?<![\w.<~-])/(?:work|root|tmp/dev|opt/pypi\S*|home/\w+)(?=[/\s\"'`,;:)]|$)", re.M)
REGISTRY_HOST = re.compile(r"\b(?:pypi|pythonhosted|npmjs|deb\.debian|archive\.ubuntu|anaconda)\.(?:org|com)\b")
LOCAL_LINK = re.compile(r"\[[^\]]*\]\((?!\w+:|#)([^)\s#]+)")


def product_files() -> list[Path]:
    """Return every text file that belongs to the project; what tools and commands make is left out."""
    files = []
    for path in sorted(ROOT.rglob("*")):
        parts = path.relative_to(ROOT).parts
        made = MADE.intersection(parts) or any(part.startswith((".venv", "venv")) for part in parts)
        hidden = parts[0].startswith(".") and parts[0] not in {".ci", ".gitignore"}
        if path.is_file() and not made and not hidden and path.suffix in TEXT:
            files.append(path)
    return files


FILES = product_files()
PYTHON = [path for path in FILES if path.suffix == ".py" and path.relative_to(ROOT).parts[0] in PACKAGES]
MARKDOWN = [path for path in FILES if path.suffix == ".md"]


def name(path: Path) -> str:
    return path.relative_to(ROOT).as_posix()


@pytest.mark.parametrize("path", FILES, ids=name)
def test_text_names_no_machine_and_no_registry(path: Path) -> None:
    text = path.read_text(encoding="utf-8")
    found = MACHINE_PATH.findall(text) + REGISTRY_HOST.findall(text)
    assert not found, f"{name(path)} names {found}"


@pytest.mark.parametrize("path", MARKDOWN, ids=name)
def test_links_to_files_of_the_project_resolve(path: Path) -> None:
    links = LOCAL_LINK.findall(path.read_text(encoding="utf-8"))
    dead = [link for link in links if not (path.parent / link).exists()]
    assert not dead, f"{name(path)} points to {dead}"


@pytest.mark.parametrize("path", PYTHON, ids=name)
def test_arguments_are_named_not_passed_through(path: Path) -> None:
    functions = [n for n in ast.walk(ast.parse(path.read_text(encoding="utf-8"))) if isinstance(n, ast.FunctionDef)]
    untyped = [
        f"{function.name}, line {function.lineno}"
        for function in functions
        if (rest := function.args.kwarg) is not None
        and (rest.annotation is None or ast.unparse(rest.annotation) in {"Any", "object"})
    ]
    assert not untyped, f"untyped keyword pass-through in {untyped}: name the arguments, or type them with Unpack"


def test_the_patterns_find_what_they_look_for() -> None:
    """The pieces are joined here so that this file does not hold what it forbids."""
    assert MACHINE_PATH.search("see /" + "work/main/README.md")
    assert MACHINE_PATH.search("'/" + "home/someone'")
    assert not MACHINE_PATH.search("</root> frame/work src/root.py")
    assert REGISTRY_HOST.search("https://files.python" + "hosted.org/packages")
    assert LOCAL_LINK.findall("[a](b/c.md#d) [e](https://f.g) ![h](i.png)") == ["b/c.md", "i.png"]
