"""A trial: one request to an estimator, identified by names, so that any process can repeat it."""

from dataclasses import dataclass

from scenarios.estimators.seeds import seed_of

ASKS = ("fit", "underfit", "select")

TWIN = "twin-"
"""Beginning of the names of the arm's problems, whose records come from the physics."""


@dataclass(frozen=True, order=True)
class Trial:
    """A record of a problem given to an estimator once.

    Attributes:
        problem: Name of the problem.
        draw: Number of the record, from 0.
        ask: One of `ASKS`; see `Problem.task`.
    """

    problem: str
    draw: int
    ask: str = "fit"

    @property
    def key(self) -> str:
        """Text that identifies the trial."""
        return f"{self.problem}#{self.draw}/{self.ask}"

    def seed(self, run_seed: int) -> int:
        """Seed of the record, from the seed of the run, the problem and the draw: the same for all estimators."""
        return seed_of(f"{run_seed}|{self.problem}|{self.draw}")
