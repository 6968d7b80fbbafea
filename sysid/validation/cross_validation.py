"""Cross-validation: every part of the data compared with a model of the other parts."""

import warnings
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import pairwise, product

import numpy as np

from sysid.models.estimate import Estimate
from sysid.records.arguments import whole_number
from sysid.records.arrays import FloatArray, Locked
from sysid.records.data import IOData, as_experiments
from sysid.records.errors import SysidWarning
from sysid.records.printing import Part, Table
from sysid.validation.compare import ModelFit, compare

SAME = 1e-6  # samples that differ by less than this part of their range are the same, written with few digits


@dataclass(frozen=True, eq=False, repr=False)
class CrossValidation(Locked):
    """Fits to the parts that were left out.

    Attributes:
        fits: One record per part.
        estimates: Estimate from the other parts, per part.
        simulation: Mean fit in percent of the simulated output, per output (ny,).
        one_step: Mean fit in percent of the one-step prediction, per output (ny,).
        simulation_deviation: Standard deviation of the fits over the parts (ny,).
        one_step_deviation: Likewise, one step ahead.
    """

    fits: tuple[ModelFit, ...]
    estimates: tuple[Estimate, ...]
    simulation: FloatArray
    one_step: FloatArray
    simulation_deviation: FloatArray
    one_step_deviation: FloatArray

    def _parts(self) -> list[Part]:
        names = self.fits[0].output_names if len(self.simulation) > 1 else ("",)
        columns: list[tuple[str, list[str]]] = [("left out", [*(fit.name for fit in self.fits), "mean ± deviation"])]
        for k, name in enumerate(names):
            simulation = [fit.simulation[k] for fit in self.fits]
            one_step = [fit.one_step[k] for fit in self.fits]
            columns += [
                _column(f"{name} in simulation", simulation, self.simulation[k], self.simulation_deviation[k]),
                _column(f"{name} one step ahead", one_step, self.one_step[k], self.one_step_deviation[k]),
            ]
        return [f"Fits to {len(self.fits)} parts that were left out", Table(columns)]


def _column(head: str, fits: list[float], mean: float, deviation: float) -> tuple[str, list[str]]:
    """Column of the table: the fits, then their mean and deviation."""
    cells = [f"{fit:.2f} %" for fit in fits]
    return head.strip(), [*cells, f"{mean:.2f} ± {deviation:.2f} %"]


def cross_validate(
    estimator: Callable[[tuple[IOData, ...]], Estimate], data: IOData | Sequence[IOData], *, folds: int = 5
) -> CrossValidation:
    """Leave out every part once, fit to the others, compare with the part left out [Ljung1999, sec. 16.4].

    `cross_validate(lambda parts: sysid.oe(parts, 2, 2), data)`

    Several experiments are the parts; a single one is cut into consecutive parts, which are separate experiments in the
    fit, so that no regressor crosses the gap.

    Args:
        estimator: From experiments to an estimate.
        data: One experiment, or several.
        folds: Number of parts of a single experiment.

    Returns:
        Fits in simulation and one step ahead, their mean and standard deviation.

    Raises:
        SysidError: Fewer than two parts, or parts too short for the estimator.
    """
    experiments = as_experiments(data, series=True)
    if len(experiments) == 1:
        folds = whole_number("folds", folds, 2, len(experiments[0]))
        (record,) = experiments
        edges = np.linspace(record.window, len(record), folds + 1).astype(int)
        # the window stays with the part that it initialises
        edges[0] = 0
        experiments = tuple(record[int(begin) : int(end)] for begin, end in pairwise(edges))
    fits: list[ModelFit] = []
    estimates: list[Estimate] = []
    for k, left_out in enumerate(experiments):
        with warnings.catch_warnings():
            # a part excites less than the whole record, whose own fit gives the relevant warnings
            warnings.simplefilter("ignore", SysidWarning)
            estimate = estimator(experiments[:k] + experiments[k + 1 :])
            fits += compare({f"part {k + 1}": estimate}, left_out)
        estimates.append(estimate)
    simulation = np.array([fit.simulation for fit in fits])
    one_step = np.array([fit.one_step for fit in fits])
    return CrossValidation(
        fits=tuple(fits),
        estimates=tuple(estimates),
        simulation=simulation.mean(axis=0),
        one_step=one_step.mean(axis=0),
        simulation_deviation=_deviation(simulation),
        one_step_deviation=_deviation(one_step),
    )


def _deviation(fits: FloatArray) -> FloatArray:
    """Standard deviation of the fits to the parts (parts, ny), per output; infinite where one of them overflows."""
    finite = np.isfinite(fits)
    known = np.where(finite, fits, 0.0)
    # the squares of simulations by unstable models overflow before the fits do
    # a power of two rounds nothing
    scale = np.exp2(np.frexp(np.maximum(np.abs(known).max(axis=0), 1.0))[1])
    deviation = scale * (known / scale).std(axis=0, ddof=1)
    return np.where(finite.all(axis=0), deviation, np.inf)


def same_samples(records: Sequence[IOData], others: Sequence[IOData]) -> bool:
    """Whether two data sets share a record: the same samples, or those of its beginning.

    A fit to data that the model was estimated from is no validation.
    """
    return any(_same_beginning(first, second) for first, second in product(records, others))


def _same_beginning(first: IOData, second: IOData) -> bool:
    """Whether two records agree as far as the shorter one goes."""
    if (first.nu, first.ny) != (second.nu, second.ny):
        return False
    # a record that was cut at its end is still the same
    common = min(len(first), len(second))
    return _close(first.u[:common], second.u[:common]) and _close(first.y[:common], second.y[:common])


def _close(a: FloatArray, b: FloatArray) -> bool:
    """Whether signals (N, n) agree within `SAME` of their ranges, missing samples at the same places."""
    present = ~np.isnan(a)
    if not np.array_equal(present, ~np.isnan(b)):
        return False
    ranges = np.nanmax(a, axis=0, initial=-np.inf) - np.nanmin(a, axis=0, initial=np.inf)
    return bool((np.abs(a - b) <= SAME * ranges)[present].all())
