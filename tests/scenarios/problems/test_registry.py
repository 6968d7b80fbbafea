"""Problems by name: all exist, are the same each time, and unknown names are refused with what there is."""

import numpy as np
import pytest

from scenarios.files.errors import ScenarioError
from scenarios.problems.registry import names, problem

FEW = ("p2", "quiet-3-2", "published-4.8", "random-hard-2", "feedback", "shared", "shared-alone", "mimo@1000")


@pytest.mark.parametrize("name", FEW)
def test_same_seed_same_record(name: str) -> None:
    """Also when the problem is made anew."""
    record = problem(name).draw(3)
    again = problem.__wrapped__(name).draw(3)
    assert np.array_equal(record.u, again.u) and np.array_equal(record.y, again.y)
    assert not np.array_equal(record.y, problem(name).draw(4).y)


def test_every_listed_problem_is_whole() -> None:
    """Each can be asked, and its bound is that of its task."""
    for listed in names().values():
        for name in listed:
            found = problem(name)
            task = found.task(None)
            assert found.name == name and task is not None
            assert found.truth.input_path().is_stable()
            assert np.array_equal(task.frequencies, found.frequencies)
            assert 0.0 < found.frequencies[0] < found.frequencies[-1] < 0.5 / found.truth.dt
            chosen = found.task(None, "select")
            assert (
                chosen is not None and chosen.chooses and chosen.most_order >= found.truth.input_path().minimal().order
            )


@pytest.mark.parametrize(
    ("name", "last_pole", "last_zero"),
    [
        ("random-easy-1", 0.3354065015411575, -0.058766340430394894),
        ("random-medium-2", 0.7165258375849624, 0.06259321457048449),
        ("random-hard-3", 0.3222459939854508, 0.0002758225583088119),
        ("quiet-5-2", -0.013252978274472898, 1.8075216233340814),
    ],
)
def test_random_systems_are_the_same_everywhere(name: str, last_pole: float, last_zero: float) -> None:
    """A name alone says what a system is: last coefficients of denominator and numerator."""
    truth = problem(name).polynomials
    denominator = np.convolve(truth.A, truth.F)
    assert denominator[-1] == pytest.approx(last_pole, rel=1e-9)
    assert truth.B[-1] == pytest.approx(last_zero, rel=1e-9)


def test_another_length() -> None:
    """Of the same system: noise and truth do not change."""
    short, full = problem("p2@500"), problem("p2")
    assert len(short.draw(0)) == 500
    assert short.variance == full.variance
    assert np.array_equal(short.draw(0).u, full.draw(0).u[:500])


@pytest.mark.parametrize(
    ("name", "told"),
    [
        ("p6", "did you mean"),
        ("quiet-7-1", "did you mean"),
        ("feedbck", "feedback"),
        ("p2@12", "at least|from 200"),
        ("p2@many", "whole number"),
        ("random-hard-0", "did you mean"),
    ],
)
def test_unknown_names(name: str, told: str) -> None:
    """Say what was probably meant."""
    with pytest.raises(ScenarioError, match=told):
        problem(name)
