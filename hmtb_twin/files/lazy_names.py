"""Public names of a room, imported when they are first used: the command line's help does not load the laboratory."""

import ast
from collections.abc import Callable
from importlib import import_module
from pathlib import Path


def lazy_names(package: str, file: str) -> Callable[[str], object]:
    """Function `__getattr__` of a package: it imports a public name when it is first used.

    Args:
        package: Name of the package.
        file: Its source, which imports the names for type checkers alone.
    """
    modules: dict[str, str] = {}
    for statement in ast.walk(ast.parse(Path(file).read_bytes())):
        if isinstance(statement, ast.ImportFrom):
            modules |= {alias.name: statement.module or "" for alias in statement.names}

    def get(name: str) -> object:
        if name not in modules:
            raise AttributeError(f"module {package!r} has no attribute {name!r}")
        return getattr(import_module(modules[name]), name)

    return get
