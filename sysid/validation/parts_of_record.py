"""Is the gain the same in all parts of a record? If not, how uncertain is that of the whole?

A nonlinearity that meets another power in every part, or a plant that changes, moves the gain slowly and at all
frequencies alike. Neither the scatter from line to line nor correlations over tenths of a second show it.
"""

import itertools
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import scipy

from sysid.models.estimate import Estimate
from sysid.records.arrays import FloatArray
from sysid.records.data import IOData
from sysid.validation.homogeneity import homogeneity

PARTS = 8  # of all records together
SIGNIFICANT = 0.01  # p-value below which parts differ


@dataclass(frozen=True)
class PartsOfRecord:
    """Gains of the parts of records, compared.

    Attributes:
        p_value: Of the hypothesis that all parts have one response; NaN where they are too short to tell.
        count: Number of parts.
        half_widths: Half the length of the 95 % interval of each path's gain over the gain, from the scatter between
            the parts (ny, nu); 0 where they do not differ.
    """

    p_value: float
    count: int
    half_widths: FloatArray

    @property
    def differ(self) -> bool:
        """Whether the parts have different gains."""
        return self.p_value < SIGNIFICANT


def compare_parts(estimate: Estimate, experiments: Sequence[IOData]) -> PartsOfRecord:
    """Compare the gains of the parts of records.

    The gain of all is the mean of those of the parts, weighted by their information; its variance follows from their
    scatter about it [Birge1932].

    Args:
        estimate: A stable model of the records.
        experiments: The records.
    """
    parts = []
    total = sum(len(experiment) for experiment in experiments)
    for number, experiment in enumerate(experiments):
        count = max(1, round(PARTS * len(experiment) / total))
        ends = [len(experiment) * k // count for k in range(count + 1)]
        for k, (first, end) in enumerate(itertools.pairwise(ends)):
            if np.isfinite(experiment.y[first:end]).any(axis=0).all():
                name = f"part {k + 1} of record {number + 1}"
                parts.append(replace(experiment[first:end], name=name))
    if len(parts) < 2:
        # all outputs are missing elsewhere
        return PartsOfRecord(float("nan"), len(parts), np.zeros((estimate.model.ny, estimate.model.nu)))
    agreement = homogeneity(estimate, parts)
    half_widths = np.zeros((estimate.model.ny, estimate.model.nu))
    if agreement.p_value < SIGNIFICANT:
        for path in np.ndindex(half_widths.shape):
            half_widths[path] = _half_width(agreement.gain_ratios[:, *path], agreement.gain_deviations[:, *path])
    return PartsOfRecord(agreement.p_value, len(parts), half_widths)


def _half_width(ratios: FloatArray, deviations: FloatArray) -> float:
    """Half the length of the 95 % interval of a gain over the gain, from those of parts over a common one (K,)."""
    known = np.isfinite(ratios) & np.isfinite(deviations) & (deviations > 0.0)
    freedom = int(known.sum()) - 1
    if freedom < 1:
        return 0.0
    weights = deviations[known] ** -2.0
    mean = float(weights @ ratios[known] / weights.sum())
    squares = float(weights @ (ratios[known] - mean) ** 2)
    variance = squares / freedom / weights.sum()
    return float(scipy.stats.t.ppf(0.975, freedom) * np.sqrt(variance) / max(abs(mean), np.finfo(float).tiny))
