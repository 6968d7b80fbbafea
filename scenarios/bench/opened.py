"""A result of the test bench as it is opened."""

from pathlib import Path

from scenarios.bench.leaderboard_tables import metric_table
from scenarios.bench.result import Result
from scenarios.experiments.opened import Opened
from scenarios.experiments.recipe import Recipe


def open_result(path: Path) -> Opened:
    """Open a file of results."""
    result = Result.read(path)
    code = "from pathlib import Path\n\nfrom scenarios.bench.result import Result\n\n"
    return Opened(
        "result of the test bench",
        str(path),
        Recipe([("hmtb", "leaderboard", str(path))], code + f"result = Result.read(Path({str(path)!r}))"),
        [metric_table(result)],
        [f"answers: {', '.join(f'{n} {kind}' for kind, n in result.outcomes.items())}", f"again: {result.command}"],
    )
