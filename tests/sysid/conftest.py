"""Problems with a known answer, those of the test bench, as fixtures of their names."""

import pytest

from scenarios.problems.registry import problem

p1, p2, p3, p4, p5 = (
    pytest.fixture(scope="session", name=name)(lambda name=name: problem(name))
    for name in ("p1", "p2", "p3", "p4", "p5")
)
