"""The spec of a data set: an immutable description, read from a TOML file, with its tables."""

import datetime
import re
from collections import Counter
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cache
from importlib.resources import files
from pathlib import Path
from unicodedata import category

from hmtb_twin.files.errors import TwinError
from hmtb_twin.parameters.specimen_draw import TwinDistributions
from scenarios.datasets.record_block import RecordBlock, check_ranges
from scenarios.datasets.tables import read_text
from scenarios.experiments.scenario import NAME
from scenarios.experiments.waveform import check_seed
from scenarios.files import codec
from scenarios.files.errors import ScenarioError, unknown
from scenarios.files.toml_file import read_toml
from scenarios.identification.methods import COUNTED, METHODS

TRUTH = "truth"
"""The small-signal truth in place of an identified model."""

IDENTIFIED = tuple(name for name, method in COUNTED.items() if method.returns in ("estimate", "predictor"))
"""Methods of identification that can be baselines."""

TRIVIAL = (*(name for name in IDENTIFIED if not METHODS[name].orders), TRUTH)
"""Baselines without orders: hold the last output of the window, a static gain, the truth."""

USUAL = ("hold", "gain", "arx:4/4", "armax:3/3/3", "iv4:2/2", "oe:2/2", "oe:3/3", "okid:2/5", "n4sid:3", "truth")
"""The models of a spec that names none."""


@dataclass(frozen=True)
class Method:
    """A method of identification with its orders.

    Attributes:
        name: One of `TRIVIAL` or `IDENTIFIED`.
        orders: Its orders, completed by their defaults.
    """

    name: str
    orders: tuple[int, ...] = ()

    def __post_init__(self) -> None:
        if self.name in TRIVIAL:
            if self.orders:
                raise ScenarioError(f"method {self.name} given orders {self.orders}, expected none")
            return
        if self.name not in IDENTIFIED:
            raise ScenarioError(unknown("method", self.name, dict.fromkeys((*TRIVIAL, *IDENTIFIED))))
        # The dataclass is frozen; the same method with its defaults written out must be equal to it.
        object.__setattr__(self, "orders", tuple(METHODS[self.name].complete(self.orders).values()))

    @classmethod
    def parsed(cls, method: str) -> "Method":
        """Read a method as specs write it, ``"oe:2/2/1"``.

        Raises:
            ScenarioError: Unknown method, or other orders than it takes.
        """
        name, colon, orders = method.partition(":")
        words = orders.split("/") if colon else []
        # `isdigit` alone lets other scripts' digits pass, and no order has five.
        if not all(word.isascii() and word.isdigit() and len(word) < 5 for word in words):
            raise ScenarioError(f"baseline {method!r}: expected a method with its orders, as in oe:2/2/1")
        return cls(name, tuple(int(word) for word in words))

    def __str__(self) -> str:
        """The method as specs write it."""
        if not self.orders:
            return self.name
        return f"{self.name}:{'/'.join(map(str, self.orders))}"


@dataclass(frozen=True)
class BaselineSpec:
    """The baselines that a data set is published with.

    Attributes:
        models: Methods with their orders, each a row of the table.
        twins: Number of randomised twins, evenly over them all, that models are identified for; 0: all.
        records: Records of each block of the training part, by arm and joints, that are used; 0: all.
    """

    models: tuple[str, ...] = USUAL
    twins: int = 10
    records: int = 0

    def __post_init__(self) -> None:
        # As methods, so that one with its defaults written out counts as the same.
        if len(set(self.methods)) < len(self.models):
            raise ScenarioError(f"baselines: models = {self.models} given, expected each once")
        check_ranges("baselines", self, {"twins": (0, 10**7), "records": (0, 10**7)})

    @property
    def methods(self) -> tuple[Method, ...]:
        """The models as methods."""
        return tuple(Method.parsed(model) for model in self.models)


