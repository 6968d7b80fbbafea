"""Disturbances of a record by degree, and the detrending that an analyst may apply before identification."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from types import MappingProxyType

import numpy as np
from scipy.signal import lfilter

from scenarios.experiments.waveform import POINTS
from scenarios.files.toml_file import package_table
from sysid import IOData

Spoil = Callable[[IOData, float, np.random.Generator], IOData]
"""Function of a record, a degree and a random generator that returns the disturbed record."""

OUTLIER_SIZE = 5.0
"""Size of outliers, up or down by chance, where their share is varied, standard deviations of the output."""

OUTLIER_SHARE = 1.0
"""Share of samples that are outliers where their size is varied, percent."""

BURST = 5
"""Length of a burst of lost samples: 0.1 s."""

SLOW_SINE = 1 / 60
"""Frequency of the slow sine, Hz: far below everything that a waveform file excites."""

POLE = 0.9
"""Pole of the first-order filter that colours noise."""

WARM_UP = 200
"""Samples that the filter runs before the noise is used: its start at zero has died out by 0.9^200, 1e-9."""

LOSSY = 1000
"""Length of the segments with lost samples, 20 s: estimating lost samples of a long record takes long."""


def adds(shape: Callable[[IOData], float | np.ndarray]) -> Spoil:
    """Make a disturbance that adds a shape (N,) to the output; the degree scales it, in standard deviations of y."""

    def spoil(data: IOData, degree: float, _: np.random.Generator) -> IOData:
        # As a column: added to y (N, 1), a plain (N,) would broadcast to (N, N).
        column = np.reshape(shape(data), (-1, 1))
        return replace(data, y=data.y + degree * np.std(data.y) * column)

    return spoil


def outliers(data: IOData, percent: float, size: float, rng: np.random.Generator) -> IOData:
    """Move a share of the output's samples, percent, by so many standard deviations, up or down."""
    hit = rng.random(data.y.shape) < percent / 100
    # Drawn for every sample, hit or not: with the same seed, a larger share hits the same samples, the same way, and
    # more of them.
    sign = rng.choice([-1.0, 1.0], data.y.shape)
    return replace(data, y=data.y + hit * sign * size * np.std(data.y))


def held_dropouts(data: IOData, degree: float, rng: np.random.Generator) -> IOData:
    """Drop a share of the output samples, percent, in bursts; each burst holds the last sample before it."""
    segment, lost = _lose_bursts(data, degree, rng)
    # The running maximum of the indices of what arrived is, at each sample, the index of the latest that did.
    latest = np.maximum.accumulate(np.where(lost, 0, np.arange(len(segment))))
    return replace(segment, y=segment.y[latest])


def marked_dropouts(data: IOData, degree: float, rng: np.random.Generator) -> IOData:
    """Drop the samples that `held_dropouts` drops for the same seed, and mark them as missing."""
    segment, lost = _lose_bursts(data, degree, rng)
    if not lost.any():
        return segment
    return replace(segment, y=np.where(lost[:, None], np.nan, segment.y), missing=True)


