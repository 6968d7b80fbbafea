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
        package = str(error.name).partition(".")[0]
        raise SysidError(f"this needs the package {package}: pip install './sysid[{extra}]'") from error