@dataclass(frozen=True)
class TruthSpec:
    """The truth that is published beyond matrices and noise floors, which every data set has.

    Attributes:
        amplitudes: Amplitudes at which the linear model of every arm is tried against simulation, rad; this takes most
            of a second per arm.
        best_linear: Blocks of records for whose arm, joints and amplitude the best linear approximation is measured.
        floors: Number of records of each block of the test part, by arm and joints, all twins together, for which the
            floors of linear systems are searched. The noise of the recorder is stated for every record.
        search_steps: Steps at most of each search for the linear system of the truth's order behind such a floor; 0: to
            the end, which takes ten times as long and improves the floor by a few percent at most.
        realisations: Number of realisations of the multisine that measures a best linear approximation. The data set's
            own records of its class count; the rest is simulated.
    """

    amplitudes: tuple[float, ...] = ()
    best_linear: tuple[str, ...] = ()
    floors: int = 1
    search_steps: int = 10
    realisations: int = 8

    def __post_init__(self) -> None:
        if not all(0.0 < amplitude <= 1.0 for amplitude in self.amplitudes):
            raise ScenarioError(f"truth: amplitudes = {self.amplitudes} given, expected above 0 and up to 1 rad")
        for name in ("amplitudes", "best_linear"):
            values = getattr(self, name)
            if len(set(values)) < len(values):
                raise ScenarioError(f"truth: {name} = {values} given, expected each once")
        # Two realisations at least: the nonlinear distortion is estimated from the spread between them.
        check_ranges("truth", self, {"floors": (0, 10**6), "search_steps": (0, 10**4), "realisations": (2, 10**4)})


@dataclass(frozen=True)
class Twins:
    """Arms drawn at random; every experiment runs on each of them.

    Attributes:
        count: Number of arms.
        distributions: Distributions of their parameters about those of the variant, and of their surroundings.
    """

    count: int
    distributions: TwinDistributions = TwinDistributions()  # noqa: RUF009

    def __post_init__(self) -> None:
        check_ranges("twins", self, {"count": (1, 10**7)})

    @classmethod
    def from_table(cls, table: object) -> "Twins":
        """Build it from parsed TOML: count, and a table of kind, spread and centre for each quantity.

        Raises:
            ScenarioError: No table, an unknown key, or a value of a wrong type or out of range.
        """
        if not isinstance(table, Mapping) or "count" not in table:
            raise ScenarioError(f"twins must be a table with a count, given {table!r}")
        try:
            distributions = TwinDistributions.from_table({key: table[key] for key in table if key != "count"})
        except TwinError as error:
            raise ScenarioError(f"twins: {error}") from error
        return cls(codec.structure(int, table["count"], "twins.count"), distributions)


# In TOML the distributions stand beside the count, not in a table of their own.
codec.register(Twins, Twins.from_table, lambda twins: {"count": twins.count, **codec.unstructure(twins.distributions)})

METRICS = ("rmse", "nrmse", "fit")
"""Root mean square error; that over the spread of the output in percent; 100 (1 - |error| / |y - mean y|) percent."""

UNITS = {"rad": 1.0, "mrad": 1e3, "deg": 57.29577951308232}
"""Units of a root mean square error, per rad."""


@dataclass(frozen=True)
class Scoring:
    """The primary score of a data set.

    Attributes:
        metric: One of `METRICS`.
        unit: Of the root mean square error, one of `UNITS`, mrad where none is given; of the others %.
        steps: Prediction horizon, samples; 0: simulation, from inputs and the window alone.
    """

    metric: str = "rmse"
    unit: str = ""
    steps: int = 0

    def __post_init__(self) -> None:
        if self.metric not in METRICS:
            raise ScenarioError(f"scoring: {unknown('metric', self.metric, METRICS)}")
        usual_unit = "mrad" if self.metric == "rmse" else "%"
        object.__setattr__(self, "unit", self.unit or usual_unit)
        if self.metric != "rmse" and self.unit != "%":
            raise ScenarioError(f"scoring: unit = {self.unit!r} given for {self.metric}, which is in %")
        if self.metric == "rmse" and self.unit not in UNITS:
            raise ScenarioError(f"scoring: {unknown('unit', self.unit, UNITS)}")
        check_ranges("scoring", self, {"steps": (0, 10**6)})


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
    scoring: Scoring = Scoring()
    truth: TruthSpec = TruthSpec()
    baselines: BaselineSpec = BaselineSpec()
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

    @property
    def machines(self) -> tuple[str, ...]:
        """Arms of other machines than the test bed, each once."""
        return tuple(dict.fromkeys(block.arm for block in self.records if block.arm))

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
