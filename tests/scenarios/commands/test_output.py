"""Output of commands: progress goes to stderr alone."""

from scenarios.commands.output import progress


def test_short_work_writes_nothing_without_a_terminal(capsys):
    for lines in (False, True):
        with progress("simulating", lines=lines) as bar:
            bar(1, 2)
            bar(1, None, "draw")
    assert capsys.readouterr() == ("", "")
