"""Progress: a bar on a terminal, lines now and then elsewhere."""

import io
import re
import sys
from time import sleep

from scenarios.jobs.progress import Progress, end_activity, show_activity, show_progress


def test_lines_come_now_and_then(capsys):
    time = 0.0
    with show_progress("tiny-v1", clock=lambda: time) as report:
        for time in range(0, 65, 5):
            # The first 100 s of records are those of an earlier run.
            report(Progress("records", time // 10, 30, "experiments", 100.0 + 40.0 * time, 12_700.0))
        time = 90
        report(Progress("baselines", 3, 4))
        time = 130
        report(Progress("baselines", 4, 4))
        time = 170
        report(Progress("trials", 4, 90, "requests", note="the first of each kind"))
        time = 250
        report(Progress("files", 4, None, "files"))
    out, err = capsys.readouterr()
    assert out == ""
    assert err.splitlines() == [
        "tiny-v1: 1 of 30 experiments, 40 x real time, 5 min left",
        "tiny-v1: 4 of 30 experiments, 40 x real time, 5 min left",
        "tiny-v1: baselines 3 of 4",
        "tiny-v1: baselines 4 of 4, 0.025 a second, 0 s left",
        "tiny-v1: 4 of 90 requests, the first of each kind",
        "tiny-v1: 4 files",
    ]


def test_short_work_and_no_display_write_nothing(capsys):
    with show_progress("tiny-v1", "lines") as report:
        report(Progress("records", 3, 3, "experiments", 12.0, 12.0))
    time = 0.0
    with show_progress("tiny-v1", "none", clock=lambda: time) as report:
        for time in (0.0, 1000.0):
            report(Progress("records", 0, 3, "experiments", time, 1e4))
    assert capsys.readouterr() == ("", "")


class Terminal(io.StringIO):
    def isatty(self) -> bool:
        return True


def test_a_terminal_has_a_bar(monkeypatch):
    terminal = Terminal()
    monkeypatch.setattr(sys, "stderr", terminal)
    monkeypatch.setenv("TERM", "xterm")
    monkeypatch.setenv("COLUMNS", "80")
    with show_progress("tiny-v1") as report:
        for done in range(4):
            report(Progress("records", done, 3, "experiments", 4.0 * done, 12.0))
        sleep(0.3)  # it is drawn ten times a second
        report(Progress("baselines", 0, 2))
    printed = re.sub(r"\x1b\[[0-9;?]*[A-Za-z]", "", terminal.getvalue())
    assert re.search(r"3 of 3 experiments, \S+ x real time", printed)
    assert "baselines 0 of 2" in printed
    assert all(len(line) <= 80 for line in re.split(r"[\r\n]", printed))


def test_a_line_on_a_terminal_shows_what_runs_until_something_is_printed(monkeypatch, capsys):
    class Terminal(io.StringIO):
        def isatty(self):
            return True

    with show_activity("quiet"):
        pass
    assert capsys.readouterr().err == ""
    monkeypatch.setenv("TERM", "xterm")
    monkeypatch.setattr(sys, "stderr", Terminal())
    with show_activity("identify"):
        assert "identify" in sys.stderr.getvalue()
        with show_progress("bar"):  # it knows the terminal, in place of the line
            pass
        assert "bar" in sys.stderr.getvalue()
        end_activity()
        shown = sys.stderr.getvalue()
        sleep(0.2)
        assert sys.stderr.getvalue() == shown
