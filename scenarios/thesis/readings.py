"""Claims that can be meant, or estimated, in more than one way: a verdict for each reading."""

from collections.abc import Mapping

from scenarios.thesis.finding import Verdict, verdict


def by_reading(passed: Mapping[str, tuple[int, int]]) -> tuple[Verdict, str]:
    """A verdict that holds by every reading, or `partly` and a sentence that says which reading gives what.

    Args:
        passed: By reading, in words that follow a verdict: the parts that hold, and those there are.

    Returns:
        The verdict, and what to say of it.
    """
    found = {reading: verdict(*counts) for reading, counts in passed.items()}
    said = ", ".join(
        f"{found[reading]} {reading} ({held} of {total} parts)" for reading, (held, total) in passed.items()
    )
    if len(set(found.values())) == 1:
        return next(iter(found.values())), f"{said}: the same by every reading"
    return "partly", f"{said}: the verdict depends on the reading"
