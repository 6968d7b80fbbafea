"""What a worker of a cluster does: pieces of a run, from plain types to plain types."""

import tempfile
from collections.abc import Mapping, Sequence
from contextlib import ExitStack
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

from scenarios.bench.prepared_records import simulate_records
from scenarios.bench.run_trials import Runner
from scenarios.bench.source import own_files, source_hash
from scenarios.bench.work import Bench, Piece
from scenarios.datasets.cluster_task import STRANGE
from scenarios.estimators.contestant import Contestant, Limits
from scenarios.files.errors import ScenarioError
from scenarios.jobs.bitwise_compatibility import kinship, strangeness
from scenarios.problems.trial import Trial

DONE = "done"
"""Key of an answer with what was measured: number of the contestant, a line of `Measurement`, time."""


@dataclass(frozen=True)
class Parcel:
    """A contestant on its way to a worker.

    Attributes:
        contestant: Its fields.
        source: Hash of its files where it comes from; see `source_hash`.
        files: Text of its files, where they lie in a folder of the user's own, by their names in it; none where the
            worker has to have them.
    """

    contestant: Mapping[str, Any]
    source: str
    files: Mapping[str, str]

    @staticmethod
    def of(contestant: Contestant) -> "Parcel":
        """Pack a contestant.

        A module that lies in the estimator's own folder travels as text, with those of that folder which it imports;
        other packages, and programs, have to be on the workers, under the same names and paths.
        """
        own = {name: text.decode("utf-8", "surrogateescape") for name, text in own_files(contestant).items()}
        return Parcel(asdict(contestant), source_hash(contestant), own)

    def unpacked(self, folder: Path) -> Contestant:
        """The contestant as this process can ask it.

        Args:
            folder: For its module.

        Raises:
            ScenarioError: It is not the same here.
        """
        contestant = Contestant(**self.contestant)
        if self.files:
            for name, text in self.files.items():
                path = folder / name
                path.parent.mkdir(parents=True, exist_ok=True)
                path.write_bytes(text.encode("utf-8", "surrogateescape"))
            contestant = replace(contestant, home=str(folder))
        found = source_hash(contestant)
        if found != self.source:
            raise ScenarioError(
                f"{contestant.name!r}: {contestant.target!r} {'is another file' if found else 'is not'} here; expected "
                "what it imports, and programs, under the same paths on every worker"
            )
        return contestant


def task(
    parcels: Sequence[Mapping[str, Any]],
    limits: Mapping[str, Any],
    seed: int,
    pieces: Sequence[tuple[str, int, Sequence[tuple[str, int]]]],
    expected: Mapping[str, str],
) -> dict[str, Any]:
    """Do pieces; called by a Dask worker.

    Args:
        parcels: Contestants.
        limits: Of each answer.
        seed: Of the run.
        pieces: Problem, draw and what is asked of whom.
        expected: What makes the bits of the process that asks; see `kinship`.

    Returns:
        Plain types: what was measured, or in what this worker differs.
    """
    from distributed import get_worker

    address = get_worker().address
    if differences := strangeness(expected, kinship()):
        return {STRANGE: differences, "worker": address}
    with ExitStack() as stack:
        folder = Path(stack.enter_context(tempfile.TemporaryDirectory(prefix="hmtb-verify-")))
        try:
            found = tuple(Parcel(**one).unpacked(folder / str(number)) for number, one in enumerate(parcels))
        except ScenarioError as error:
            return {STRANGE: (str(error),), "worker": address}
        wanted = [Piece(name, draw, tuple((ask, number) for ask, number in asked)) for name, draw, asked in pieces]
        simulate_records([Trial(one.problem, one.draw) for one in wanted], seed, None, threads=1)
        runner = stack.enter_context(Runner(Bench(found, Limits(**limits), seed)))
        done = [one for piece in wanted for one in runner.run(piece)]
        return {DONE: [(one.contestant, one.measured.to_json(), one.wall) for one in done]}
