"""Problems with a known answer as fixtures of their names; files of tests that need an optional package."""

from importlib.util import find_spec

import pytest

from tests.sysid.problems import SYSTEMS

OPTIONAL = {
    "models/test_conversions.py": "control",
    "models/test_state_space.py": "control",
    "plots/test_*.py": "matplotlib",
    "records/test_frames.py": "xarray",
    "records/test_importers.py": "xarray",
    "test_messages.py": "matplotlib",
    "test_signatures.py": "matplotlib",
}
"""Files of tests that import a package which `pip install ./sysid` leaves out, and its name."""

MISSING = {file: package for file, package in OPTIONAL.items() if find_spec(package) is None}
collect_ignore_glob = list(MISSING)


def pytest_report_header() -> list[str]:
    """Name the tests that are left out, so that nobody takes them for passed."""
    return [f"left out, because {package} is not installed: tests/sysid/{file}" for file, package in MISSING.items()]


p1, p2, p3, p4, p5 = (
    pytest.fixture(scope="session", name=name)(lambda name=name: SYSTEMS[name])
    for name in ("p1", "p2", "p3", "p4", "p5")
)
