"""What the README shows, works."""

import re
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
README = (ROOT / "README.md").read_text(encoding="utf-8")


def block(language: str) -> str:
    """Return the one fenced block of a language."""
    (text,) = re.findall(rf"^```{language}\n(.*?)^```", README, re.M | re.S)
    return text


@pytest.mark.slow
def test_the_python_example_prints_what_the_readme_shows(tmp_path: Path) -> None:
    path = tmp_path / "example.py"
    path.write_text(f"import sys\nsys.path.insert(0, {str(ROOT)!r})\n{block('python')}", encoding="utf-8")
    done = subprocess.run([sys.executable, path], cwd=tmp_path, capture_output=True, text=True, timeout=60)
    assert done.returncode == 0, done.stderr
    number = re.compile(r"\d+\.\d+")
    printed, shown = done.stdout.strip(), block("text").strip()
    assert number.sub("#", printed) == number.sub("#", shown)
    # One step in the last digit is left to other compilers and processors.
    assert list(map(float, number.findall(printed))) == pytest.approx(
        list(map(float, number.findall(shown))), abs=1.5e-3
    ), printed


@pytest.mark.parametrize("command", sorted(set(re.findall(r"`hmtb ([a-z]+)", README))))
def test_every_command_exists(command: str) -> None:
    script = f"import sys; sys.path.insert(0, {str(ROOT)!r}); from scenarios.commands.cli import main; main()"
    done = subprocess.run([sys.executable, "-c", script, command, "--help"], capture_output=True, text=True, timeout=60)
    assert done.returncode == 0, done.stderr
    assert done.stdout.strip(), "help goes to stdout"


def test_the_make_targets_exist() -> None:
    makefile = (ROOT / "Makefile").read_text(encoding="utf-8")
    targets = set(re.findall(r"^make ([a-z]+)", README, re.M))
    assert targets == {"thesis", "test"}
    assert targets <= set(re.findall(r"^([a-z-]+):", makefile, re.M))
