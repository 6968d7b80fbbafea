"""Whether another candidate simulates the record far better than the one with the best one-step criterion.

One step ahead, smooth and oversampled outputs follow from their own past: a criterion of one-step errors then chooses
the model of the noise, and the path from the input suffers. On linear systems with a sufficient model the simulated
errors of good candidates hardly differ, and the criterion decides as before.
"""

from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace

import numpy as np

from sysid.models.estimate import Estimate
from sysid.models.predict import predict
from sysid.models.state_space import StateSpace
from sysid.records.arrays import FloatArray
from sysid.records.data import IOData
from sysid.records.errors import SysidError
from sysid.selection.structure_search import ORDERS, Candidate, Experiments, StructureSearch, rising_orders

LADDER = 4  # largest order of output-error models that are tried beside those of the search
FITTED = 0.6  # part of the longest record on which candidates are estimated anew; they are simulated on the rest
FEWEST = 100  # samples of either part
BETTER = 0.8  # mean square error in simulation, relative to that of the chosen one, that counts as far better
ALIKE = 1.04  # the same relative to the least, up to which fewer parameters are preferred
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
    estimated: Callable[[Experiments, Candidate], Estimate],
) -> SimulationRanking | None:
    """Best candidate in simulation, if it is far better than the chosen one; None if not.

    Args:
        search: Candidates with one output.
        chosen: Stable candidate with the best criterion.
        delays: Delay of each input at which output-error models are tried too.
        estimated: Estimates a candidate from records.
    """
    record = max(search.experiments, key=len)
    if not record.complete or len(record) < 2 * FEWEST:
        return None
    degree = chosen.trend
    own_error = _error_of_fit(search, chosen, record, degree)
    better = []
    for candidate in _pool(search, chosen, delays):
        error = _error_of_fit(search, candidate, record, degree)
        if error < BETTER * own_error:
            better.append((error, candidate))
    if not better:
        return None
    better.sort(key=lambda pair: pair[0])
    end = round(FITTED * len(record))
    begin = max(2 * end - len(record), 0)
    to_fit, to_simulate = record[:end], replace(record[begin:], window=end - begin)
    errors = {}
    for candidate in (chosen, *(candidate for _, candidate in better[:JUDGED])):
        errors[id(candidate)] = np.inf
        with suppress(SysidError):
            model = estimated((to_fit,), candidate).model.input_path()
            errors[id(candidate)] = _simulation_error(model, to_simulate, degree)
    judged = [candidate for _, candidate in better[:JUDGED]]
    least = min(errors[id(candidate)] for candidate in judged)
    if not least < BETTER * errors[id(chosen)]:
        return None
    alike = [candidate for candidate in judged if errors[id(candidate)] <= ALIKE * least]
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
    return [candidate for candidate in unique.values() if candidate is not chosen and candidate.eligible]


def _error_of_fit(search: StructureSearch, candidate: Candidate, record: IOData, degree: int) -> float:
    """Mean square error of a candidate in simulation of a record of the search; infinite for unstable ones."""
    model = search.input_path_of(candidate)
    return np.inf if model is None else _simulation_error(model.input_path(), record, degree)


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
