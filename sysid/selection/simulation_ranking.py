"""Whether another candidate simulates the record far better than the one with the best one-step criterion.

One step ahead, smooth and oversampled outputs follow from their own past: a criterion of one-step errors then chooses
the model of the noise, and the path from the input suffers. On linear systems with a sufficient model the simulated
errors of good candidates hardly differ, and the criterion decides as before.

Beside a nonlinearity the criterion buys orders that describe it one step ahead, the more the longer the record is. No
linear model is the right one there; of those that simulate as well the one with the fewest parameters is chosen.
"""

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, replace

import numpy as np

from sysid.models.predict import predict
from sysid.models.state_space import StateSpace
from sysid.records.arrays import FloatArray
from sysid.records.data import IOData
from sysid.records.errors import SysidError
from sysid.selection.structure_search import ORDERS, Candidate, StructureSearch, rising_orders

LADDER = 4  # largest order of output-error models that are tried beside those of the search
FITTED = 0.6  # part of the longest record on which candidates are estimated anew; they are simulated on the rest
FEWEST = 100  # samples of either part
BETTER = 0.8  # mean square error in simulation, relative to that of the chosen one, that counts as far better
ALIKE = 1.04  # the same relative to the least, up to which fewer parameters are preferred
NEARLY = 1.1  # the same beside a nonlinearity, where linear models of other amplitudes differ by far more
JUDGED = 4  # candidates that are estimated anew


@dataclass(frozen=True)
class SimulationRanking:
    """A candidate that simulates better than the one with the best criterion.

    Attributes:
        candidate: That candidate.
        ratio: Its root mean square error in simulation of a part that neither was fitted to, relative to the other's.
    """

    candidate: Candidate
    ratio: float


def better_in_simulation(
    search: StructureSearch,
    chosen: Candidate,
    delays: Sequence[int],
    *,
    is_nonlinear: bool,
) -> SimulationRanking | None:
    """Best candidate in simulation, if it is far better than the chosen one; None if not.

    Beside a nonlinearity the one with the fewest parameters that is nearly as good.

    Args:
        search: Candidates with one output.
        chosen: Stable candidate with the best criterion.
        delays: Delay of each input at which output-error models are tried too.
        is_nonlinear: Whether the output depends nonlinearly on the input.
    """
    record = max(search.experiments, key=len)
    if not record.complete or len(record) < 2 * FEWEST:
        return None
    own_error = _error_of_fit(search, chosen, record)
    far_better, smaller = [], []
    for candidate in _pool(search, chosen, delays):
        error = _error_of_fit(search, candidate, record)
        if error < BETTER * own_error:
            far_better.append((error, candidate))
        elif error < NEARLY * own_error and candidate.parameters < chosen.parameters:
            smaller.append((candidate.parameters, candidate))
    ranking = _judged(search, far_better, BETTER, chosen, record)
    if ranking is None and is_nonlinear:
        ranking = _judged(search, smaller, NEARLY, chosen, record)
    return ranking


def _judged(
    search: StructureSearch,
    ordered: Sequence[tuple[float, Candidate]],
    enough: float,
    chosen: Candidate,
    record: IOData,
) -> SimulationRanking | None:
    """Smallest of the first candidates that simulate the rest of the record well enough; None if none does.

    Args:
        search: What fitted them.
        ordered: Candidates behind what puts them in order.
        enough: Mean square error relative to that of the chosen one.
        chosen: Candidate with the best criterion.
        record: The record, of which all are estimated on the first part.
    """
    candidates = [candidate for _, candidate in sorted(ordered, key=lambda pair: pair[0])[:JUDGED]]
    if not candidates:
        return None
    end = round(FITTED * len(record))
    begin = max(2 * end - len(record), 0)
    to_fit, to_simulate = record[:end], replace(record[begin:], window=end - begin)
    errors = {}
    for candidate in (chosen, *candidates):
        errors[id(candidate)] = np.inf
        with suppress(SysidError):
            path = search.input_path_on((to_fit,), candidate)
            if path is not None:
                errors[id(candidate)] = _simulation_error(path, to_simulate, chosen.trend)
    least = min(errors[id(candidate)] for candidate in candidates)
    if not least < enough * errors[id(chosen)]:
        return None
    alike = [candidate for candidate in candidates if errors[id(candidate)] <= ALIKE * least]
    best = min(alike, key=lambda candidate: candidate.parameters)
    return SimulationRanking(best, float(np.sqrt(errors[id(best)] / errors[id(chosen)])))


def _pool(search: StructureSearch, chosen: Candidate, delays: Sequence[int]) -> list[Candidate]:
    """The best candidate of each method, and output-error models of low order."""
    pool = []
    for method in ORDERS:
        of_method = [candidate for candidate in search.candidates if candidate.method == method]
        pool += sorted(of_method, key=search.criterion)[:2]
    if "oe" in search.methods:
        for nk in dict.fromkeys((tuple(delays), tuple(min(delay, 1) for delay in delays))):
            for n in range(1, LADDER + 1):
                candidate = search.try_orders(rising_orders("oe", n, nk, chosen.trend))
                if candidate is not None:
                    pool.append(candidate)
    unique = {id(candidate): candidate for candidate in pool}
    # a slow mode follows what a linear model lacks as well as it follows a disturbance: that needs the criterion
    kept = [candidate for candidate in unique.values() if candidate.eligible and not np.isfinite(candidate.drive)]
    return [candidate for candidate in kept if candidate is not chosen]


def _error_of_fit(search: StructureSearch, candidate: Candidate, record: IOData) -> float:
    """Mean square error of a candidate in simulation of a record of the search; infinite for unstable ones."""
    model = search.input_path_of(candidate)
    return np.inf if model is None else _simulation_error(model.input_path(), record, candidate.trend)


def _simulation_error(model: StateSpace, record: IOData, degree: int) -> float:
    """Mean square error of a simulation behind the window, without a trend of a degree, -1 for none."""
    if not model.is_stable():
        return np.inf
    errors = (record.y - predict(model, record, steps=None))[record.window :, 0]
    return float(np.mean(_without_trend(errors, degree) ** 2))


def _without_trend(errors: FloatArray, degree: int) -> FloatArray:
    """Errors (N,) without the polynomial in time that fits them best."""
    if degree < 0:
        return errors
    basis = np.vander(np.linspace(-1.0, 1.0, len(errors)), degree + 1)
    return np.asarray(errors - basis @ np.linalg.lstsq(basis, errors)[0])
