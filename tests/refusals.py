"""One line per refusal: a call that must raise an error of the package with a message."""

from collections.abc import Callable

import pytest

from hmtb_twin import TwinError
from scenarios.files.errors import ScenarioError
from sysid import SysidError


def refused(match: str, call: Callable[..., object], *arguments: object, **options: object) -> None:
    """Check that a call is refused with a message."""
    with pytest.raises((SysidError, TwinError, ScenarioError), match=match):
        call(*arguments, **options)
