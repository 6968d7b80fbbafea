"""Result files as rows of a leaderboard."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path

from scenarios.bench.metric import Metric, Part
from scenarios.bench.result import Result
from scenarios.files.errors import ScenarioError
from scenarios.files.printable import one_line

MOST_BYTES = 2**26
"""A result file is far smaller."""

LARGEST = 2**62
"""No whole number in a result is larger."""


@dataclass(frozen=True)
class Entry:
    """An estimator on the leaderboard.

    Attributes:
        number: Its place, from 1; figures name it by that.
        result: What came of its run.
        path: File that it was read from.
    """

    number: int
    result: Result
    path: Path

    @property
    def name(self) -> str:
        """As the page shows it."""
        return one_line(self.result.contestant.name)

    @property
    def title(self) -> str:
        """Number and name."""
        return f"{self.number} {self.name}"

    @property
    def mark(self) -> str:
        """Its anchor on the page."""
        return f"estimator-{self.number}"

    def figure(self, name: str) -> Metric | None:
        """One of its figures, or None."""
        return self.result.figures.get(name)


def read_results(paths: Iterable[Path]) -> list[tuple[Path, Result]]:
    """Read result files.

    Args:
        paths: Files; of a folder all files in it whose name ends in `.json`.

    Raises:
        ScenarioError: There is none, one is no result, or two are of the same name.
    """
    files = [file for path in paths for file in _files(path)]
    if not files:
        raise ScenarioError("no result given; expected files that hmtb verify wrote, such as results/*.json")
    found: dict[str, tuple[Path, Result]] = {}
    for path in dict.fromkeys(files):
        result = _read(path)
        name = one_line(result.contestant.name)
        if name in found:
            raise ScenarioError(
                f"{path} and {found[name][0]} are both of {name!r}; expected a name for each: leave one out, "
                "or run it again under another name"
            )
        found[name] = (path, result)
    return list(found.values())


def _files(path: Path) -> list[Path]:
    if not path.is_dir():
        return [path]
    files = sorted(path.glob("*.json"))
    if not files:
        raise ScenarioError(f"folder {path} given, expected one with results of hmtb verify in it (*.json)")
    return files


def _read(path: Path) -> Result:
    if path.exists() and not path.is_file():
        raise ScenarioError(f"{path} is no result of hmtb verify: it is no ordinary file")
    if path.is_file() and path.stat().st_size > MOST_BYTES:
        raise ScenarioError(f"{path} is no result of hmtb verify: it has more than {MOST_BYTES} bytes")
    result = Result.read(path)
    wrong = _wrong(result)
    if wrong:
        raise ScenarioError(f"{path} is no result of hmtb verify: {wrong}")
    return result


def _wrong(result: Result) -> str:
    """What is not of its kind in a file that anyone may have written; empty where all is."""
    contestant = result.contestant
    texts = {
        "name": contestant.name,
        "target": contestant.target,
        "version": contestant.version,
        "settings": contestant.settings,
        "home": contestant.home,
        "effort": result.effort,
        "command": result.command,
        "source": result.source,
        "machine": result.machine,
        "run": result.run,
    }
    for key, value in texts.items():
        if not isinstance(value, str):
            return f"{key} is {value!r}, expected a text"
    if not one_line(contestant.name):
        return f"name {contestant.name!r} has no character that can be seen"
    for key, given, wanted in (
        ("program", contestant.program, bool),
        ("stays", contestant.stays, bool),
        ("seed", result.seed, int),
        ("protocol", result.protocol, int),
        ("memory_bytes", result.limits.memory_bytes, int),
    ):
        if type(given) is not wanted or abs(given) > LARGEST:
            return f"{key} is {str(given)[:80]}, expected {wanted.__name__}"
    limit = result.limits.seconds
    if type(limit) not in (int, float) or not limit <= LARGEST:
        return f"the limit of time is {str(limit)[:80]}, expected s"
    for key, kind in (("outcomes", int), ("reasons", int), ("refused", int), ("versions", str), ("figures", Metric)):
        table = getattr(result, key)
        if not isinstance(table, Mapping) or not all(type(value) is kind for value in table.values()):
            return f"{key} is {str(table)[:80]!r}, expected {kind.__name__} by name"
    for key in ("outcomes", "reasons", "refused"):
        if not all(0 <= number <= LARGEST for number in getattr(result, key).values()):
            return f"{key} holds numbers below 0 or above {LARGEST}, expected how often"
    for name, figure in result.figures.items():
        problem = _wrong_verdict(figure) or next(filter(None, map(_wrong_verdict, figure.parts)), "")
        if problem:
            return f"figure {name}: {problem}"
        if not isinstance(figure.title, str) or not isinstance(figure.unit, str):
            return f"figure {name} has title {figure.title!r} and unit {figure.unit!r}, expected texts"
        if not 0.0 <= figure.false_alarm <= 1.0:
            return f"figure {name} has a false-alarm rate of {figure.false_alarm}, expected one from 0 to 1"
        if not isinstance(figure.curves, Mapping):
            return f"figure {name} has curves {str(figure.curves)[:80]!r}, expected them by name"
    return ""


def _wrong_verdict(made: Metric | Part) -> str:
    if made.passed not in (True, False, None) or not isinstance(made.why, str):
        return f"passed {made.passed!r} because {made.why!r}, expected true, false or null and a text"
    if isinstance(made, Part) and (type(made.draws) is not int or not 0 <= made.draws <= LARGEST):
        return f"part {made.label!r} rests on {str(made.draws)[:80]} records, expected a whole number"
    if isinstance(made, Part) and not (isinstance(made.label, str) and isinstance(made.theory, bool)):
        return f"part {made.label!r} with theory {made.theory!r}, expected a text and true or false"
    return ""
