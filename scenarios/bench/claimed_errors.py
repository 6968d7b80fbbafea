"""Errors of the response beside the covariance that the estimator claims of them."""

from collections.abc import Callable, Sequence

import numpy as np

from scenarios.bench.measured import Measured
from scenarios.bench.perfect_records import Statistic, bound_for
from scenarios.bench.response_statistics import free_parts, parts_of
from scenarios.files.errors import ScenarioError
from scenarios.problems.bound import response_covariance
from sysid.records.arrays import FloatArray

NOT_CLAIMED = "no verdict: the estimator claims no covariance"


def claims(m: Measured) -> bool:
    """Whether a covariance of the response is claimed, without NaN: that of a fit at a bound may be unknown."""
    return m.response_covariance is not None and not bool(np.isnan(m.response_covariance).any())


def claimed_records(good: Sequence[Measured], name: str, structure: str | None, statistic: Statistic) -> FloatArray:
    """A statistic of each record by its claimed covariance (n,), of those that claim one.

    Args:
        good: Records of the problem that have a model.
        name: Of the problem.
        structure: Of the contestant.
        statistic: Which.
    """
    values = by_claim(good, name, structure, statistic)
    return np.array([float(value[0]) for value in values])


def by_claim(
    good: Sequence[Measured], name: str, structure: str | None, statistic: Callable[..., FloatArray]
) -> list[FloatArray]:
    """What a function of errors, claimed covariance and free parts gives for each record."""
    bound = bound_for(name, structure)
    if bound is None:
        return []
    free = free_parts(response_covariance(bound))
    out = []
    for m in good:
        if m.response is None or m.response_covariance is None or not claims(m):
            continue
        if m.response_covariance.shape != (*bound.response.shape, 2, 2):
            raise ScenarioError(
                f"{m.trial.key}: covariance of the response {m.response_covariance.shape} given, "
                f"expected {(*bound.response.shape, 2, 2)}"
            )
        out.append(statistic(parts_of(m.response - bound.response)[None], m.response_covariance, free))
    return out
