"""A record and a question."""

import numpy as np
import pytest
from scipy.signal import lfilter

import sysid
from scenarios.estimators.task import Task


@pytest.fixture(scope="session")
def data():
    rng = np.random.default_rng(3)
    u, e = rng.standard_normal((2, 400))
    y = lfilter([0.0, 0.2], [1.0, -0.8], u) + lfilter([1.0], [1.0, -0.8], 0.05 * e)
    return sysid.IOData(u, y, 0.02, input_names=("command",), output_units=("rad",), window=5)


@pytest.fixture(scope="session")
def task():
    return Task("arx", {"na": 1, "nb": 1, "nk": 1}, 1, np.array([0.5, 2.0, 10.0]))
