"""What theory says of claims, held against the errors: an excuse by bias is withdrawn where there is no bias."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from scenarios.bench.efficiency import JUDGED, power_against_bound
from scenarios.bench.measured import Measured
from scenarios.bench.perfect_records import bound_for, single_records
from scenarios.bench.response_statistics import free_parts, parts_of, power
from scenarios.bench.theory import BIAS, BIAS_AND_SCATTER, Expectation, expectation, limitation
from scenarios.estimators.contestant import Contestant
from scenarios.problems.bound import response_covariance
from sysid.records.arrays import FloatArray

NEGLIGIBLE = 0.1
"""Part of the mean square error that a bias has at most which explains nothing: it would make errors in claimed
deviations a ninth larger in the square, which is within the limits. Ten records cannot tell it, a hundred can."""

EFFICIENT = 1e-3
"""Probability that the mean square error of a perfect estimator is taken for larger than the bound."""


@dataclass(frozen=True)
class ClaimsTheory:
    """Theory of an estimator's claims on one problem, with what its errors say against the theory.

    Attributes:
        contestant: The estimator.
        name: Name of the problem.
        good: Records of the problem that have a model.
    """

    contestant: Contestant
    name: str
    good: Sequence[Measured]

    def expectation(self, figure: str) -> Expectation:
        """What is expected of a figure of claims.

        A method that is said to be biased may claim too little, since its claims know nothing of the bias. Where the
        mean error is no more than `NEGLIGIBLE` of the mean square error at any frequency, it may not. Where a wrong
        model of the disturbance would spoil the claims too, the mean square error must besides be that of the bound.

        Args:
            figure: Key of the figure.
        """
        own = expectation(self.contestant, self.name, figure)
        found = limitation(self.contestant.method, self.contestant.structure, self.name)
        if own.passes or found is None or found.claims not in (BIAS, BIAS_AND_SCATTER):
            return own
        share = greatest_bias(self.good, self.name, self.contestant.structure)
        if not share <= NEGLIGIBLE or (found.claims == BIAS_AND_SCATTER and not self._efficient()):
            return own
        return Expectation(
            True,
            f"its mean error is at most {100.0 * max(share, 0.0):.2g} % of its mean square error at any frequency: "
            "there is no bias that would excuse its claims",
        )

    def _efficient(self) -> bool:
        values = power_against_bound(self.good, self.name, self.contestant.structure)
        single = single_records(self.name, self.contestant.structure, power, 1.0)
        if single is None or not len(values):
            return False
        return float(np.mean(values)) <= JUDGED.limits([single], [len(values)], EFFICIENT)[1]


def greatest_bias(good: Sequence[Measured], name: str, structure: str | None) -> float:
    """Square of the mean error of the response over the mean square error, at the frequency where it is largest.

    Free of what scatter leaves in a mean. NaN where there is no bound or less than two records.

    Args:
        good: Records of the problem that have a model.
        name: Of the problem.
        structure: Of the contestant.
    """
    bound = bound_for(name, structure)
    responses = [m.response for m in good if m.response is not None]
    if bound is None or len(responses) < 2:
        return float("nan")
    free = free_parts(response_covariance(bound)).any(axis=-1)
    errors = parts_of(np.stack(responses) - bound.response)[:, free]
    squares: FloatArray = np.mean(np.sum(errors**2, axis=-1), axis=0)
    of_mean = np.sum(np.mean(errors, axis=0) ** 2, axis=-1)
    scatter = (squares - of_mean) / (len(errors) - 1)
    with np.errstate(invalid="ignore", divide="ignore"):
        return float(np.max((of_mean - scatter) / squares))
