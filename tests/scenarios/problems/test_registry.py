"""Problems by name: all exist, are the same each time, and unknown names are refused with what there is."""

import numpy as np
import pytest

from scenarios.problems.problem import common_frequencies
from scenarios.problems.registry import names, problem
from tests.refusals import refused

FEW = ("p2", "quiet-3-2", "published-4.8", "random-hard-2", "feedback", "shared", "shared-alone", "mimo@1000")


@pytest.mark.parametrize("name", FEW)
def test_same_seed_same_record(name):
    """Also when the problem is made anew."""
    record = problem(name).draw(3)
    again = problem.__wrapped__(name).draw(3)
    assert np.array_equal(record.u, again.u) and np.array_equal(record.y, again.y)
    assert not np.array_equal(record.y, problem(name).draw(4).y)


def test_every_listed_problem_is_whole():
    """Each can be asked, and its bound is that of its task."""
    for listed in names().values():
        for name in listed:
            one = problem(name)
            task = one.task(None)
            assert one.name == name
            assert one.truth.input_path().is_stable()
            assert np.array_equal(task.frequencies, common_frequencies(0.02)), "frequencies must not tell the problem"
            chosen = one.task(None, "select")
            assert np.array_equal(chosen.frequencies, task.frequencies)
            assert chosen.chooses and chosen.most_order >= one.truth.input_path().minimal().order


@pytest.mark.parametrize(
    ("name", "last_pole", "last_zero"),
    [
        ("random-easy-1", 0.3354065015411575, -0.058766340430394894),
        ("random-medium-2", 0.7165258375849624, 0.06259321457048449),
        ("random-hard-3", 0.3462414504172721, 0.00036990886968386394),
        ("quiet-5-2", -0.013252978274472898, 1.8075216233340814),
    ],
)
def test_random_systems_are_the_same_everywhere(name, last_pole, last_zero):
    """A name alone says what a system is: last coefficients of denominator and numerator."""
    truth = problem(name).polynomials
    denominator = np.convolve(truth.A, truth.F)
    assert denominator[-1] == pytest.approx(last_pole, rel=1e-9)
    assert truth.B[-1] == pytest.approx(last_zero, rel=1e-9)


def test_another_length():
    """Of the same system: noise and truth do not change."""
    short, full = problem("p2@500"), problem("p2")
    assert len(short.draw(0)) == 500
    assert short.variance == full.variance
    assert np.array_equal(short.draw(0).u, full.draw(0).u[:500])


@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("p6", "did you mean"),
        ("feedbck", "feedback"),
        ("p2@12", "at least|from 200"),
        ("p2@many", "whole number"),
        ("random-hard-0", "did you mean"),
    ],
)
def test_unknown_names(name, message):
    """Say what was probably meant."""
    refused(message, problem, name)
