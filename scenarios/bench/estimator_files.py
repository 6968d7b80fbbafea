"""Estimators from the command line, and the files that they are made of."""

import importlib
import re
import shlex
import shutil
import sys
from collections import Counter
from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from hashlib import sha256
from importlib.machinery import PathFinder
from modulefinder import ModuleFinder
from pathlib import Path

from scenarios.estimators.estimator import Estimator
from scenarios.estimators.known_estimators import KNOWN
from scenarios.estimators.known_estimators import estimator as known_estimator
from scenarios.files.errors import ScenarioError, unknown

FUNCTION = re.compile(r"[^\W\d]\w*(?:\.[^\W\d]\w*)*", re.ASCII)
"""A Python name, with dots for something inside a module or class."""

OURS = ("hmtb_twin", "scenarios", "sysid")
"""Packages whose version stands for all their files; see `scenarios.files.provenance.fingerprint`."""

SOURCES = frozenset((".m", ".p", ".mex", ".mexa64", ".oct", ".jl", ".r", ".py", ".pl", ".rb", ".lua", ".sh", ".so"))
"""Endings of source files of programs."""


@dataclass(frozen=True)
class EstimatorOptions:
    """Options of the command line on estimators of the user's own.

    An empty name stands for that of the target; for the others see `Estimator`.
    """

    name: str = ""
    structure: str | None = None
    method: str | None = None
    stays: bool = False

    def words(self) -> tuple[str, ...]:
        """The options as words of the command line."""
        words: list[str] = []
        for option, value in (("--name", self.name), ("--structure", self.structure), ("--method", self.method)):
            if value:
                words += [option, value]
        if self.stays:
            words.append("--stays")
        return tuple(words)


def parse_estimators(texts: Sequence[str], command: str | None, options: EstimatorOptions) -> dict[Estimator, str]:
    """Estimators, each with the words of the command line that give it.

    Args:
        texts: `module:function`, `file.py:function`, or names of estimators that the bench knows.
        command: Command line of a program, or None.
        options: Structure and method of each estimator of the user's own, name of the only one.

    Raises:
        ScenarioError: There is no estimator, one is not found, or options do not fit.
    """
    if not texts and command is None:
        raise ScenarioError(
            "no estimator given; expected MODULE:FUNCTION, FILE.py:FUNCTION, --command, or a known name"
        )
    _check_options(texts, command, options)
    estimators: dict[Estimator, str] = {}
    for target in texts:
        if ":" in target:
            # `--stays` is of the program that the same command line gives.
            estimators[_function(target, options)] = shlex.join([target, *replace(options, stays=False).words()])
        elif target in KNOWN:
            estimators[known_estimator(target)] = shlex.quote(target)
        else:
            raise ScenarioError(
                unknown("estimator", target, KNOWN, listing="hmtb verify --list")
                + "; an estimator of your own is given as MODULE:FUNCTION or FILE.py:FUNCTION"
            )
    if command is not None:
        estimators[_program(command, options)] = shlex.join(["--command", command, *options.words()])
    return estimators


def _check_options(targets: Sequence[str], command: str | None, options: EstimatorOptions) -> None:
    """Refuse options without an estimator that they could be of, and estimators that are given twice."""
    count = sum(":" in target for target in targets) + (command is not None)
    if options != EstimatorOptions() and not count:
        words = " ".join(options.words())
        raise ScenarioError(f"{words} given without an estimator of your own; known ones have theirs")
    if options.name and count > 1:
        raise ScenarioError(
            f"--name {options.name} given with {count} estimators of your own, expected one; functions have the names "
            "that their files give them"
        )
    if options.stays and command is None:
        raise ScenarioError("--stays given without --command; expected both: only programs are started")
    repeated = [target for target, times in Counter(targets).items() if times > 1]
    if repeated:
        raise ScenarioError(f"estimators given twice: {', '.join(repeated)}")


def _function(target: str, options: EstimatorOptions) -> Estimator:
    """A function of a module or of a file; the module is imported in the estimator's process only."""
    module, _, function = target.rpartition(":")
    is_file = module.endswith(".py")
    if not FUNCTION.fullmatch(function) or not (is_file or FUNCTION.fullmatch(module)):
        raise ScenarioError(f"{target!r} given, expected MODULE:FUNCTION or FILE.py:FUNCTION")
    home = ""
    if is_file:
        path = Path(module).expanduser()
        if not path.is_file():
            raise ScenarioError(f"{target!r} given, but there is no file {module!r}")
        # A child process imports it by this name.
        if not FUNCTION.fullmatch(path.stem):
            raise ScenarioError(f"{module!r} given, expected a file whose name can be imported, such as my_module.py")
        # The file, not a module of its name: Python may find another module of that name first.
        module = path.name
        if path.parent != Path():
            home = str(path.parent)
    estimator = Estimator(
        options.name or function, f"{module}:{function}", structure=options.structure, method=options.method, home=home
    )
    if module_file(estimator) is None:
        raise ScenarioError(
            f"{target!r} given, but no module {module!r} is found in this folder or among the installed packages"
        )
    return estimator


def _program(command: str, options: EstimatorOptions) -> Estimator:
    """The estimator that a command line starts."""
    try:
        words = shlex.split(command)
    except ValueError as error:
        raise ScenarioError(f"--command {command!r} given, which is no command line: {error}") from error
    if not words:
        raise ScenarioError("an empty --command given, expected a command line")
    # Named after the first file among its arguments: `octave arx.m` is `arx`.
    scripts = [Path(word).stem for word in words[1:] if Path(word).is_file()]
    name = options.name or next(iter(scripts), Path(words[0]).name)
    structure, method = options.structure, options.method
    return Estimator(name, command, program=True, stays=options.stays, structure=structure, method=method)


