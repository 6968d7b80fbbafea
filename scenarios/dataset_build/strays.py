"""Files in the folder of a build that no part of it made: they would be published with the rest."""

import os
from collections.abc import Collection, Iterator
from itertools import chain
from pathlib import Path

from scenarios.dataset_build.manifest import Manifest
from scenarios.errors import ScenarioError

SHOWN = 3
"""Files that an error names."""


def refuse_strays(folder: Path, manifest: Manifest, written: Collection[str]) -> None:
    """Refuse a folder with files of nobody.

    Args:
        folder: That of the build.
        manifest: What it says was made is there.
        written: Places of files that the manifest does not name.

    Raises:
        ScenarioError: There are others.
    """
    # Of millions of files the names would fill the memory: they are compared only where their number is not right.
    if sum(1 for _ in _places(folder)) == sum(1 for _ in _noted(manifest)) + len(written):
        return
    known = {*_noted(manifest), *written}
    strays = sorted(place for place in _places(folder) if place not in known)
    if strays:
        more = f" and {len(strays) - SHOWN} more" if len(strays) > SHOWN else ""
        raise ScenarioError(
            f"{folder} holds {', '.join(map(ascii, strays[:SHOWN]))}{more}, which no part of the build made: take away "
            "what is not of the data set; the same command goes on from there"
        )


def _places(folder: Path) -> Iterator[str]:
    for parent, folders, names in os.walk(folder):
        links = [name for name in folders if Path(parent, name).is_symlink()]
        yield from (Path(parent, name).relative_to(folder).as_posix() for name in (*names, *links))


def _noted(manifest: Manifest) -> Iterator[str]:
    for line in chain(manifest.noted(), manifest.pieces()):
        yield from line["files"]