def _lose_bursts(data: IOData, percent: float, rng: np.random.Generator) -> tuple[IOData, np.ndarray]:
    """A random segment of the record and the mask of its lost samples; the first sample is never lost."""
    segment = _random_segment(data, LOSSY, rng)
    bursts = round(percent / 100 * len(segment) / BURST)
    # Bursts do not overlap: every one has a slot of its own. Slot 0 stays, so that a sample is there to be held.
    slots = rng.choice(np.arange(1, len(segment) // BURST), size=bursts, replace=False)
    lost = np.zeros(len(segment), dtype=bool)
    lost[(BURST * slots[:, None] + np.arange(BURST)).ravel()] = True
    return segment, lost


def _random_segment(data: IOData, length: int, rng: np.random.Generator) -> IOData:
    """A random segment from the start of a period of the waveform on, its mean removed; a shorter record is kept."""
    if length >= len(data):
        return data
    last_period = (len(data) - length) // POINTS
    start = POINTS * int(rng.integers(0, last_period + 1))
    return data[start : start + length].detrend()


def coloured_noise(data: IOData, degree: float, rng: np.random.Generator) -> IOData:
    """Add noise of first order, its pole at `POLE`, to the output, `degree` dB below it."""
    white = rng.standard_normal((len(data) + WARM_UP, data.ny))
    coloured = np.asarray(lfilter([1.0], [1.0, -POLE], white, axis=0))
    return _add_noise(data, degree, coloured[WARM_UP:])


def _add_noise(data: IOData, decibel: float, noise: np.ndarray) -> IOData:
    """Add noise to the output, so many dB below it."""
    # Both deviations are those of the record: the ratio is exact, not that of the noise's distribution.
    scale = 10 ** (-decibel / 20) * np.std(data.y) / np.std(noise)
    return replace(data, y=data.y + scale * noise)


TREATMENTS: Mapping[str, Callable[[IOData], IOData]] = MappingProxyType(
    {
        "nothing removed": lambda data: data,
        "mean removed": lambda data: data.detrend(),
        "line removed": lambda data: data.detrend(1),
    }
)
"""Trends that are removed from input and output before identification."""

AS_IT_IS = ("nothing removed",)
"""Treatments of a record that is identified as it is."""


@dataclass(frozen=True)
class Disturbance:
    """One kind of disturbance of a record.

    Attributes:
        key: Name in results.
        label: Name for people.
        unit: Of the degree.
        degrees: Degrees that are tried, in `unit`.
        spoil: Function that disturbs a record.
        treatments: Trends that are removed before identification, by name in `TREATMENTS`, each in turn.
        draws: Number of random draws at each degree; 1 where nothing is random.
        decibel: Whether the degree is a ratio in dB, otherwise it is drawn on a logarithmic axis.
        falling: Whether a smaller degree spoils more.
        other_structures: Whether structures that the thesis did not choose are tried too, on the first draw.
        whole: Whether it gets the whole record, to cut segments from it, or the segment that all others disturb.
    """

    key: str
    label: str
    unit: str
    degrees: tuple[float, ...]
    spoil: Spoil
    treatments: tuple[str, ...] = AS_IT_IS
    draws: int = 1
    decibel: bool = False
    falling: bool = False
    other_structures: bool = False
    whole: bool = False


SPOILS: Mapping[str, Spoil] = MappingProxyType(
    {
        "bias": adds(lambda data: 1.0),
        "drift": adds(lambda data: np.linspace(0.0, 1.0, len(data))),
        "sway": adds(lambda data: np.sin(2 * np.pi * SLOW_SINE * data.dt * np.arange(len(data)))),
        "outliers": lambda data, degree, rng: outliers(data, degree, OUTLIER_SIZE, rng),
        "outlier size": lambda data, degree, rng: outliers(data, OUTLIER_SHARE, degree, rng),
        "held drop-outs": held_dropouts,
        "marked drop-outs": marked_dropouts,
        "length": lambda data, degree, rng: _random_segment(data, round(degree / data.dt), rng),
        "white noise": lambda data, degree, rng: _add_noise(data, degree, rng.standard_normal(data.y.shape)),
        "coloured noise": coloured_noise,
    }
)
"""Functions that disturb a record, by key of the table."""


def _read_disturbances() -> Mapping[str, Disturbance]:
    """Read the table of disturbances and join each row with its function."""
    sizes = {"size": OUTLIER_SIZE, "share": OUTLIER_SHARE, "pole": POLE}
    disturbances = {}
    for key, row in package_table("disturbances.toml").items():
        label = row.pop("label").format(**sizes)
        degrees = tuple(row.pop("degrees"))
        treatments = tuple(TREATMENTS) if row.pop("detrended", False) else AS_IT_IS
        # What is left of the row has the names of fields.
        disturbances[key] = Disturbance(
            key, label=label, degrees=degrees, spoil=SPOILS[key], treatments=treatments, **row
        )
    return MappingProxyType(disturbances)


DISTURBANCES = _read_disturbances()
"""Every kind of disturbance, by key; `scenarios/data/disturbances.toml` holds the table."""
