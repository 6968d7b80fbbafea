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
"""Arguments: record, degree, random generator. Returns the disturbed record."""

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

LOSSY = 1000
"""Length of the record parts with lost samples, 20 s: estimating lost samples of a long record takes long."""


def adds(shape: Callable[[IOData], float | np.ndarray]) -> Spoil:
    """A disturbance that adds a shape (N,) to the output, times the degree in standard deviations of the output."""

    def spoil(data: IOData, degree: float, _: np.random.Generator) -> IOData:
        return replace(data, y=data.y + degree * np.std(data.y) * np.reshape(shape(data), (-1, 1)))

    return spoil


def outliers(data: IOData, percent: float, size: float, rng: np.random.Generator) -> IOData:
    """Move a share of the output's samples, percent, by so many standard deviations, up or down."""
    hit = rng.random(data.y.shape) < percent / 100
    return replace(data, y=data.y + hit * rng.choice([-1.0, 1.0], data.y.shape) * size * np.std(data.y))


def held_dropouts(data: IOData, degree: float, rng: np.random.Generator) -> IOData:
    """Drop a share of the output samples, percent, in bursts; each burst holds the last sample before it."""
    part, lost = _lose_bursts(data, degree, rng)
    latest = np.maximum.accumulate(np.where(lost, 0, np.arange(len(part))))
    return replace(part, y=part.y[latest])


def marked_dropouts(data: IOData, degree: float, rng: np.random.Generator) -> IOData:
    """Drop the same samples and mark them as missing."""
    part, lost = _lose_bursts(data, degree, rng)
    return replace(part, y=np.where(lost[:, None], np.nan, part.y), missing=True) if lost.any() else part


def _lose_bursts(data: IOData, percent: float, rng: np.random.Generator) -> tuple[IOData, np.ndarray]:
    """A part of the record and the mask of its lost samples; the first sample is never lost."""
    part = _part(data, LOSSY, rng)
    bursts = round(percent / 100 * len(part) / BURST)
    # Bursts do not overlap: every one has a slot of its own.
    slots = rng.choice(np.arange(1, len(part) // BURST), size=bursts, replace=False)
    lost = np.zeros(len(part), dtype=bool)
    lost[(BURST * slots[:, None] + np.arange(BURST)).ravel()] = True
    return part, lost


def _part(data: IOData, length: int, rng: np.random.Generator) -> IOData:
    """A part that begins where a period of the waveform does, its mean removed; the whole record if it is shorter."""
    if length >= len(data):
        return data
    start = POINTS * int(rng.integers(0, (len(data) - length) // POINTS + 1))
    return data[start : start + length].detrend()


def coloured_noise(data: IOData, degree: float, rng: np.random.Generator) -> IOData:
    """Add noise of first order, its pole at `POLE`, to the output, `degree` dB below it."""
    white = rng.standard_normal((len(data) + 200, data.ny))
    return _noisy(data, degree, np.asarray(lfilter([1.0], [1.0, -POLE], white, axis=0))[200:])


def _noisy(data: IOData, decibel: float, noise: np.ndarray) -> IOData:
    """Add noise to the output, so many dB below it."""
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


@dataclass(frozen=True)
class Disturbance:
    """One kind of disturbance of a record.

    Attributes:
        key: Name in results.
        label: Name for people.
        unit: Of the degree.
        degrees: How much, from nothing or little to a lot.
        spoil: Does it.
        treatments: What is taken off before identifying, each in turn.
        draws: How often chance is drawn; 1 where there is none.
        decibel: Whether the degree is a ratio in dB, otherwise it is drawn on a logarithmic axis.
        falling: Whether a smaller degree spoils more.
        other_structures: Whether structures that the thesis did not choose are tried too, on the first draw.
        whole: Whether it takes the whole record, to cut parts from it, or the part that all others are laid on.
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
        "length": lambda data, degree, rng: _part(data, round(degree / data.dt), rng),
        "white noise": lambda data, degree, rng: _noisy(data, degree, rng.standard_normal(data.y.shape)),
        "coloured noise": coloured_noise,
    }
)


def _listed() -> Mapping[str, Disturbance]:
    table = package_table("disturbances.toml")
    sizes = {"size": OUTLIER_SIZE, "share": OUTLIER_SHARE, "pole": POLE}
    entries = {}
    for key, row in table.items():
        label, degrees = row.pop("label").format(**sizes), tuple(row.pop("degrees"))
        detrended = tuple(TREATMENTS) if row.pop("detrended", False) else AS_IT_IS
        entries[key] = Disturbance(key, label=label, degrees=degrees, spoil=SPOILS[key], treatments=detrended, **row)
    return MappingProxyType(entries)


DISTURBANCES = _listed()
"""Every kind of disturbance, by key; `scenarios/data/disturbances.toml` holds the table."""
