"""Every figure of the thesis is in the map once."""

import pytest

from scenarios.report.figures import Picture
from scenarios.thesis.figure_map import KINDS, map_figures


def test_all_figures_of_the_thesis_are_there_once():
    numbers = [number for kind in KINDS for number in kind.numbers]
    assert len(numbers) == len(set(numbers))
    assert set(numbers) == {str(n) for n in range(1, 89)} | {f"A{n}" for n in range(1, 64)}


def test_only_pictures_of_hardware_screens_and_diagrams_have_no_counterpart():
    without = {int(number) for kind in KINDS if kind.instead for number in kind.numbers}
    assert without == {*range(1, 11), *range(17, 20), 37, 38, 88}


def test_counterparts_are_laid_beside_the_figures_and_gaps_are_told():
    ours = Picture(7, "transfer-function", "<svg/>", "A transfer function.", ("22", "A2"), 1.2)
    entries = {entry.kind.numbers: entry for entry in map_figures({"22": (ours,), "A2": (ours,)})}
    entry = entries["22", "A2", "A17"]
    assert entry.pictures == {"22": (ours,), "A2": (ours,), "A17": ()}
    assert entry.missing == ("A17",)
    assert entries["17",].missing == ()


def test_a_figure_that_the_thesis_does_not_have_is_refused():
    with pytest.raises(ValueError, match=r"figures A64 of the thesis: expected 1 to 88 and A1 to A63"):
        map_figures({"A64": ()})
