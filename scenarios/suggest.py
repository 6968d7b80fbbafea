"""Say what there is, and what was probably meant, when a name is unknown."""

import difflib
from collections.abc import Iterable


def unknown(what: str, given: object, available: Iterable[str]) -> str:
    """Compose the one line for an unknown name.

    Args:
        what: The kind of thing that was looked for, e.g. ``"joint"``.
        given: The name that was given.
        available: The names that exist.

    Returns:
        ``unknown joint 'elbow': did you mean 'elbow_pitch'? There are: ...``
    """
    names = list(available)
    close = difflib.get_close_matches(str(given), names, n=1, cutoff=0.5)
    hint = f" did you mean {close[0]!r}?" if close else ""
    shown = ", ".join(names[:24]) + (f", ... ({len(names)} in all)" if len(names) > 24 else "")
    return f"unknown {what} {given!r}:{hint} There are: {shown}"
