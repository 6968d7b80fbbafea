"""A small study, run once for all tests that look at one."""

import pytest

from scenarios.thesis.campaign import NOMINAL
from scenarios.thesis.comparison import Comparison
from scenarios.thesis.study import run_study


@pytest.fixture(scope="session")
def study() -> Comparison:
    """The whole chain on records of 24 s, of which 20 s remain after settling: ten periods."""
    return run_study(seed=11, duration=24.0, conditions=(NOMINAL,))
