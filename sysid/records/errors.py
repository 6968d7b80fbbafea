"""Error and warning classes of the package."""

import warnings
from collections.abc import Iterable

MOST_CHARACTERS = 1000  # longest message of an error, half a screen: names of channels in it have any length and number


class SysidError(ValueError):
    """Root of the errors of the package: each says what was given and, in the end, what was expected."""

    def __init__(self, message: object = "") -> None:
        text = str(message)
        if len(text) > MOST_CHARACTERS:
            beginning, end = text[: 2 * MOST_CHARACTERS // 3], text[-MOST_CHARACTERS // 4 :]
            text = f"{beginning} ... ({len(text) - len(beginning) - len(end)} characters left out) ... {end}"
        super().__init__(text)


class SysidWarning(UserWarning):
    """Root of the warnings on numerics and data: poor excitation, rank, conditioning, instability."""


def warn_each(messages: Iterable[str], *, stacklevel: int = 1) -> None:
    """Warn of every message, at the caller of the calling function; `stacklevel` counts functions in between."""
    for message in messages:
        warnings.warn(message, SysidWarning, stacklevel=stacklevel + 2)
