"""Progress of a study: it never stands still for long, and all is done only at the end."""

from itertools import pairwise

import pytest

from scenarios.experiments.campaign import NOMINAL
from scenarios.jobs.progress import Progress, show_progress
from scenarios.thesis.campaign import CONDITIONS
from scenarios.thesis.steps import COSTS, HUNDREDTHS, Part, Steps
from scenarios.thesis.study import ANALYSES, planned_steps

STILL = 10.0
"""Longest time without a move, s."""


class Clock:
    """Time that passes as the work says."""

    now = 0.0

    def __call__(self):
        return self.now


def test_the_bar_of_a_whole_study_moves_with_the_clock(capsys):
    clock, moves = Clock(), []
    with show_progress("study", "lines", clock=clock) as show:

        def report(step, done, total):
            moves.append((clock.now, done, total))
            show(Progress(step, done, total, weighted=True))

        steps = planned_steps(afterwards=("findings", "report"), report=report)
        total = steps.total / HUNDREDTHS
        for name, cost in steps.costs.items():
            with steps.step(name) as part:
                # Twice as slow a machine, and work in as many parts as the longest steps report at least.
                for _, share in part.split(range(3)):
                    for _ in share.split(range(max(int(cost / HUNDREDTHS), 1))):
                        clock.now += 2.0 * cost / HUNDREDTHS / 3 / max(int(cost / HUNDREDTHS), 1)
    times, shares = zip(*((now, done / whole) for now, done, whole in moves), strict=True)
    assert shares[-1] == 1.0
    assert all(share < 1.0 for share in shares[:-1])
    assert list(shares) == sorted(shares)
    assert times[-1] == pytest.approx(2.0 * total)
    # As far as the clock is, so far is the bar.
    assert all(abs(share - now / times[-1]) < 0.01 for now, share in zip(times, shares, strict=True))
    still = [b for a, b in pairwise(moves) if b[1] > a[1]]
    assert max(b[0] - a[0] for a, b in zip([(0.0,), *still], still, strict=False)) < STILL
    lines = capsys.readouterr().err.splitlines()
    assert lines
    assert all(line.startswith("study: ") and " %, " in line and line.endswith(" left") for line in lines)
    assert not any("100 %" in line for line in lines)


def test_a_step_that_says_too_much_waits_for_its_end():
    reports = []
    steps = Steps({"one": 1.0, "two": 3.0}, lambda *report: reports.append(report))
    for name in ("one", "two"):
        with steps.step(name) as part:
            part(7, 5)
            part(0.1)
    assert [done for _, done, _ in reports] == [0, 99, 99, 100, 100, 399, 399, 400]
    assert {total for *_, total in reports} == {400}


def test_parts_add_up_to_the_whole():
    shares = []
    first, second = Part(shares.append).shares(0.75, 0.25)
    for _, part in first.split("abc"):
        part(0.5)
    second(0.5)
    assert shares == pytest.approx([0.125, 0.25, 0.375, 0.5, 0.625, 0.75, 0.875])
    assert list(first.split(())) == []


def test_every_analysis_is_planned_and_the_last_two_only_of_a_thorough_study():
    for thorough in (True, False):
        steps = planned_steps((NOMINAL,), 24.0, thorough=thorough)
        assert [name for name in steps.costs if not name.startswith("simulate")] == [
            name for name in ANALYSES if thorough or name not in ("other arms", "every joint")
        ]
    assert set(COSTS) == {*ANALYSES, "answer", "findings", "report"}
    assert len([name for name in planned_steps(CONDITIONS).costs if name.startswith("simulate")]) == len(CONDITIONS)


def test_no_step_of_a_study_stays_silent_for_ten_seconds(study_run):
    """Shares of a step between two reports, at the cost that it has with whole records."""
    _, moves = study_run
    whole = planned_steps((NOMINAL,)).costs
    for name, cost in planned_steps((NOMINAL,), 24.0).costs.items():
        done = [at for step, at, _ in moves if step == name]
        assert done == sorted(done)
        assert done[-1] - done[0] == cost
        silent = max(b - a for a, b in pairwise(done)) / cost
        assert silent * whole[name] / HUNDREDTHS < STILL, name
    assert [at == total for _, at, total in moves].index(True) == len(moves) - 1
