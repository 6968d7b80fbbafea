"""The textbook problems."""

import numpy as np
import pytest

from scenarios.problems.registry import problem
from tests.sysid.problems import SYSTEMS


@pytest.mark.parametrize("name", SYSTEMS)
def test_the_tests_of_sysid_state_the_same_problems(name):
    stated, system = SYSTEMS[name], problem(name)
    record, expected = stated.draw(3), system.draw(3)
    np.testing.assert_array_equal(record.u, expected.u)
    np.testing.assert_array_equal(record.y, expected.y)
    assert record.dt == expected.dt
    np.testing.assert_array_equal(stated.bound.covariance, system.bound(None).covariance)
    np.testing.assert_array_equal(stated.bound.parameters, system.bound(None).parameters)
