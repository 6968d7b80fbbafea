"""Dates as texts, `31/1/2021 0:01` or `31.01.2021 00:01:00.5`, and the order of day and month that they have."""

import re
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from sysid.records.errors import SysidError
from sysid.records.optional import optional

if TYPE_CHECKING:
    import pandas as pd

DATE = re.compile(
    r"(?P<first>\d{1,4})(?P<mark>[/.-])(?P<second>\d{1,2}|[A-Za-z]{3})(?P=mark)(?P<third>\d{4}|\d{1,2})"
    r"(?P<gap>T|\s+|$)(?P<clock>\d{1,2}:\d\d\S*(?:\s*[AaPp][Mm])?)?"
)
"""A date, with a clock or without."""

HALF_DAY_CLOCK = re.compile(r"\d{1,2}:\d\d:\d\d(?:[.,]\d+)?\s*[AaPp][Mm]")
"""A clock of twelve hours without a date."""

EVEN = 2.5
"""Largest step of dates that rise evenly, in medians: a single lost sample is no reason to doubt the order."""

WORDS = {"d": "day", "m": "month", "y": "year", "Y": "year", "b": "month"}
"""Words for the codes of dates in formats."""


class AmbiguousDateError(SysidError):
    """Day and month can be told apart neither by a number above 12 nor by the sequence."""


def is_date_text(text: str, *, is_known: bool) -> bool:
    """Whether a text is a clock of twelve hours, or a date in another form than one that is known."""
    return bool(HALF_DAY_CLOCK.fullmatch(text.strip()) or (not is_known and DATE.fullmatch(text.strip())))


def dates(cells: "pd.Series[Any]") -> tuple[NDArray[Any], str]:
    """Times of texts (N,), not-a-time where one cannot be read, and a remark if the sequence tells day from month.

    An order of day, month and year with which every text is a date, and the times rise, is taken: the only one, or
    the only one with which they rise evenly. Dates with dots have the day first.

    Args:
        cells: The texts, of which the first is a date by `is_date_text`.

    Raises:
        AmbiguousDateError: Several orders remain, which give different times.
    """
    texts = cells.astype(str).str.strip().str.replace(",", ".", regex=False)
    first = str(texts.iloc[0])
    match = DATE.fullmatch(first)
    if match is None:
        times = _parsed(texts, "", has_half_days=True).to_numpy()
        return times - times.astype("datetime64[D]"), ""
    has_half_days = first[-1:].lower() == "m" and match["clock"] is not None
    clock = match["clock"] is not None
    start = "T" if match["gap"] == "T" else " "
    by_order: dict[str, NDArray[Any]] = {}
    for order in _orders(match):
        if clock:
            by_order[order] = _parsed(texts, order + start, has_half_days=has_half_days).to_numpy()
        else:
            by_order[order] = _to_times(texts, order).to_numpy()
    readable = {order: times for order, times in by_order.items() if not np.isnat(times).any()}
    if not readable:
        # The order that goes furthest: its first unreadable text is the one to show.
        return max(by_order.values(), key=lambda times: int(np.argmax(np.isnat(times)))), ""
    elapsed = [times - times[0] for times in readable.values()]
    if all(np.array_equal(elapsed[0], other) for other in elapsed):
        return next(iter(readable.values())), ""
    rising = {order: times for order, times in readable.items() if (np.diff(times) >= np.timedelta64(0)).all()}
    if len(rising) == 1:
        ((order, times),) = rising.items()
        return times, f"dates as {first!r} are read as {_in_words(order)}, the only order in which they rise"
    even = {order: times for order, times in rising.items() if _rises_evenly(times, whole_days=not clock)}
    if len(even) == 1:
        ((order, times),) = even.items()
        return times, f"dates as {first!r} are read as {_in_words(order)}, the only order in which they rise evenly"
    choices = " or ".join(_in_words(order) for order in readable)
    raise AmbiguousDateError(
        f"{first!r} may be {choices}, and the sequence does not tell which; expected dates as 2021-01-31T12:00:00.5"
    )


def _orders(match: re.Match[str]) -> tuple[str, ...]:
    """Formats of the date in a text, all that are in use."""
    mark = match["mark"]
    if match["second"].isalpha():
        orders: tuple[str, ...] = ("%d %b %Y",)
    elif len(match["first"]) > 2:
        orders = ("%Y %m %d",)
    else:
        year = "%Y" if len(match["third"]) == 4 else "%y"
        # Nobody writes the month first before a dot.
        orders = (f"%d %m {year}",) if mark == "." else (f"%d %m {year}", f"%m %d {year}")
        if year == "%y" and mark != ".":
            orders = (*orders, "%y %m %d")
    return tuple(order.replace(" ", mark) for order in orders)


def _parsed(texts: "pd.Series[Any]", before: str, *, has_half_days: bool) -> "pd.Series[Any]":
    """Times of texts whose clocks may lack a fraction of the second, or the second."""
    clocks = ["%I:%M:%S %p", "%I:%M:%S.%f %p", "%I:%M %p"] if has_half_days else ["%H:%M:%S", "%H:%M:%S.%f", "%H:%M"]
    if has_half_days:
        texts = texts.str.replace(r"\s*([AaPp][Mm])$", r" \1", regex=True)
    times = _to_times(texts, before + clocks[0])
    for clock in clocks[1:]:
        unread = times.isna()
        if unread.any():
            times[unread] = _to_times(texts[unread], before + clock)
    return times


def _to_times(texts: "pd.Series[Any]", format: str) -> "pd.Series[Any]":
    with optional("files"):
        import pandas as pd

    return pd.to_datetime(texts, format=format, errors="coerce").astype("datetime64[ns]")


def _rises_evenly(times: NDArray[Any], *, whole_days: bool) -> bool:
    """Whether times have no step far above their median; of days alone, which repeat, whether none is left out."""
    steps = np.diff(times).astype("timedelta64[ns]").astype(np.int64)
    if whole_days and (steps == 0).any():
        return bool(steps.max() <= np.timedelta64(1, "D").astype("timedelta64[ns]").astype(np.int64))
    return bool(steps.min() > 0 and steps.max() <= EVEN * np.median(steps))


def _in_words(order: str) -> str:
    return "/".join(WORDS[code] for code in re.findall(r"%(\w)", order))
