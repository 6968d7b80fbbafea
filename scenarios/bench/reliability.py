"""Reliability: how often an estimator gives no stable model at all, and why."""

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass

from scenarios.bench.interval_of_mean import exact_interval_of_share
from scenarios.bench.measured import Measured
from scenarios.bench.metric import Figure, FigureMaker, Part, trials_of
from scenarios.bench.theory import UNSTABLE_MODELS
from scenarios.estimators.contestant import Contestant
from scenarios.estimators.outcome import KINDS, MODEL, REFUSED
from scenarios.problems.trial import Trial

FAILURES = tuple(kind for kind in KINDS if kind not in (MODEL, REFUSED))
UNSTABLE = "unstable"
SOME_REFUSED = "it says that it does not do this, but does it on other records of the problem"
REASONS = 20
"""Reasons told at most."""


@dataclass(frozen=True)
class Reliability:
    """Share of failures among all requests that were not refused.

    A single one fails: a perfect estimator has none, so that chance raises no false alarm. What an estimator does not
    do it does not do on any record: refusing some of those of a problem and answering others is a failure too, or
    else it could choose what it is judged by. Methods without any guarantee of stability may give unstable models, as
    theory says, where most requests still end with a model.

    Attributes:
        others: The figures whose trials are counted.
    """

    others: tuple[FigureMaker, ...] = ()
    name: str = "reliability"
    title: str = "Failures"

    def trials(self, effort: str) -> tuple[Trial, ...]:
        """Those of all other figures, each once."""
        return trials_of(self.others, effort)

    def verdicts(self) -> int:
        """None that chance can turn."""
        return 0

    def figure(
        self, measured: Sequence[Measured], contestant: Contestant, false_alarm: float, referee: Sequence[Measured]
    ) -> Figure:
        """Count the failures, by kind."""
        del false_alarm, referee
        answered = {(m.trial.problem, m.trial.ask) for m in measured if m.kind != REFUSED}
        counted = [m for m in measured if (m.trial.problem, m.trial.ask) in answered]
        kinds = Counter(m.kind for m in counted)
        failed = [m for m in counted if m.kind != MODEL]
        total = len(counted)
        refused = len(measured) - total
        unguarded = UNSTABLE_MODELS.get(contestant.method or "", "")
        expected = unguarded and 2 * kinds[MODEL] >= total
        surprising = len(failed) - (kinds[UNSTABLE] if expected else 0)
        parts = tuple(
            Part(
                label=kind,
                value=_percent(kinds[kind], total),
                expected=0.0,
                interval=interval_of_share(kinds[kind], total),
                limits=(0.0, 0.0),
                passed=kinds[kind] == 0 if total else None,
                theory=not (expected and kind == UNSTABLE),
                why=SOME_REFUSED if kind == REFUSED else KINDS.get(kind, ""),
                draws=total,
            )
            for kind in (*FAILURES, *[REFUSED] * (kinds[REFUSED] > 0))
        )
        told = f"{len(failed)} of {total} requests failed" if total else "no request was answered"
        reasons = Counter(f"{m.kind}: {m.why}" if m.why else m.kind for m in failed)
        return Figure(
            name=self.name,
            title=self.title,
            unit="%",
            value=_percent(len(failed), total),
            expected=0.0,
            interval=interval_of_share(len(failed), total),
            passed=not surprising if total else None,
            false_alarm=0.0,
            why="; ".join(
                (
                    told,
                    *[f"{refused} more were refused, which is no failure"] * (refused > 0),
                    *[unguarded] * bool(expected and kinds[UNSTABLE]),
                )
            ),
            parts=parts,
            curves={
                "reasons": dict(reasons.most_common(REASONS)),
                "problems": dict(Counter(m.trial.problem for m in failed).most_common()),
                "refused": refused,
            },
        )


def interval_of_share(found: int, total: int) -> tuple[float, float]:
    """The exact 95 % interval of a share, in percent; NaN of nothing."""
    low, high = exact_interval_of_share(found, total)
    return (100.0 * low, 100.0 * high)


def _percent(found: int, total: int) -> float:
    return 100.0 * found / total if total else float("nan")
