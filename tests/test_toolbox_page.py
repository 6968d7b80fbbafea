"""The toolbox page: its session runs, and every public name of the analyst stands on it."""

import operator
import re
import subprocess
import sys
from pathlib import Path

import pytest

import sysid

ROOT = Path(__file__).parents[1]
PAGE = (ROOT / "docs/toolbox.md").read_text(encoding="utf-8")

RECORDS = {name for name in sysid.__all__ if name[0].isupper()}


@pytest.mark.slow
def test_the_session_runs(tmp_path: Path) -> None:
    (session,) = re.findall(r"^```python\n(.*?)^```", PAGE, re.M | re.S)
    path = tmp_path / "session.py"
    path.write_text(f"import sys\nsys.path.insert(0, {str(ROOT)!r})\n{session}", encoding="utf-8")
    done = subprocess.run([sys.executable, path], cwd=tmp_path, capture_output=True, text=True, timeout=60)
    assert done.returncode == 0, done.stderr
    assert "{'nb': 2, 'nf': 2, 'nk': 2}" in done.stdout
    assert (tmp_path / "bode.png").stat().st_size > 10_000


def test_every_function_stands_on_the_page_and_every_name_on_it_exists() -> None:
    here = " ".join(line.split("|")[2] for line in PAGE.splitlines() if line.count("|") == 4)
    named = set(re.findall(r"\b[a-z_0-9]+\b", here))
    missing = set(sysid.__all__) - RECORDS - named
    assert not missing, f"docs/toolbox.md lacks {sorted(missing)}"
    first = set(re.findall(r"`([a-z_0-9]+)(?:\(|`)", here))
    first -= {"str"}
    for dotted in re.findall(r"`((?:models|recursive|validation)\.[a-zA-Z_.0-9]+)", PAGE):
        assert operator.attrgetter(dotted)(sysid), dotted
    figures = set(re.findall(r"plots\.([a-z_]+)", PAGE))
    drawn = {name for name in sysid.plots.__all__ if name.islower()}
    assert figures == drawn, f"docs/toolbox.md lacks {sorted(drawn - figures)}, has {sorted(figures - drawn)}"
    assert first <= set(sysid.__all__), f"docs/toolbox.md names {sorted(first - set(sysid.__all__))}"
