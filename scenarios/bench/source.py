"""What an estimator is made of: the file of its function with those beside it that it imports, or of its command."""

import importlib.util
import shlex
import shutil
import sys
from collections.abc import Iterator
from contextlib import suppress
from hashlib import sha256
from modulefinder import ModuleFinder
from pathlib import Path

from scenarios.estimators.contestant import Contestant

PACKAGE = "__init__.py"

OURS = ("hmtb_twin", "scenarios", "sysid")
"""Packages that are looked at as a whole, wherever they lie; see `scenarios.files.provenance.fingerprint`."""

SOURCES = frozenset((".m", ".p", ".mex", ".mexa64", ".oct", ".jl", ".r", ".py", ".pl", ".rb", ".lua", ".sh", ".so"))
"""Endings of what programs are made of."""


def source_hash(contestant: Contestant) -> str:
    """SHA-256 of an estimator's own files; empty where it has none.

    Of a function that is the file of its module, and what that imports from the estimator's own folder. Of a program it
    is every file that a word of the command line names, in the folder that it runs in, the program itself included, and
    the source files of every folder that a word names: ``octave-cli --path FOLDER --eval ...`` finds functions there.

    Args:
        contestant: The estimator.
    """
    if contestant.program:
        files = list(_named(contestant))
        contents = [_content(path) for path in files]
    else:
        own = own_files(contestant)
        path = None if own else module_file(contestant)
        contents = [part for name, text in own.items() for part in (name.encode(), text)]
        contents += [path.read_bytes()] if path is not None else []
    if not contents:
        return ""
    digest = sha256()
    for content in contents:
        digest.update(sha256(content).digest())
    return digest.hexdigest()


def module_file(contestant: Contestant) -> Path | None:
    """File of the module of a function; None of a program, and of what is found nowhere.

    Args:
        contestant: The estimator.
    """
    return None if contestant.program else next(_module(contestant), None)


def own_files(contestant: Contestant) -> dict[str, bytes]:
    """Files of the estimator's own folder that its module is made of, by their names in it, the module's own first.

    What it imports is found in its source, without running it: what is imported by a name that is only known when it
    runs, or read from data files, is not.

    Args:
        contestant: The estimator.

    Returns:
        Nothing for a program, and for a module that lies elsewhere.
    """
    path, home = module_file(contestant), Path(contestant.home or ".").resolve()
    if path is None or not path.resolve().is_relative_to(home):
        return {}
    place, first = contestant.target.rpartition(":")[0], path.resolve().relative_to(home).parts[0]
    # An installed module may lie somewhere below the folder too.
    if first in OURS or not (place.endswith(".py") or first.removesuffix(".py") == place.partition(".")[0]):
        return {}
    finder = ModuleFinder(path=[str(home)], excludes=list(OURS))
    # What cannot be read cannot be imported either, and is told when that is tried; it has no way with namespaces.
    with suppress(SyntaxError, ValueError, OSError, RecursionError, AttributeError):
        finder.run_script(str(path.resolve()))
    found = {Path(file) for one in finder.modules.values() if (file := getattr(one, "__file__", None))}
    others = sorted(one for one in found if one.is_relative_to(home) and one != path.resolve())
    return {str(one.relative_to(home)): one.read_bytes() for one in (path.resolve(), *others)}


def _module(contestant: Contestant) -> Iterator[Path]:
    """The module's file, looked for where an import would, without importing anything."""
    place = contestant.target.rpartition(":")[0]
    home = Path(contestant.home or ".")
    if place.endswith(".py"):
        if (home / place).is_file():
            yield home / place
        return
    parts = place.split(".")
    for folder in (home, *map(Path, sys.path)):
        path = folder.joinpath(*parts)
        for file in (path / PACKAGE, path.with_name(f"{path.name}.py")):
            if file.is_file():
                yield file
                return
    try:
        spec = importlib.util.find_spec(parts[0])
    except (ImportError, ValueError):
        return
    if spec is not None and spec.origin is not None and len(parts) == 1 and Path(spec.origin).is_file():
        yield Path(spec.origin)


def _content(path: Path) -> bytes:
    """What a file holds; its name, where that may not be read: the program may have no need of it."""
    try:
        return path.read_bytes()
    except OSError:
        return str(path).encode("utf-8", "surrogateescape")


def _named(contestant: Contestant) -> Iterator[Path]:
    try:
        words = shlex.split(contestant.target)
    except ValueError:
        return
    for word in words:
        found = list(_at(Path(contestant.home or "."), word))
        if not found and word == words[0] and (program := shutil.which(word)):
            found = [Path(program)]
        yield from found


def _at(home: Path, word: str) -> Iterator[Path]:
    """The file that a word names, or the sources in the folder; of ``--path=FOLDER`` what stands behind the sign."""
    for text in filter(None, dict.fromkeys((word, word.rpartition("=")[2]))):
        path = home / text
        with suppress(OSError, ValueError):
            if path.is_file():
                yield path
            elif path.is_dir():
                yield from sorted(one for one in path.iterdir() if one.suffix.lower() in SOURCES and one.is_file())