@dataclass(frozen=True)
class EstimatorFiles:
    """Files of an estimator as they travel to a worker on another machine.

    Attributes:
        source: Hash of its files where it comes from; see `source_hash`.
        own: Names and contents of files in the user's own folder; other packages, and programs, must be installed on
            the workers under the same names and paths.
    """

    source: str
    own: tuple[tuple[str, bytes], ...]

    @classmethod
    def of(cls, estimator: Estimator) -> "EstimatorFiles":
        """Read the files of an estimator."""
        return cls(source_hash(estimator), tuple(own_files(estimator).items()))

    def unpacked(self, estimator: Estimator, folder: Path) -> Estimator:
        """The estimator with its own files in a folder of this machine.

        Raises:
            ScenarioError: Its files differ here.
        """
        for name, content in self.own:
            path = folder / name
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_bytes(content)
        if self.own:
            estimator = replace(estimator, home=str(folder))
        source = source_hash(estimator)
        if source != self.source:
            difference = "is another file" if source else "is missing"
            raise ScenarioError(
                f"{estimator.name!r}: {estimator.target!r} {difference} here; expected the packages that it imports, "
                "and programs, under the same paths on every worker"
            )
        return estimator


def source_hash(estimator: Estimator) -> str:
    """SHA-256 of an estimator's own files; empty where it has none.

    Of a function these are the file of its module and the files that it imports from the estimator's own folder. Of a
    program they are every file that a word of the command line names, in the folder that it runs in, the program itself
    included, and the source files of every folder that a word names: ``octave-cli --path FOLDER --eval ...`` finds
    functions there.
    """
    contents: list[bytes] = []
    module = module_file(estimator)
    if estimator.program:
        contents = [_content(path) for path in _program_files(estimator)]
    elif files := own_files(estimator):
        # A file that only moves is another one for those who import it.
        for name, content in files.items():
            contents += [name.encode(), content]
    elif module is not None:
        contents = [module.read_bytes()]
    # Digests have one length: contents that only divide otherwise give another hash.
    digests = b"".join(sha256(content).digest() for content in contents)
    return sha256(digests).hexdigest() if contents else ""


def own_files(estimator: Estimator) -> dict[str, bytes]:
    """Files of the user's own folder that a function's module consists of, by their names in it, its own file first.

    Imports are found in the source, without running it; imports by computed names and data files are not found.

    Returns:
        Nothing for a program, and for a module that lies elsewhere.
    """
    path, home = module_file(estimator), Path(estimator.home or ".").resolve()
    if path is None or not path.resolve().is_relative_to(home):
        return {}
    module = estimator.target.rpartition(":")[0]
    first = path.resolve().relative_to(home).parts[0]
    # An installed module may lie somewhere below the folder too.
    lies_in_home = module.endswith(".py") or first.removesuffix(".py") == module.partition(".")[0]
    if first in OURS or not lies_in_home:
        return {}
    # Our own packages are left out: their version stands for them, see `OURS`.
    finder = ModuleFinder(path=[str(home)], excludes=list(OURS))
    # A file that cannot be parsed cannot be imported either, and its estimator reports that. AttributeError:
    # ModuleFinder fails on namespace packages.
    with suppress(SyntaxError, ValueError, OSError, RecursionError, AttributeError):
        finder.run_script(str(path.resolve()))
    # Namespace packages have no file.
    names = {getattr(module, "__file__", None) for module in finder.modules.values()}
    imported = {Path(name) for name in names if name}
    helpers = sorted(file for file in imported if file.is_relative_to(home) and file != path.resolve())
    return {str(file.relative_to(home)): file.read_bytes() for file in (path.resolve(), *helpers)}


def module_file(estimator: Estimator) -> Path | None:
    """File of a function's module, found as an import would but without one; None if missing, and of a program."""
    if estimator.program or estimator.is_perfect:
        return None
    module = estimator.target.rpartition(":")[0]
    home = Path(estimator.home or ".")
    if module.endswith(".py"):
        return home / module if (home / module).is_file() else None
    importlib.invalidate_caches()  # the file may have been written a moment ago
    spec, folders = None, [str(home), *sys.path]
    for name in module.split("."):
        # Name by name: to find a.b, importlib.util.find_spec would run the code of a.
        spec = PathFinder.find_spec(name, folders)
        folders = []
        if spec is not None:
            folders = list(spec.submodule_search_locations or ())
    return Path(spec.origin) if spec and spec.origin and Path(spec.origin).is_file() else None


def _program_files(estimator: Estimator) -> Iterator[Path]:
    """Files, and sources in folders, that the words of a command line name; of ``--path=FOLDER`` the part behind =."""
    home = Path(estimator.home or ".")
    try:
        words = shlex.split(estimator.target)
    except ValueError:
        return
    for index, word in enumerate(words):
        files: list[Path] = []
        for name in dict.fromkeys((word, word.rpartition("=")[2])):
            if name:
                files += _files_at(home / name)
        # The program itself is found on the path where it is no file of the folder.
        program = shutil.which(word) if index == 0 and not files else None
        if program is not None:
            files = [Path(program)]
        yield from files


def _files_at(path: Path) -> list[Path]:
    """A file, or the source files of a folder; nothing where there is neither."""
    # A word of a command line may be longer than any path, or hold what none may.
    with suppress(OSError, ValueError):
        if path.is_file():
            return [path]
        if path.is_dir():
            return sorted(file for file in path.iterdir() if file.suffix.lower() in SOURCES and file.is_file())
    return []


def _content(path: Path) -> bytes:
    """Content of a file; its name where it may not be read, since the program may not need to."""
    try:
        return path.read_bytes()
    except OSError:
        return str(path).encode("utf-8", "surrogateescape")
