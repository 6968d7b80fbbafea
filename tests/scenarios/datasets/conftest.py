"""The tiny data set, opened; and a copy of it for tests that change it."""

import shutil
from pathlib import Path

import pytest

from scenarios.datasets import open_data_set


@pytest.fixture(scope="session")
def data_set(tiny):
    return open_data_set(tiny)


@pytest.fixture
def copy(tiny, tmp_path):
    return Path(shutil.copytree(tiny, tmp_path / tiny.name))
