"""The spec of a data set: an immutable description, read from a TOML file."""

import datetime
import re
from collections import Counter
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cache
from importlib.resources import files
from pathlib import Path
from unicodedata import category

from scenarios.datasets.spec_tables import BaselineSpec, RecordBlock, Scoring, TruthSpec, Twins, check_ranges
from scenarios.datasets.tables import read_text
from scenarios.experiments.scenario import NAME
from scenarios.experiments.waveform import check_seed
from scenarios.files import codec
from scenarios.files.errors import ScenarioError, unknown
from scenarios.files.toml_file import read_toml


@dataclass(frozen=True)
class DataSetSpec:
    """Everything that a data set is built from.

    Attributes:
        name: Name without the version, e.g. ``"hmtb-siso"``.
        version: Version; whatever changes the numbers takes a new one.
        title: One line for readers.
        seed: Every random draw of the data set follows from it.
        records: The blocks of records.
        description: Purpose, a paragraph.
        window: Samples at the start of every scored record in which the outputs are given, to find an initial state.
        scoring: The primary score.
        truth: The truth that is published.
        baselines: The models it is published with.
        channels: "all" that the bus recorded and the simulation knows, or only those of the "studied" joints.
        twins: Randomised twins, on each of which every block runs; none: the variants themselves.
        creators: Authors to cite.
        keywords: Keywords for catalogues.
        date: Day of release, YYYY-MM-DD; empty for none: a build reads no clock, so that its bytes are reproducible.
        url: Page of the data set on the web; empty for none.
        withheld: Whether this is the spec of a public folder whose truth is withheld; its seed is then 0, which is not
            that of the data.
    """

    name: str
    version: int
    title: str
    seed: int
    records: tuple[RecordBlock, ...]
    description: str = ""
    window: int = 100
    channels: str = "all"
    scoring: Scoring = Scoring()  # noqa: RUF009
    truth: TruthSpec = TruthSpec()  # noqa: RUF009
    baselines: BaselineSpec = BaselineSpec()  # noqa: RUF009
    twins: Twins | None = None
    creators: tuple[str, ...] = ("The HMTB twin contributors",)
    keywords: tuple[str, ...] = ("system identification", "robotics", "hydraulics", "benchmark", "MuJoCo")
    date: str = ""
    url: str = ""
    withheld: bool = False

    def __post_init__(self) -> None:
        check_seed(self.seed)
        for problem in self._problems():
            raise ScenarioError(f"data set {self.name!r}: {problem}")
        check_ranges(f"data set {self.name!r}", self, {"version": (1, 10**6), "window": (0, 10**9)})

    def _problems(self) -> Iterator[str]:
        yield from self._description_problems()
        yield from self._record_problems()

    def _description_problems(self) -> Iterator[str]:
        """Yield what is wrong in the texts about the data set, which go into catalogues, folders and citations."""
        if not NAME.fullmatch(self.name):
            yield (
                "expected 1 to 100 letters, digits, '.', '_', '-' or '+' as a name, the first a letter or digit, "
                "because folders are named after it"
            )
        if not self.title.strip():
            yield "expected a title, given none"
        lines_of_key = {"title": (self.title,), "description": self.description.split("\n")}
        lines_of_key |= {"creators": self.creators, "keywords": self.keywords}
        for key, lines in lines_of_key.items():
            for line in filter(_has_control_character, lines):
                yield f"{key} = {ascii(line)[:80]} given, expected no control characters"
        if self.channels not in ("all", "studied"):
            yield unknown("channels", self.channels, ("all", "studied"))
        if self.date and not _is_day(self.date):
            yield f"date = {self.date!r} given, expected a day as YYYY-MM-DD"
        if self.url and not re.fullmatch(r"https?://[^\s<>\"]+", self.url):
            yield f"url = {self.url!r} given, expected one of http:// or https://"
        if not self.creators or not all(name.strip() for name in self.creators):
            yield f"creators = {self.creators} given, expected names to cite"

    def _record_problems(self) -> Iterator[str]:
        """Yield what is wrong with the blocks of records taken together."""
        names = Counter(block.name for block in self.records)
        repeated = sorted(name for name, count in names.items() if count > 1)
        if repeated:
            yield f"records {', '.join(repeated)} given twice, expected each name once"
        for name in self.truth.best_linear:
            if name not in names:
                yield f"truth.best_linear: {unknown('block', name, names)}"
        parts_with_records = {block.part for block in self.records}
        absent = [part for part in ("train", "test") if part not in parts_with_records]
        if absent:
            yield f"no records for {' and '.join(absent)}; expected blocks [[records]] for train and test"

    @property
    def label(self) -> str:
        """Name with version, e.g. ``"hmtb-siso-v1"``: the name of the folder."""
        return f"{self.name}-v{self.version}"

    def to_toml(self) -> str:
        """Write every field as TOML, such that `from_toml` gives an equal spec back."""
        return codec.to_toml(codec.unstructure(self) | {"records": [block.to_table() for block in self.records]})

    @classmethod
    def from_toml(cls, text: str, *, source: str = "TOML text") -> "DataSetSpec":
        """Read a spec, strictly.

        Raises:
            ScenarioError: The text is not TOML, or a key, a type, a name or a value is wrong.
        """
        table = read_toml(text, source)
        blocks = table.get("records")
        if not isinstance(blocks, list):
            blocks = []  # `codec` refuses it below
        for block in blocks:
            if isinstance(block, dict) and isinstance(block.get("excitation"), dict):
                block["excitation"] = [block["excitation"]]  # one excitation for all axes may be a plain table
        try:
            return codec.structure(cls, table)
        except ScenarioError as error:
            raise ScenarioError(f"{source}: {error}") from error


def _has_control_character(line: str) -> bool:
    """Whether a line would do harm in metadata, tables and terminals: line and paragraph separators too."""
    categories = {category(character) for character in line}
    return any(name[0] == "C" or name in ("Zl", "Zp") for name in categories)


def _is_day(date: str) -> bool:
    """Whether a text is a day as YYYY-MM-DD."""
    try:
        # Python also reads 20260102 and 2026-W01-5.
        return datetime.date.fromisoformat(date).isoformat() == date
    except ValueError:
        return False


@cache
def shipped() -> Mapping[str, DataSetSpec]:
    """Return the specs that come with the package, by label."""
    paths = sorted(files("scenarios").joinpath("data", "datasets").iterdir(), key=lambda path: path.name)
    specs: dict[str, DataSetSpec] = {}
    for path in paths:
        if path.name.endswith(".toml"):
            spec = DataSetSpec.from_toml(path.read_text(encoding="utf-8"), source=path.name)
            specs[spec.label] = spec
    return specs


def load_spec(name: str | Path) -> DataSetSpec:
    """Return the spec of a label, or of a TOML file.

    Args:
        name: A label of `shipped`, or the path of a file.

    Raises:
        ScenarioError: There is neither, or the file holds no spec.
    """
    label_or_path = str(name)
    if label_or_path in shipped():
        return shipped()[label_or_path]
    path = Path(name)
    if not path.is_file():
        if path.suffix == ".toml":
            raise ScenarioError(f"no file {label_or_path}: expected a spec, TOML; or one of {', '.join(shipped())}")
        raise ScenarioError(unknown("data set", label_or_path, shipped(), listing="hmtb dataset list"))
    return DataSetSpec.from_toml(read_text(path, "spec"), source=label_or_path)
