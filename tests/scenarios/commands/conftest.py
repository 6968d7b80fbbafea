"""A table that several commands read."""

import numpy as np
import pytest

from tests.scenarios.commands.lag import DT, signals, table


@pytest.fixture
def csv(tmp_path):
    """A table of a lag."""
    u, y = signals()
    return table(tmp_path / "robot.csv", {"t": DT * np.arange(len(u)), "u": u, "y": y})
