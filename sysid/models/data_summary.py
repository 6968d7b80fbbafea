"""Description of the data that a model was estimated from."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from sysid.models.record_hash import record_hash
from sysid.records.arrays import FloatArray
from sysid.records.data import IOData
from sysid.records.printing import counted


@dataclass(frozen=True)
class DataSummary:
    """Description of the data of an estimate.

    Attributes:
        samples: Length of each experiment.
        dt: Sampling interval in s.
        input_names: One name per input.
        output_names: One name per output.
        input_units: One unit per input.
        output_units: One unit per output.
        names: Name of each experiment.
        intersample: Behaviour of the inputs between samples, of the first experiment.
        input_offset: Operating point that was subtracted from the inputs, the mean of the experiments by their lengths;
            None if an experiment holds the signals themselves.
        output_offset: The same of the outputs.
        frequencies: Hz, of a frequency response instead of records; `samples` then counts its real and imaginary parts,
            per output.
        output_deviation: Standard deviation of each output, of several experiments each from its own mean; empty of a
            frequency response.
        hashes: Hash of the samples of each experiment, as `record_hash` makes it; empty of a frequency response, and of
            model files of earlier versions.
    """

    samples: tuple[int, ...]
    dt: float
    input_names: tuple[str, ...]
    output_names: tuple[str, ...]
    input_units: tuple[str, ...]
    output_units: tuple[str, ...]
    names: tuple[str, ...]
    intersample: str = "zoh"
    input_offset: tuple[float, ...] | None = None
    output_offset: tuple[float, ...] | None = None
    frequencies: tuple[float, ...] = ()
    output_deviation: tuple[float, ...] = ()
    hashes: tuple[str, ...] = ()

    @staticmethod
    def of(experiments: Sequence[IOData]) -> "DataSummary":
        """Description of the experiments of an estimate."""
        first = experiments[0]
        lengths = [len(e) for e in experiments]
        input_offsets = [e.input_offset for e in experiments]
        output_offsets = [e.output_offset for e in experiments]
        return DataSummary(
            samples=tuple(lengths),
            dt=first.dt,
            input_names=first.input_names or (),
            output_names=first.output_names or (),
            input_units=first.input_units or (),
            output_units=first.output_units or (),
            names=tuple(e.name for e in experiments),
            intersample=first.intersample,
            input_offset=_mean_offset(input_offsets, lengths),
            output_offset=_mean_offset(output_offsets, lengths),
            output_deviation=_deviations(experiments),
            hashes=tuple(record_hash(e) for e in experiments),
        )

    def include(self, record: IOData) -> bool:
        """Whether the record, or its beginning, is an experiment of these data; false where their hash is not known."""
        for length, expected in zip(self.samples, self.hashes, strict=False):
            if length <= len(record) and record_hash(record, length) == expected:
                return True
        return False

    @property
    def labels(self) -> dict[str, Any]:
        """Names and units of the channels, as keyword arguments of `StateSpace`."""
        return {key: getattr(self, key) for key in ("input_names", "output_names", "input_units", "output_units")}

    @property
    def extent(self) -> str:
        """Amount of data, in words."""
        if self.frequencies:
            return f"{len(self.frequencies)} frequencies, {self.frequencies[0]:g} to {self.frequencies[-1]:g} Hz"
        return f"{counted(sum(self.samples), 'sample')} every {self.dt:g} s"


def _deviations(experiments: Sequence[IOData]) -> tuple[float, ...]:
    """Standard deviation of the known samples of each output, every experiment from its own mean."""
    squares, counts = np.zeros((2, experiments[0].ny))
    for e in experiments:
        for i, channel in enumerate(e.y.T):
            samples = channel[np.isfinite(channel)]
            counts[i] += len(samples)
            # an output may be missing throughout an experiment, of which no mean exists
            if len(samples):
                squares[i] += np.sum((samples - samples.mean()) ** 2)
    return tuple(np.sqrt(squares / np.maximum(counts, 1)).tolist())


def _mean_offset(offsets: Sequence[FloatArray | None], lengths: Sequence[int]) -> tuple[float, ...] | None:
    """Mean operating point, weighted by the lengths of the experiments; None if one has none."""
    subtracted = [offset for offset in offsets if offset is not None]
    if len(subtracted) < len(offsets):
        return None
    # equal points pass unchanged: their mean would differ by rounding
    if all(np.array_equal(offset, subtracted[0]) for offset in subtracted):
        return tuple(subtracted[0].tolist())
    return tuple(np.average(subtracted, axis=0, weights=lengths).tolist())
