"""Seeds of a repeated study."""

from scenarios.experiments.waveform import check_seed
from scenarios.files.errors import ScenarioError

MOST = 1000
"""More seeds than these are a mistake: two minutes each for the whole study, a day and a half in all."""


def counted(count: int, first: int) -> range:
    """The seeds from the first one on, checked before any work begins.

    Args:
        count: How many.
        first: The first.

    Returns:
        The seeds.

    Raises:
        ScenarioError: Fewer than one or more than `MOST`, or one of them is no seed.
    """
    if not 1 <= count <= MOST:
        raise ScenarioError(f"seeds must be 1 to {MOST}, given {count}: that many times everything is repeated")
    check_seed(first)
    check_seed(first + count - 1)
    return range(first, first + count)
