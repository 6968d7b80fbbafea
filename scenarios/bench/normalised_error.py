"""Normalised error: what an estimator errs by, in units of what it says it errs by."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from scipy.stats import chi2, ks_2samp, kstest

from scenarios.bench.accuracy_records import NO_RECORD, QUICK, accuracy_trials, by_problem, enough
from scenarios.bench.claimed_errors import NOT_CLAIMED, claimed_records
from scenarios.bench.measured import Measured
from scenarios.bench.metric import Figure
from scenarios.bench.part_of_mean import Judgement, Values, parts_of_means
from scenarios.bench.perfect_records import SINGLES, single_records
from scenarios.bench.response_statistics import normalised
from scenarios.bench.theory_of_claims import ClaimsTheory
from scenarios.bench.worst_part import figure_of_parts, unjudged
from scenarios.estimators.contestant import Contestant
from scenarios.problems.trial import Trial
from sysid.records.arrays import FloatArray

JUDGED = Judgement(expected=1.0, ratio=1.05)


@dataclass(frozen=True)
class NormalisedError:
    """Mean of error' covariance^-1 error over its degrees of freedom, by the claimed covariance.

    Of the parameters it is chi-square with as many degrees of freedom as there are parameters [Ljung1999, ch. 9].
    Where the parameters are not those of the truth's structure it is that of the response, two degrees of freedom per
    frequency, averaged: frequencies depend on each other as those of the Cramér-Rao bound do.
    """

    name: str = "normalised_error"
    title: str = "Normalised error against chi-square"

    def trials(self, effort: str) -> tuple[Trial, ...]:
        """The records of accuracy."""
        return accuracy_trials(effort)

    def verdicts(self) -> int:
        """One of each problem of the quick effort and one of all; with more problems each gets less."""
        return len(QUICK) + 1

    def figure(
        self, measured: Sequence[Measured], contestant: Contestant, false_alarm: float, referee: Sequence[Measured]
    ) -> Figure:
        """Judge the mean; tell how well the whole distribution fits."""
        del referee
        given: list[Values] = []
        curves: dict[str, dict[str, object]] = {}
        for name, (good, run) in by_problem(measured).items():
            values, single, freedom = _of_problem(good, name, contestant.structure)
            theory = ClaimsTheory(contestant, name, good).expectation(self.name)
            given.append(Values(name, values, run, single, theory, NOT_CLAIMED, len(good)))
            if enough(len(values), run) and np.isfinite(values).all():
                curves[name] = {
                    "of": "parameters" if freedom else "response",
                    "degrees_of_freedom": freedom or None,
                    "records": np.sort(values).tolist(),
                    "kolmogorov_smirnov_p": _distribution_p(values, freedom, single),
                }
        budget = false_alarm * self.verdicts()
        return figure_of_parts(
            self.name,
            self.title,
            "error' covariance^-1 error / degrees of freedom",
            parts_of_means(given, JUDGED, budget) or [unjudged("all", NO_RECORD)],
            budget,
            "mean of the squared error in claimed standard deviations, within what chance allows a perfect estimator "
            "and 5 % of it; the whole distribution is told, not judged",
            curves,
        )


def _of_problem(
    good: Sequence[Measured], name: str, structure: str | None
) -> tuple[FloatArray, FloatArray | None, int]:
    """Values of the records, those of perfect ones, and the degrees of freedom; 0 where they are of the response."""
    known = [m for m in good if m.parameters > 0 and not np.isnan(m.normalised_error)]
    if enough(len(known), len(good)) and len({m.parameters for m in known}) == 1:
        p = known[0].parameters
        return np.array([m.normalised_error / p for m in known]), chi_square(p), p
    return (
        claimed_records(good, name, structure, normalised),
        single_records(name, structure, normalised, 1.0),
        0,
    )


@lru_cache(maxsize=64)
def chi_square(freedom: int) -> FloatArray:
    """Chi-square over its degrees of freedom at evenly spaced probabilities, all but free of chance (M,)."""
    values = chi2.ppf((np.arange(SINGLES) + 0.5) / SINGLES, freedom) / freedom
    return np.asarray(values + 1.0 - np.mean(values))


def _distribution_p(values: FloatArray, freedom: int, single: FloatArray | None) -> float | None:
    if freedom:
        return float(kstest(values * freedom, chi2(freedom).cdf).pvalue)
    return None if single is None else float(ks_2samp(values, single).pvalue)
