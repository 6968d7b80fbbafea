"""Waveform: one period of an excitation in V, as a record and as a file: 100 points, or a signal of any length."""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from math import isfinite, nan
from pathlib import Path
from types import MappingProxyType
from typing import NamedTuple

import numpy as np

from hmtb_twin.files.atomic_write import write_whole
from hmtb_twin.parameters.values import SAMPLE_RATE
from scenarios.files.errors import ScenarioError
from sysid import SysidError
from sysid.records.importers import SAME_INTERVAL, Choice, records_of
from sysid.records.text_columns import text_columns
from sysid.records.time_stamps import interval_unit, is_time

Parameter = float | int | bool | tuple[float, ...]
"""A parameter of an excitation."""

POINTS = 100
"""Points in one file; they hold one period [Morris1996, sec. II.2B]."""

LONGEST = 86_400.0
"""Longest experiment, s: a day. The recorder of the arm held twenty minutes [Morris1996, sec. II.4]."""

LOUDEST = 1000.0
"""Largest voltage that a file may hold, V; the converters saturate at 10 V."""

FASTEST_RECORD = 100_000.0
"""Highest sampling rate of a record, Hz: the converters' samples per second."""

NO_TEXT = "it is no text, or no path"
"""Reason why a file cannot be read that the operating system does not give."""

WINDOW = POINTS / SAMPLE_RATE
"""Length of one period at the default update rate, s."""


class PowerSpectrum(NamedTuple):
    """One-sided power spectral density of a periodic waveform: frequencies (n,), Hz, and density (n,), V^2/Hz."""

    frequency: np.ndarray
    density: np.ndarray


PLAYED = "played once more"
"""Name of the output that a record needs to be checked as any other one; no file has such a column."""


@dataclass(frozen=True)
class Signal:
    """A signal of one channel.

    Attributes:
        samples: Its samples (n,), V.
        sample_rate: Samples per second, Hz.
    """

    samples: tuple[float, ...]
    sample_rate: float


