"""One line per refusal: a call that must raise a `SysidError` with a message."""

from collections.abc import Callable

import pytest

from sysid import SysidError


def refused(match: str, call: Callable[..., object], *arguments: object) -> None:
    """Check that a call is refused with a message."""
    with pytest.raises(SysidError, match=match):
        call(*arguments)
