"""The textbook problems equal those that the estimators themselves are tested on."""

import sys
from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path

import numpy as np
import pytest

from scenarios.problems.linear_problem import LinearProblem
from scenarios.problems.registry import problem

CONFTEST = Path(__file__).parents[2] / "sysid" / "conftest.py"


def test_equal_to_those_of_the_analyst() -> None:
    """Records bit by bit, parameters, and the information to what five noise draws tell of it."""
    spec = spec_from_file_location("analyst_problems", CONFTEST)
    assert spec is not None and spec.loader is not None
    module = module_from_spec(spec)
    sys.modules[spec.name] = module
    spec.loader.exec_module(module)
    for name in ("p1", "p2", "p3", "p4", "p5"):
        ours, theirs = problem(name), getattr(module, f"make_{name}")()
        assert isinstance(ours, LinearProblem)
        record, other = ours.draw(5), theirs.draw(5)
        assert np.array_equal(record.u, other.u) and np.array_equal(record.y, other.y)
        bound = ours.bound(None)
        assert bound is not None
        assert np.array_equal(bound.parameters, theirs.parameters)
        deviation = np.sqrt(np.diag(np.linalg.inv(theirs.information())))
        assert np.sqrt(np.diag(bound.covariance)) == pytest.approx(deviation, rel=0.02)
