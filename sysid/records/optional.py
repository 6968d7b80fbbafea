"""Packages that not everybody needs: a clear error where one is missing."""

from collections.abc import Iterator
from contextlib import contextmanager

from sysid.records.errors import SysidError


@contextmanager
def optional(extra: str) -> Iterator[None]:
    """Import a package that an extra of `sysid` installs.

    Args:
        extra: Name of the extra: `files`, `plots`, `control` or `logs`.

    Raises:
        SysidError: The package is not installed.
    """
    try:
        yield
    except ModuleNotFoundError as error:
        raise SysidError(f"this {needs_package(str(error.name), extra)}") from error


def needs_package(module: str, extra: str) -> str:
    """Say which package a module that is not found belongs to, and how to install it with its extra."""
    return f"needs the package {module.partition('.')[0]}: pip install './sysid[{extra}]'"
