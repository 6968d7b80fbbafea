"""One line per refusal: a call that must raise an error of the package with a message."""

from collections.abc import Callable

import pytest

ROOTS = {"SysidError", "TwinError", "ScenarioError"}
"""Root classes of the errors of our packages, by name: the tests of `sysid` run where the others are not installed."""


def refused(match: str, call: Callable[..., object], *arguments: object, **options: object) -> None:
    """Check that a call is refused with a message."""
    with pytest.raises(ValueError, match=match) as caught:
        call(*arguments, **options)
    ancestors = {kind.__name__ for kind in caught.type.__mro__}
    assert ROOTS & ancestors, f"{caught.type.__name__} is none of {sorted(ROOTS)}"
