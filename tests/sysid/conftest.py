"""Problems with a known answer as fixtures of their names."""

import pytest

from tests.sysid.problems import SYSTEMS

p1, p2, p3, p4, p5 = (
    pytest.fixture(scope="session", name=name)(lambda name=name: SYSTEMS[name])
    for name in ("p1", "p2", "p3", "p4", "p5")
)
