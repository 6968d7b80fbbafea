"""Channels by name: their labels, the choice of some, and those of models and records matched."""

import re
import textwrap
from collections.abc import Iterable, Sequence

import numpy as np

from sysid.records.errors import Message, SysidError

LONGEST_LIST = 160  # characters of a list of names in a message


def default_names(letter: str, count: int) -> tuple[str, ...]:
    """Names of channels that were never named: u1, u2, ... or y1, y2, ..."""
    return tuple(f"{letter}{i + 1}" for i in range(count))


def channel_labels(what: str, value: Sequence[str] | None, default: tuple[str, ...]) -> tuple[str, ...]:
    """Check names or units, one per channel; the default where there are none."""
    if value is None:
        return default
    if not isinstance(value, Sequence):
        raise SysidError(f"{what}: expected {len(default)} text(s), one per channel, got {value!r}")
    labels = (value,) if isinstance(value, str) else tuple(value)
    if not all(isinstance(label, str) for label in labels):
        raise SysidError(f"{what}: expected texts, got {labels}")
    if len(labels) != len(default):
        raise SysidError(f"{what}: expected {len(default)}, one per channel, got {len(labels)}: {labels}")
    if what.endswith("names") and len(set(labels)) != len(labels):
        raise SysidError(f"{what}: names must differ, got {labels}")
    return labels


def channel_indices(what: str, channels: Sequence[int | str] | None, names: tuple[str, ...] | None) -> list[int]:
    """Indices of channels given by name or index, in that sequence; all for None."""
    available = names or ()
    if channels is None:
        return list(range(len(available)))
    out: list[int] = []
    # an array of no dimension has no items
    without_items = isinstance(channels, np.ndarray) and not channels.ndim
    single = isinstance(channels, str) or not isinstance(channels, Iterable) or without_items
    for item in (channels,) if single else channels:
        if isinstance(item, str) and item in available:
            out.append(available.index(item))
        elif isinstance(item, int | np.integer) and not isinstance(item, bool) and 0 <= item < len(available):
            out.append(int(item))
        else:
            raise SysidError(f"no {what} {item!r}; available: {', '.join(available)}")
    if not out:
        raise SysidError(f"expected at least one {what}; available: {', '.join(available)}")
    return out


def matching_channels(
    kind: str, names: Sequence[str] | None, others: Sequence[str] | None, *, owner: str, other: str
) -> list[int]:
    """Index among `others` of every channel in `names`, of the kind "input" or "output".

    Channels are matched by name if both sides have the same names, in whatever sequence. Channels that were never
    named, whose names are the defaults u1, u2, ... or y1, y2, ..., match the names of the other side by position.
    Numbered names are not matched with other numbers: u1 is not u2. `owner` and `other` say in errors whose they are.

    Raises:
        SysidError: The names differ.
    """
    names, others = tuple(names or ()), tuple(others or ())
    if names == others:
        return list(range(len(names)))
    if sorted(names) == sorted(others):
        return [others.index(name) for name in names]
    for one, another in ((names, others), (others, names)):
        letter = "u" if kind == "input" else "y"
        unnamed = one == default_names(letter, len(another))
        if unnamed and not any(re.fullmatch(rf"{letter}\d+", name) for name in another):
            return list(range(len(names)))
    advice = f"; dataclasses.replace(record, {kind}_names=...) renames them, record.select({kind}s=...) picks them"
    text = (
        f"the {kind}(s) of {owner} are {listed(names)}, those of {other} {listed(others)}: channels are matched by name"
    )
    raise SysidError(Message(text + advice, "other-channels", names=advice))


def listed(names: Sequence[str] | None) -> str:
    """Names as a list for messages, cut where it gets long."""
    return textwrap.shorten(", ".join(names or ()), LONGEST_LIST, placeholder=" ...")
