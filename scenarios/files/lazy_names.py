"""Public names of a room, imported when they are first used: the command line's help does not load the laboratory."""

from collections.abc import Callable
from importlib import import_module


def lazy_names(package: str, **modules: str) -> Callable[[str], object]:
    """Function `__getattr__` of a package: it imports a public name when it is first used.

    Args:
        package: Name of the package.
        **modules: Names that each module of the package holds, separated by spaces.
    """
    places = {name: module for module, names in modules.items() for name in names.split()}

    def get(name: str) -> object:
        if name not in places:
            raise AttributeError(f"module {package!r} has no attribute {name!r}")
        return getattr(import_module(f"{package}.{places[name]}"), name)

    return get
