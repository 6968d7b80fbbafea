"""The input-output record: one experiment as the analyst sees it."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any, Literal, NoReturn

import numpy as np
from numpy.typing import ArrayLike, NDArray

from sysid.records.arguments import one_of, real_number, sampling_interval, shortened, truth_value, whole_number
from sysid.records.arrays import LINE, FloatArray, Locked, lock, real_array, rectangular
from sysid.records.channels import channel_indices, channel_labels, default_names, matching_channels
from sysid.records.errors import Message, SysidError
from sysid.records.labelled import Labelled
from sysid.records.printing import counted
from sysid.records.trends import difference, trend

LARGEST = 1e60  # largest magnitude of a signal, its inverse the smallest: sums of squares must stay finite


def _refuse_missing_interval() -> NoReturn:
    """Raise the error of a record without a sampling interval."""
    raise SysidError(
        "IOData(u, y) given without dt, expected the sampling interval dt in s, such as IOData(u, y, dt=0.02)"
    )


@dataclass(frozen=True, eq=False, repr=False)
class IOData(Labelled, Locked):
    """Uniformly sampled inputs and outputs of one experiment, time first.

    Slicing, detrending and selecting return new records that keep names, units and inter-sample behaviour.
    A sequence of `IOData` is a multi-experiment data set; every estimator accepts one.

    Attributes:
        u: Inputs (N, nu); a 1-D array is taken as one channel. None for a time series, which has none (N, 0).
        y: Outputs (N, ny); a 1-D array is taken as one channel.
        dt: Sampling interval in s.
        input_names: One name per input; `u1, u2, ...` by default.
        output_names: One name per output; `y1, y2, ...` by default.
        input_units: One unit per input; empty by default.
        output_units: One unit per output; empty by default.
        intersample: Behaviour of the input between samples: held (`zoh`), linear (`foh`), band-limited (`bl`). A
            discrete-time estimate does not depend on it; its conversion by `d2c` does.
        window: Number of leading samples that only initialise a model: they enter no cost and no score.
        start: Time of the first sample in s; a slice keeps the time of the whole.
        missing: Whether NaN among the outputs marks samples that were lost; without it NaN is refused. Inputs must be
            complete. `oe`, `armax`, `bj`, `n4sid` and `pem_ss` use every known output; `arx`, `iv4` and `okid` omit
            equations with a missing one; `spa`, `covf`, `predict`, `residuals` and `compare` accept such records too.
            All other functions refuse them and accept their `complete_parts()`.
        name: Name of the experiment.
        input_offset: Operating point that was subtracted from the inputs, by `detrend` or `subtract` (nu,), of a trend
            its mean; None if u holds the signals themselves. Estimates keep it.
        output_offset: The same of the outputs (ny,); both or none.

    Raises:
        SysidError: Empty, non-real, NaN or infinite values, unequal lengths, more channels than samples,
            no dt or `dt <= 0`, a window that leaves nothing, or names and units that do not match the channels.
    """

    u: FloatArray
    y: FloatArray
    if TYPE_CHECKING:
        dt: float
    else:
        # required all the same: a call without it gets the error of this package, not that of Python
        dt: float = field(default_factory=_refuse_missing_interval)
    input_names: tuple[str, ...] | None = field(default=None, kw_only=True)
    output_names: tuple[str, ...] | None = field(default=None, kw_only=True)
    input_units: tuple[str, ...] | None = field(default=None, kw_only=True)
    output_units: tuple[str, ...] | None = field(default=None, kw_only=True)
    intersample: Literal["zoh", "foh", "bl"] = field(default="zoh", kw_only=True)
    window: int = field(default=0, kw_only=True)
    start: float = field(default=0.0, kw_only=True)
    name: str = field(default="", kw_only=True)
    missing: bool = field(default=False, kw_only=True)
    input_offset: FloatArray | None = field(default=None, kw_only=True)
    output_offset: FloatArray | None = field(default=None, kw_only=True)

    def __post_init__(self) -> None:
        """Check and lock."""
        missing = truth_value("missing", self.missing)
        y = _channels("y", self.y, missing=missing)
        # an array (N, 0) is what slices and copies of a time series pass on
        empty = self.u is None or (isinstance(self.u, np.ndarray) and self.u.shape == (len(y), 0))
        u = lock(np.zeros((len(y), 0))) if empty else _channels("u", self.u)
        if len(u) != len(y):
            raise SysidError(f"u and y must be equally long: u has {len(u)} samples, y has {len(y)}")
        dt = sampling_interval(self.dt)
        one_of("intersample", self.intersample, ("zoh", "foh", "bl"))
        window = whole_number("window", self.window, 0)
        if window >= len(u):
            raise SysidError(f"window of {self.window} samples leaves nothing of a record of {len(u)}")
        nu, ny = u.shape[1], y.shape[1]
        checked: dict[str, Any] = {
            "u": u,
            "y": y,
            "dt": dt,
            "window": window,
            "start": real_number("start", self.start, "be a finite time in s", lambda time: bool(np.isfinite(time))),
            "missing": missing,
            "input_names": channel_labels("input_names", self.input_names, default_names("u", nu)),
            "output_names": channel_labels("output_names", self.output_names, default_names("y", ny)),
            "input_units": channel_labels("input_units", self.input_units, ("",) * nu),
            "output_units": channel_labels("output_units", self.output_units, ("",) * ny),
        }
        if self.input_offset is not None or self.output_offset is not None:
            # One without the other is refused where there are channels: `retrend` needs both.
            checked["input_offset"] = _offset("input_offset", self.input_offset, nu)
            checked["output_offset"] = _offset("output_offset", self.output_offset, ny)
        channel_labels("input and output names", (*checked["input_names"], *checked["output_names"]), ("",) * (nu + ny))
        for attribute, value in checked.items():
            object.__setattr__(self, attribute, value)

    def __len__(self) -> int:
        """Number of samples N."""
        return len(self.u)

    def __repr__(self) -> str:
        """One short line: the text in brackets."""
        return f"<IOData {shortened(str(self), LINE)}>"

    def __str__(self) -> str:
        """One line: length, interval, channels with their units."""
        name = f"{self.name}: " if self.name else ""
        window = f", the first {self.window} to initialise" if self.window else ""
        inputs = f"input {_with_units(self.input_names, self.input_units)}" if self.nu else "no input"
        outputs = _with_units(self.output_names, self.output_units)
        return f"{name}{counted(len(self), 'sample')} every {self.dt:g} s{window}; {inputs}; output {outputs}"

    def _variables(self) -> tuple[dict[str, Any], dict[str, Any], dict[str, Any]]:
        sides = (
            ("input", self.u, self.input_names, self.input_units, self.input_offset),
            ("output", self.y, self.output_names, self.output_units, self.output_offset),
        )
        variables = {
            name: (
                "time",
                values[:, k],
                {"role": role, "units": unit, **({} if offset is None else {"offset": float(offset[k])})},
            )
            for role, values, names, units, offset in sides
            for k, (name, unit) in enumerate(zip(names or (), units or (), strict=True))
        }
        if "time" in variables:
            raise SysidError(f"expected names that differ from time, got {', '.join(variables)}")
        attributes = {key: getattr(self, key) for key in ("dt", "name", "intersample", "window")}
        return variables, {"time": ("time", self.time, {"units": "s"})}, {**attributes, "missing": int(self.missing)}

    def __add__(self, other: object) -> "Experiments":
        """Several experiments of one data set, MATLAB's merge: every estimator fits one model to all.

        Raises:
            SysidError: Records that differ in `dt`, in the number or names of channels, or in units.
        """
        return Experiments((self,)) + other

    def __radd__(self, other: object) -> "Experiments":
        """So that `sum(records)`, which begins at 0, joins them as well."""
        return Experiments((self,)) if isinstance(other, int) and other == 0 else NotImplemented

    def plot(self) -> Any:
        """Outputs over inputs, a panel per channel, as a matplotlib figure; see `sysid.plots.record` for options."""
        return _plotters[-1](self)

    @property
    def nu(self) -> int:
        """Number of inputs."""
        return int(self.u.shape[1])

    @property
    def ny(self) -> int:
        """Number of outputs."""
        return int(self.y.shape[1])

    @property
    def time(self) -> FloatArray:
        """Sampling instants in s, from `start`, (N,)."""
        return self.start + np.arange(len(self), dtype=np.float64) * self.dt

    @property
    def known(self) -> NDArray[np.bool_]:
        """Mask of the output samples that are not missing (N, ny)."""
        return np.asarray(np.isfinite(self.y))

    @property
    def complete(self) -> bool:
        """Whether no output sample is missing."""
        return not self.missing or bool(self.known.all())

    def complete_parts(self, *, shortest: int = 1) -> tuple["IOData", ...]:
        """Cut the record at its gaps: experiments without missing samples, for every estimator.

        Args:
            shortest: Parts with fewer samples after the initialisation window are dropped.

        Raises:
            SysidError: No part is that long.
        """
        if self.complete:
            return (self,)
        # Edges of a mask that is false beyond both ends of the record.
        complete = np.concatenate(([False], self.known.all(axis=1), [False]))
        edges = np.diff(complete.astype(int))
        starts, stops = np.flatnonzero(edges == 1), np.flatnonzero(edges == -1)
        lengths = stops - np.maximum(starts, self.window)
        shortest = whole_number("shortest", shortest, 1)
        if not (lengths >= shortest).any():
            longest = int(lengths.max(initial=0))
            raise SysidError(f"no part without missing samples has {shortest} samples; the longest has {longest}")
        stretches = []
        for k in np.flatnonzero(lengths >= shortest):
            stretch = self[int(starts[k]) : int(stops[k])]
            stretches.append(replace(stretch, missing=False))
        return tuple(stretches)

    @property
    def scored(self) -> "IOData":
        """The record without its initialisation window."""
        return self[self.window :] if self.window else self

    def __getitem__(self, part: slice) -> "IOData":
        """Return consecutive samples `data[a:b]`; the rest of the initialisation window stays a window.

        Raises:
            SysidError: Not a slice, a step other than 1, or an empty part.
        """
        ends = (part.start, part.stop) if isinstance(part, slice) else (0.5,)
        if any(not isinstance(end, int | np.integer | None) for end in ends) or part.step not in (None, 1):
            raise SysidError(f"a record is cut by data[a:b] without a step, got data[{part!r}]")
        start, stop, _ = part.indices(len(self))
        if stop <= start:
            raise SysidError(f"data[{part.start}:{part.stop}] of a record of {len(self)} samples is empty")
        at = self.start + start * self.dt
        return replace(self, u=self.u[start:stop], y=self.y[start:stop], window=max(self.window - start, 0), start=at)

    def detrend(self, order: int = 0) -> "IOData":
        """Remove from every channel its least-squares polynomial in time (0: the mean).

        The polynomial is fitted after the initialisation window and removed everywhere. A channel of which only
        rounding would remain becomes zero.

        Raises:
            SysidError: Negative order, or an order that the number of samples does not allow.
        """
        order = whole_number("detrend order", order, 0, len(self) - self.window - 1)
        times = np.linspace(-1.0, 1.0, max(len(self), 2))[: len(self)]
        basis = np.asarray(np.polynomial.legendre.legvander(times, order), dtype=np.float64)
        return self._without(trend(basis, self.u, self.window), trend(basis, self.y, self.window))

    def subtract(self, *, u: ArrayLike = 0.0, y: ArrayLike = 0.0) -> "IOData":
        """Remove a known operating point or trend.

        Args:
            u: Subtracted from the inputs: one value, one per input (nu,), or one per sample and input (N, nu).
            y: Subtracted from the outputs, likewise.

        Raises:
            SysidError: Shapes that do not fit, NaN.
        """
        removed = []
        for name, value, channel in (("u", u, self.u), ("y", y, self.y)):
            offset = real_array(name, value)
            try:
                removed.append(np.broadcast_to(offset, channel.shape))
            except ValueError as error:
                raise SysidError(
                    f"{name}: expected one value, one per channel ({channel.shape[1]},), or shape {channel.shape}, "
                    f"got shape {offset.shape}"
                ) from error
        return self._without(*removed)

    def _without(self, u: FloatArray, y: FloatArray) -> "IOData":
        before = (0.0, 0.0) if self.input_offset is None else (self.input_offset, self.output_offset)
        # the mean of a constant may differ from it by rounding
        levels = [np.where(np.ptp(removed, axis=0) > 0.0, removed.mean(axis=0), removed[0]) for removed in (u, y)]
        return replace(
            self,
            u=difference(self.u, u),
            y=difference(self.y, y),
            input_offset=before[0] + levels[0],
            output_offset=before[1] + levels[1],
        )

    def retrend(self) -> "IOData":
        """Add the operating point that `detrend` or `subtract` removed, of a trend its mean; the inverse of both."""
        if self.input_offset is None or self.output_offset is None:
            return self
        u, y = self.u + self.input_offset, self.y + self.output_offset
        return replace(self, u=u, y=y, input_offset=None, output_offset=None)

    def select(
        self, *, inputs: Sequence[int | str] | None = None, outputs: Sequence[int | str] | None = None
    ) -> "IOData":
        """Keep the channels with these names or indices, in this order; None keeps all.

        Raises:
            SysidError: Unknown name or index, or no channel left.
        """
        i = channel_indices("input", inputs, self.input_names)
        o = channel_indices("output", outputs, self.output_names)
        return replace(
            self,
            u=self.u[:, i],
            y=self.y[:, o],
            input_names=_pick(self.input_names, i),
            output_names=_pick(self.output_names, o),
            input_units=_pick(self.input_units, i),
            output_units=_pick(self.output_units, o),
            input_offset=_picked_offset(self.input_offset, i),
            output_offset=_picked_offset(self.output_offset, o),
        )


class Experiments(tuple[IOData, ...]):
    """Experiments that share their channels and sampling interval, as `record + record` makes them.

    Every function that takes several records takes them.
    """

    __slots__ = ()

    def __add__(self, other: object) -> "Experiments":
        """These experiments and further ones; see `IOData.__add__`."""
        further = (other,) if isinstance(other, IOData) else other
        if not isinstance(further, tuple | list):
            return NotImplemented
        return joined((*self, *further))

    def detrend(self, order: int = 0) -> "Experiments":
        """Every experiment without its own polynomial in time (0: its mean), as `IOData.detrend` removes it."""
        return Experiments(experiment.detrend(order) for experiment in self)

    def __str__(self) -> str:
        """One line per experiment."""
        return "\n".join(str(experiment) for experiment in self)

    def plot(self) -> Any:
        """Outputs over inputs, a panel per channel, all experiments in one figure; see `sysid.plots.record`."""
        return _plotters[-1](self)


def joined(records: Sequence[IOData]) -> Experiments:
    """Experiments of one data set, channels in the sequence of the first.

    Raises:
        SysidError: Something other than records, or records that differ in `dt`, channels or units.
    """
    experiments = as_experiments(records, missing=True, series=True)
    first = experiments[0]
    for k, experiment in enumerate(experiments):
        for side in ("input_units", "output_units"):
            expected, units = getattr(first, side), getattr(experiment, side)
            # a unit that is not given may be any
            unlike = [pair for pair in zip(expected, units, strict=True) if all(pair) and pair[0] != pair[1]]
            if unlike:
                raise SysidError(f"experiment {k}: {side} are {units}, those of the first {expected}")
    return Experiments(experiments)


_plotters: list[Callable[[Any], Any]] = []


def register_plotter(plot: Callable[[Any], Any]) -> None:
    """Say what draws records; the figures belong to a room that builds on this one."""
    _plotters.append(plot)


def complete_parts(experiments: "Sequence[IOData]") -> "list[IOData]":
    """Parts of experiments without missing samples, in their sequence."""
    return [part for experiment in experiments for part in experiment.complete_parts()]


def as_experiments(
    data: IOData | Sequence[IOData], *, missing: bool = False, series: bool = False
) -> tuple[IOData, ...]:
    """Return the experiments of a data set as a tuple, checked to belong together; channels as in the first, by name.

    `missing` allows missing output samples, `series` time series, which are records without input.

    Raises:
        SysidError: No experiment, something other than `IOData`, records that differ in `dt` or channels, or missing
            samples or time series that are not allowed.
    """
    if not isinstance(data, IOData | Sequence) or isinstance(data, str):
        raise SysidError(
            f"expected an IOData record or a sequence of them, got {type(data).__name__}; IOData(u, y, dt) makes "
            "a record of arrays"
        )
    records = (data,) if isinstance(data, IOData) else tuple(data)
    if not records:
        raise SysidError("expected at least one experiment, got an empty sequence")
    for i, record in enumerate(records):
        if not isinstance(record, IOData):
            raise SysidError(f"experiment {i}: expected an IOData record, got {type(record).__name__}")
        if not record.nu and not series:
            raise SysidError(
                "expected an input, got a time series without one; ar, arma, n4sid and pem_ss fit its model, spa and "
                "welch estimate its spectrum, forecast continues it"
            )
        first = records[0]
        if (record.nu, record.ny) != (first.nu, first.ny):
            raise SysidError(
                f"experiment {i} has {record.nu} input(s) and {record.ny} output(s), "
                f"the first has {first.nu} and {first.ny}"
            )
        if not np.isclose(record.dt, first.dt, rtol=1e-9, atol=0.0):
            raise SysidError(f"experiment {i} is sampled every {record.dt} s, the first every {first.dt} s")
        if not missing and not record.complete:
            raise SysidError(
                f"experiment {i} lacks {int((~record.known).sum())} of {record.y.size} output samples, all are needed "
                "here; data.complete_parts() cuts it into experiments without gaps"
            )
    aligned = []
    for i, record in enumerate(records):
        aligned.append(in_sequence_of(records[0], record, owner="experiment 0", other=f"experiment {i}"))
    return tuple(aligned)


def in_sequence_of(first: IOData, record: IOData, *, owner: str, other: str) -> IOData:
    """The record with its channels in the sequence of another one's, by name; `owner` and `other` name them in errors.

    Raises:
        SysidError: Channels of other names.
    """
    inputs = matching_channels("input", first.input_names, record.input_names, owner=owner, other=other)
    outputs = matching_channels("output", first.output_names, record.output_names, owner=owner, other=other)
    sorted_already = inputs == sorted(inputs) and outputs == sorted(outputs)
    return record if sorted_already else record.select(inputs=inputs, outputs=outputs)


def _offset(name: str, offset: FloatArray | None, count: int) -> FloatArray:
    values = lock(real_array(name, np.zeros(0) if offset is None else offset))
    if values.shape != (count,):
        raise SysidError(f"{name}: expected one value per channel, shape ({count},), got {offset}")
    return values


def _picked_offset(offset: FloatArray | None, channels: Sequence[int]) -> FloatArray | None:
    return None if offset is None else offset[channels]


def _with_units(names: Sequence[str] | None, units: Sequence[str] | None) -> str:
    labels = []
    for name, unit in zip(names or (), units or (), strict=True):
        labels.append(f"{name} [{unit}]" if unit else name)
    return ", ".join(labels)


def as_record(data: IOData) -> IOData:
    """Check that the data are a single record."""
    if not isinstance(data, IOData):
        message = f"expected an IOData record, got {type(data).__name__}"
        if isinstance(data, Sequence) and not isinstance(data, str):
            message += "; take several experiments one after the other: [... for one in data]"
        raise SysidError(message)
    return data


def _channels(name: str, value: FloatArray, *, missing: bool = False) -> FloatArray:
    raw = rectangular(name, value)
    if missing and raw.dtype.kind == "f" and np.isnan(raw).any() and raw.ndim in (1, 2):
        gaps = np.isnan(raw)
        if gaps.all(axis=0).any():
            raise SysidError(f"{name}: a channel has no known sample at all")
        # The other checks refuse NaN: they see the record with its gaps filled.
        filled = _channels(name, np.where(gaps, 0.0, raw)).copy()
        filled[gaps.reshape(filled.shape)] = np.nan
        return lock(filled)
    if raw.dtype.kind in "biuf" and not np.isfinite(raw).all() and raw.ndim in (1, 2):
        table = raw[:, None] if raw.ndim == 1 else raw
        index, channel = np.argwhere(~np.isfinite(table))[0]
        count = int((~np.isfinite(table)).sum())
        text = f"{name}: {count} sample(s) NaN or infinite, the first in channel {channel} at index {index}"
        if name != "y":
            raise SysidError(
                f"{text}; expected complete inputs: cut the data there into experiments, or fill in the value that was "
                "held if the input is logged only when it changes"
            )
        advice = "; missing=True takes NaN for samples that were lost"
        raise SysidError(Message(text + advice, "lost-samples", missing=advice))
    out = real_array(name, value)
    if out.ndim == 1:
        out = out[:, None]
    if out.ndim != 2:
        raise SysidError(f"{name}: expected time first, shape (N, channels) or (N,), got shape {out.shape}")
    if out.size == 0:
        raise SysidError(f"{name}: expected at least one sample and one channel, got shape {out.shape}")
    largest = np.abs(out).max(axis=0)
    if ((largest > LARGEST) | ((largest > 0.0) & (largest < 1.0 / LARGEST))).any():
        raise SysidError(
            f"{name}: channels with largest values {largest} given, expected {1.0 / LARGEST:g} to {LARGEST:g}: "
            "sums of squares would leave the range of numbers; change the unit"
        )
    if out.shape[1] > out.shape[0]:
        raise SysidError(
            f"{name}: shape {out.shape} has more channels than samples; expected time first, (N, channels)"
        )
    return lock(out)


def _pick(labels: tuple[str, ...] | None, index: list[int]) -> tuple[str, ...]:
    return tuple((labels or ())[i] for i in index)
