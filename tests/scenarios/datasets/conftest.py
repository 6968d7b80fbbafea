"""A copy of the tiny data set for tests that change it."""

import shutil
from pathlib import Path

import pytest


@pytest.fixture
def copy(tiny, tmp_path):
    return Path(shutil.copytree(tiny, tmp_path / tiny.name))
