"""Code blocks of README and docs run as printed: those of a page in order, in one folder that is empty at first."""

import os
import re
import subprocess
import sys
import tomllib
from contextlib import chdir, redirect_stdout
from io import StringIO
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
PAGES = ("README.md", *sorted(f"docs/{path.name}" for path in (ROOT / "docs").glob("*.md")))
BLOCK = re.compile(r"^( *)```(\w*)\n(.*?)^\1```", re.M | re.S)
INSTALLATION = re.compile(r"(python3 -m venv|(uv )?pip install|git clone|cd hmtb)\b")
"""Commands that .ci/run gives in a fresh clone."""

NOT_RUN = {
    "hmtb station": "tests/scenarios/station run it in a browser",
    "jupyter lab": "waits for a browser; tests/test_notebooks.py runs the notebooks",
    "make thesis": "ten minutes; tests/scenarios/thesis run its parts",
    "make test": "runs these tests",
}
"""Commands that do not run here, and why."""

SMALLER = {"docs/study.md": "tests/scenarios/thesis/test_study_page.py runs it on a smaller study"}
"""Pages whose blocks run elsewhere, and where."""

SHOWN = {"text", "mermaid", "toml"}
"""Languages that no program runs; TOML is read."""
ELSEWHERE = {"matlab", "julia", "r"}
"""Languages whose programs need not be installed; tests/scenarios/datasets and tests/scenarios/estimators run them."""


def blocks(name: str) -> list[tuple[str, str]]:
    """Language and text of the code blocks of a page."""
    text = (ROOT / name).read_text(encoding="utf-8")
    return [(language, re.sub(rf"^{indent}", "", body, flags=re.M)) for indent, language, body in BLOCK.findall(text)]


def commands(body: str) -> str:
    """Lines of a shell block that run here."""
    lines = body.replace("\\\n", " ").splitlines()
    return "\n".join(line for line in lines if not INSTALLATION.match(line) and not any(map(line.startswith, NOT_RUN)))


@pytest.mark.pages
@pytest.mark.parametrize(
    "name",
    [name for name in PAGES if name not in SMALLER and {"sh", "python"} & {language for language, _ in blocks(name)}],
)
def test_code_blocks_run(name, tmp_path, monkeypatch):
    monkeypatch.setenv("PATH", f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}")
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    folder = tmp_path / "work"
    folder.mkdir()
    names: dict = {"__name__": "__main__"}
    for language, body in blocks(name):
        if language == "python":
            with chdir(folder), redirect_stdout(StringIO()):
                exec(compile(body, name, "exec"), names)
        elif language == "sh":
            run = subprocess.run(
                ["bash", "-euo", "pipefail", "-c", commands(body)],
                cwd=folder,
                capture_output=True,
                text=True,
                check=False,
            )
            assert run.returncode == 0, f"{body}\n{run.stdout[-2000:]}\n{run.stderr[-2000:]}"


@pytest.mark.parametrize("name", PAGES)
def test_no_block_stays_unseen(name):
    """A fence of another form would hide its block from these tests; so would commands behind an installation."""
    text = (ROOT / name).read_text(encoding="utf-8")
    fences = re.findall(r"^[ >\t]*(?:`{3,}|~{3,}).*$", text, re.M)
    assert len(fences) == 2 * len(blocks(name))
    assert all(re.fullmatch(r" *```\w*", fence) for fence in fences)
    lines = [line for language, body in blocks(name) if language == "sh" for line in body.splitlines()]
    assert not [
        line
        for line in lines
        if INSTALLATION.match(line) and re.search(r"[;&|]", line.split("#")[0]) and "activate" not in line
    ]
    assert not [line for line in lines if re.search(r"(?<!&)&\s*(#|$)", line)]


@pytest.mark.parametrize("name", PAGES)
def test_languages_of_code_blocks(name):
    for language, body in blocks(name):
        assert language in SHOWN | ELSEWHERE | {"python", "sh"}, (
            f"{name}: a block of language {language!r}: {body[:80]}"
        )
        if language == "toml":
            tomllib.loads(body)


def test_commands_that_do_not_run_are_those_of_the_pages():
    text = "\n".join(body for name in PAGES for language, body in blocks(name) if language == "sh")
    assert all(re.search(rf"^{re.escape(command)}", text, re.M) for command in NOT_RUN)


@pytest.mark.parametrize("name", PAGES)
def test_pages_are_short(name):
    """Ten minutes of reading each, five for README; complete outputs of the benches stand in docs/measured."""
    longest = 1_300 if name == "README.md" else 2_500
    assert len((ROOT / name).read_text(encoding="utf-8").split()) <= longest
