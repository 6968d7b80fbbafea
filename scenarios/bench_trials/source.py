"""Hash of what an estimator is made of: the file of its function, or the files that its command names."""

import importlib.util
import shlex
import shutil
import sys
from collections.abc import Iterator
from hashlib import sha256
from pathlib import Path

from scenarios.bench_contract.contestant import Contestant

PACKAGE = "__init__.py"


def source_hash(contestant: Contestant) -> str:
    """SHA-256 of an estimator's own files; empty where it has none.

    Of a function that is the file of its module: what that imports is not looked at. Of a program it is every file that
    a word of the command line names, in the folder that it runs in, the program itself included.

    Args:
        contestant: The estimator.
    """
    files = list(_named(contestant) if contestant.program else _module(contestant))
    if not files:
        return ""
    digest = sha256()
    for path in files:
        digest.update(sha256(path.read_bytes()).digest())
    return digest.hexdigest()


def module_file(contestant: Contestant) -> Path | None:
    """File of the module of a function; None of a program, and of what is found nowhere.

    Args:
        contestant: The estimator.
    """
    return None if contestant.program else next(_module(contestant), None)


def _module(contestant: Contestant) -> Iterator[Path]:
    """The module's file, looked for where an import would, without importing anything."""
    parts = contestant.target.partition(":")[0].split(".")
    for folder in (Path(contestant.home or "."), *map(Path, sys.path)):
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


def _named(contestant: Contestant) -> Iterator[Path]:
    try:
        words = shlex.split(contestant.target)
    except ValueError:
        return
    for word in words:
        path = Path(contestant.home or ".") / word
        if path.is_file():
            yield path
        elif word == words[0] and (found := shutil.which(word)):
            yield Path(found)
