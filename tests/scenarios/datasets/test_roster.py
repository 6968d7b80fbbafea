"""The roster of a class."""

from pathlib import Path

import pytest

from scenarios.datasets.challenge_roster import read_roster
from scenarios.files.errors import ScenarioError


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("", "0 lines given"),
        ("ann\n\nbob\n", "line 2: ''"),
        ("ann\nbob smith\n", "line 2: 'bob smith'"),
        ("../ann\n", "line 1"),
        ("ann\nANN\n", "'ANN' stands on line 1 already"),
        ("a" * 41 + "\n", "1 to 40"),
    ],
)
def test_a_roster_is_read_strictly(tmp_path: Path, text: str, says: str) -> None:
    path = tmp_path / "roster"
    path.write_text(text)
    with pytest.raises(ScenarioError, match=says):
        read_roster(path)
    path.write_text("ann\nbob-2\n")
    assert read_roster(path) == ("ann", "bob-2")
