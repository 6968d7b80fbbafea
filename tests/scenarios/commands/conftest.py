"""A lag of first order, sampled every 20 ms: its pole at 0.9, its gain one; and tables of it."""

from collections.abc import Mapping
from pathlib import Path

import numpy as np
import pytest
from scipy.signal import lfilter

DT = 0.02


def signals(noise: float = 0.01, samples: int = 1200, seed: int = 0) -> tuple[np.ndarray, np.ndarray]:
    """Input and output."""
    rng = np.random.default_rng(seed)
    u = np.repeat(rng.choice([-1.0, 1.0], samples // 2), 2)
    return u, lfilter([0, 0.1], [1, -0.9], u) + noise * rng.standard_normal(samples)


def table(path: Path, columns: Mapping[str, np.ndarray], *, header: bool = True, delimiter: str = ",") -> Path:
    """Write columns as text."""
    values, head = np.column_stack(list(columns.values())), delimiter.join(columns) if header else ""
    np.savetxt(path, values, delimiter=delimiter, header=head, comments="", fmt="%.17g")
    return path


@pytest.fixture
def csv(tmp_path):
    """A table of a lag."""
    u, y = signals()
    return table(tmp_path / "robot.csv", {"t": DT * np.arange(len(u)), "u": u, "y": y})
