"""What runs long says where it is, on stderr only."""

import pytest

from scenarios.commands.output import progress


def test_without_a_terminal_each_step_is_a_line_on_stderr(capsys: pytest.CaptureFixture[str]) -> None:
    with progress("study", lines=True) as bar:
        for done in range(3):
            bar(done, 3, "simulate, arm 1 of 2")
        bar(0, 3, "simulate, arm 2 of 2")
        bar(1, None, "draw")
    out, err = capsys.readouterr()
    assert out == ""
    assert err == "study: simulate, arm 1 of 2\nstudy: simulate, arm 2 of 2\nstudy: draw\n"


def test_what_is_over_soon_says_nothing_without_a_terminal(capsys: pytest.CaptureFixture[str]) -> None:
    with progress("simulating") as bar:
        bar(1, 2)
    assert capsys.readouterr() == ("", "")
