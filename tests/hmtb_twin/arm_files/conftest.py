"""A folder as a user might bring it."""

import pytest

from tests.user_arm import write_arm


@pytest.fixture
def folder(tmp_path):
    return write_arm(tmp_path)