@dataclass(frozen=True, eq=False)
class Waveform:
    """One period of an excitation.

    Attributes:
        points: Samples of one period `(n,)`, V: 100 of a file, any number of a record.
        kind: Name of the excitation, e.g. ``"prbs"``.
        parameters: Its parameters by name (amplitude in V, frequencies in Hz, times in s).
        update_rate: Rate at which the converter steps through the points, Hz.
    """

    points: np.ndarray
    kind: str
    parameters: Mapping[str, Parameter] = field(default_factory=dict)
    update_rate: float = float(SAMPLE_RATE)

    def __post_init__(self) -> None:
        points = np.array(self.points, dtype=float)
        if points.ndim != 1 or not len(points) or not np.all(np.isfinite(points)):
            raise ScenarioError(f"{self.kind}: expected finite numbers in V (n,), given an array {points.shape}")
        if np.abs(points).max() > LOUDEST:
            raise ScenarioError(
                f"{self.kind}: points up to {np.abs(points).max():g} V given, expected at most {LOUDEST:g} V"
            )
        if not self.update_rate > 0:
            raise ScenarioError(f"update rate must be above 0 Hz, given {self.update_rate}")
        points.setflags(write=False)
        object.__setattr__(self, "points", points)
        object.__setattr__(self, "parameters", MappingProxyType(dict(self.parameters)))

    @property
    def period(self) -> float:
        """Length of one period, s."""
        return len(self.points) / self.update_rate

    def play(self, duration: float, *, iterations: int | None = None, rate: int = SAMPLE_RATE) -> np.ndarray:
        """Repeat the file, holding each point until the next.

        At an update rate above its own the position loop misses points.

        Args:
            duration: Time to play, s.
            iterations: How often to play the file, then 0 V; until the end by default.
            rate: Rate of the position loop, Hz.

        Returns:
            Volts at that rate `(N, 1)` with `N = round(rate * duration)`.

        Raises:
            ScenarioError: The duration is shorter than a sample or longer than `LONGEST`.
        """
        if not 1.0 / rate <= duration <= LONGEST:
            raise ScenarioError(f"duration must be {1.0 / rate} s (one sample) to {LONGEST:g} s, given {duration} s")
        count = round(rate * duration)
        # The small shift keeps k * update_rate / rate from rounding down onto the point before.
        points_passed = np.floor(np.arange(count) * (self.update_rate / rate) + 1e-9).astype(np.int64)
        volts = self.points[points_passed % len(self.points)]
        if iterations is not None:
            volts[points_passed >= iterations * len(self.points)] = 0.0
        return volts[:, None]

    def order_of_excitation(self) -> int:
        """Count the lines of the two-sided spectrum that are not zero [Soderstrom1989, sec. 5.4].

        A sum of m sinusoids has order 2m; a file of 100 points at most 100, a record of n points at most n.
        """
        # Lines of a millionth of the strongest are none: a file written with nine digits has them everywhere.
        power = np.abs(np.fft.fft(self.points)) ** 2
        # A sine sampled at its zeros has order 0: the floor is the rounding of the parts that cancel.
        amplitude = self.parameters.get("amplitude", 0.0)
        largest_line = len(self.points) * amplitude if isinstance(amplitude, float | int) else 0.0
        floor = max(1e-12 * float(power.max()), 1e-20 * largest_line**2)
        return int(np.count_nonzero(power > floor))

    def psd(self) -> PowerSpectrum:
        """Return the power spectral density of one period, mean included; its integral is the mean square."""
        count = len(self.points)
        lines = np.fft.rfft(self.points) / count
        power = np.abs(lines) ** 2
        # The mirror images; zero and the Nyquist frequency, which only an even number of points has, have none.
        power[1 : (count + 1) // 2] *= 2.0
        return PowerSpectrum(np.fft.rfftfreq(count, 1.0 / self.update_rate), power * self.period)


def check_seed(seed: int) -> None:
    """Refuse a seed that a random generator, or the file that records it, cannot hold.

    Raises:
        ScenarioError: The seed is negative or above 2^63 - 1.
    """
    # NetCDF and TOML hold whole numbers of 64 bits with a sign.
    if not isinstance(seed, int | np.integer) or not 0 <= seed < 2**63:
        raise ScenarioError(f"a seed is a whole number from 0 to 2^63 - 1, given {seed}")


MOST_SEEDS = 1000
"""Most repetitions of one command: a study takes two minutes a seed, so a thousand take a day and a half."""


def seed_range(count: int, first: int) -> range:
    """Seeds of a repeated study, checked before any work begins.

    Raises:
        ScenarioError: The count is below one or above `MOST_SEEDS`, or one of the seeds is not valid.
    """
    if not 1 <= count <= MOST_SEEDS:
        raise ScenarioError(f"the number of seeds must be 1 to {MOST_SEEDS}, given {count}")
    check_seed(first)
    check_seed(first + count - 1)
    return range(first, first + count)


def points(*, points: tuple[float, ...]) -> Waveform:
    """A custom waveform, point by point.

    Args:
        points: One period (100,), V.

    Raises:
        ScenarioError: Not 100 finite points, or one above `LOUDEST`.
    """
    if len(points) != POINTS or not np.all(np.isfinite(points)):
        raise ScenarioError(f"a waveform file holds {POINTS} finite numbers, one period; given {len(points)}")
    return Waveform(np.array(points, dtype=float), "points", {"points": tuple(map(float, points))})


def record(*, samples: tuple[float, ...], sample_rate: float = float(SAMPLE_RATE)) -> Waveform:
    """A signal of one's own, of any length, played from its beginning; it repeats where the experiment is longer.

    The excitation computer of the test bed held 100 points; this is what a laboratory of today plays.

    Args:
        samples: The signal (n,), V, two samples or more.
        sample_rate: Its samples per second, Hz.

    Raises:
        ScenarioError: Fewer than two samples, one that is not finite or above `LOUDEST`, or more than `LONGEST` holds.
    """
    if not 0.0 < sample_rate <= FASTEST_RECORD:
        raise ScenarioError(f"record: sample_rate must be above 0 Hz, up to {FASTEST_RECORD:g} Hz, given {sample_rate}")
    if not 2 <= len(samples) <= LONGEST * sample_rate:
        raise ScenarioError(
            f"record: expected 2 samples or more and at most {LONGEST:g} s of them, given {len(samples)} at "
            f"{sample_rate:g} Hz"
        )
    parameters: dict[str, Parameter] = {"samples": tuple(map(float, samples)), "sample_rate": float(sample_rate)}
    return Waveform(np.array(samples, dtype=float), "record", parameters, update_rate=float(sample_rate))


def read_points(path: str | Path) -> tuple[float, ...]:
    """Read a 100-point file: numbers separated by spaces, commas or lines; comments begin with #.

    Returns:
        Its points (100,), V.

    Raises:
        ScenarioError: The file cannot be read, or does not hold 100 numbers.
    """
    path = Path(path)
    return parse_points(_content(path, f"{POINTS} numbers"), str(path))


def read_samples(path: str | Path) -> tuple[float, ...]:
    """Read a signal of any length: one number in V per line, or all in one line; comments begin with #.

    Returns:
        Its samples (n,), V.

    Raises:
        ScenarioError: The file cannot be read, holds something else than numbers, or several columns.
    """
    path = Path(path)
    content = _content(path, "numbers")
    values = parse_numbers(content, str(path), "numbers")
    lines = [line for line in content.decode("utf-8-sig").splitlines() if line.partition("#")[0].strip()]
    # Columns of a table, one after the other, would be no signal.
    if 1 < len(lines) != len(values):
        raise ScenarioError(
            f"waveform file {str(path)!r}: {len(values)} numbers in {len(lines)} lines given, expected one number in V "
            "per line, or the name of a column of a table with a header"
        )
    return values


def read_signals(path: Path, columns: Sequence[str] = (), sample_rate: float | None = None) -> tuple[Signal, ...]:
    """Read signals from a file.

    Args:
        path: A text file of one number in V per line; or a table with a header, of which `columns` name the signals.
        columns: Names of columns, V. A column of times, as t, gives the sampling rate.
        sample_rate: Samples per second, Hz; by default that of the times, without times 50 Hz.

    Raises:
        ScenarioError: No such file or column, a sample that is no finite number, times that are not uniform, or a
            rate that contradicts them.
    """
    if not columns:
        return (Signal(read_samples(path), float(SAMPLE_RATE) if sample_rate is None else float(sample_rate)),)
    if not path.is_file():
        raise ScenarioError(f"no file {str(path)!r}; expected a table with the column {columns[0]!r}")
    _check_header(path, columns[0])
    try:
        table, place = text_columns(path, columns)
        times = any(is_time(name) or interval_unit(name) is not None for name in table)
        # Times may only be confirmed by a stated rate, which an interval beside them would replace.
        interval = None if times else 1.0 / (sample_rate or SAMPLE_RATE)
        missing = [name for name in columns if name not in table]
        # Its own error names the columns that there are.
        everything = table if missing else {**table, PLAYED: table[columns[0]]}
        choice = Choice(tuple(columns), (PLAYED,), None, None, interval, missing=False)
        (record,) = records_of(everything, choice, path, place)
    except SysidError as error:
        raise ScenarioError(f"{error}; of the record {path.name} that is to be played") from error
    rate = 1.0 / float(record.dt)
    if sample_rate is not None and abs(rate - sample_rate) > SAME_INTERVAL * rate:
        raise ScenarioError(
            f"{path.name}: a sampling rate of {sample_rate:g} Hz given, its times have {rate:.6g} Hz; expected one"
        )
    # Times are written with few digits: a rate of 49.9999 Hz would drift against the position loop.
    whole = round(rate)
    if abs(rate - whole) <= SAME_INTERVAL * rate:
        rate = float(whole)
    return tuple(Signal(tuple(column.tolist()), rate) for column in np.asarray(record.u).T)


def _check_header(path: Path, column: str) -> None:
    """Raise `ScenarioError` if the first line of a table is one of numbers, so that no column has a name."""
    lines = _content(path, "a table").decode("utf-8-sig", errors="replace").splitlines()
    first = next((line for line in lines if line.partition("#")[0].strip()), "")
    try:
        for cell in re.split(r"[\s,;]+", first.strip()):
            float(cell)
    except ValueError:
        return
    raise ScenarioError(
        f"{path.name}: column {column!r} given, but its first line is one of numbers; expected a header with the names "
        "of its columns, or no column of a file with one number in V per line"
    )


def parse_points(content: bytes, source: str) -> tuple[float, ...]:
    """Read the content of a 100-point file; see `read_points`.

    Args:
        content: Its bytes.
        source: Its name, for errors.
    """
    values = parse_numbers(content, source, f"{POINTS} numbers")
    try:
        return tuple(points(points=values).points.tolist())
    except ScenarioError as error:
        raise ScenarioError(f"waveform file {source!r}: {error}") from error


def parse_numbers(content: bytes, source: str, expected: str) -> tuple[float, ...]:
    """Read numbers separated by spaces, commas or lines; comments begin with #.

    Args:
        content: Bytes of the file.
        source: Its name, for errors.
        expected: What the file should hold, for errors.

    Raises:
        ScenarioError: It is no text, or a word in it is no finite number.
    """
    try:
        lines = content.decode("utf-8-sig").splitlines()
    except UnicodeDecodeError as error:
        raise _unreadable(source, NO_TEXT, expected) from error
    values: list[float] = []
    for line_number, line in enumerate(lines, start=1):
        for word in line.partition("#")[0].replace(",", " ").split():
            try:
                values.append(float(word))
            except ValueError:
                values.append(nan)
            if not isfinite(values[-1]):
                raise ScenarioError(
                    f"waveform file {source!r}, line {line_number}: expected a finite number in V, given {word!r}"
                )
    return tuple(values)


def _content(path: Path, expected: str) -> bytes:
    """Read the bytes of a file."""
    try:
        return path.read_bytes()
    except (OSError, ValueError) as error:
        # A ValueError is raised for a path that contains a null character.
        reason = error.strerror if isinstance(error, OSError) else NO_TEXT
        raise _unreadable(str(path), reason, expected) from error


def _unreadable(source: str, reason: str | None, expected: str) -> ScenarioError:
    return ScenarioError(f"cannot read waveform file {source!r}: {reason}; expected {expected} in V, one per line")


def points_text(values: Sequence[float]) -> str:
    """Text of a 100-point file, V, one per line, from which `read_points` reads equal points to the last bit."""
    return "".join(f"{float(value)!r}\n" for value in values)


def write_points(values: Sequence[float], path: Path) -> Path:
    """Write points in V as a file that `read_points` reads back equal to the last bit; return its path."""
    write_whole(path, points_text(values))
    return path
