"""Contestants by name: estimators that the test bench knows how to call."""

from types import MappingProxyType

from scenarios.estimators.catalogue_entry import Entry
from scenarios.estimators.contestant import Contestant
from scenarios.estimators.entries_faulty import FAULTY
from scenarios.estimators.entries_ours import OURS
from scenarios.estimators.entries_peers import PEERS
from scenarios.files.errors import ScenarioError, unknown

ENTRIES = MappingProxyType({entry.contestant.name: entry for entry in (*OURS, *PEERS, *FAULTY)})
"""All of them."""


def names() -> tuple[str, ...]:
    """Names of all contestants, also of those whose packages are not installed."""
    return tuple(ENTRIES)


def available(name: str) -> tuple[bool, str]:
    """Whether a contestant can be run here.

    Returns:
        The answer, and where it is no, what is missing and how to get it.

    Raises:
        ScenarioError: No contestant has the name.
    """
    return _entry(name).available()


def contestant(name: str) -> Contestant:
    """The contestant of a name, with the version of its package as it is installed.

    Raises:
        ScenarioError: No contestant has the name, or what it needs is not installed.
    """
    entry = _entry(name)
    can_run, why = entry.available()
    if not can_run:
        raise ScenarioError(why)
    return entry.versioned()


def _entry(name: str) -> Entry:
    if name not in ENTRIES:
        raise ScenarioError(unknown("contestant", name, ENTRIES))
    return ENTRIES[name]
