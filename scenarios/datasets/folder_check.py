"""Compare the files in the folder of a data set with its checksums; no path leads out of the folder."""

import os
import re
import stat
from dataclasses import dataclass, field
from pathlib import Path

from scenarios.datasets.plan import SUMS

LINE = re.compile(rb"([0-9a-f]{64})  ([^\x00-\x1f\x7f\\]{1,4096})\n")
"""A line of the checksums, as the builder writes it; no other spelling passes, so that no byte can change unseen."""

MOST_BAD = 20
"""Wrong lines of the checksums that are reported one by one."""

MOST_BYTES = 2**36
"""No file of a data set is larger."""


@dataclass
class FolderFiles:
    """Files by path in the folder.

    Attributes:
        sizes: Sizes of the files that are there and listed, bytes.
        sums: Checksums of the files that are listed.
        problems: One line for each thing that is wrong.
    """

    sizes: dict[str, int] = field(default_factory=dict)
    sums: dict[str, str] = field(default_factory=dict)
    problems: list[str] = field(default_factory=list)


def folder_files(folder: Path) -> FolderFiles:
    """List the files of a data set and its checksums, and compare.

    Args:
        folder: Folder of the data set; links in it are not followed.
    """
    files = FolderFiles()
    _walk(folder, files)
    if files.sizes.pop(SUMS, None) is None:
        files.problems.append(f"{SUMS} is missing: no file can be checked against it")
        return files
    _read_sums(folder / SUMS, files)
    files.problems += [f"{place} is missing" for place in files.sums if place not in files.sizes]
    extra = [place for place in files.sizes if place not in files.sums]
    files.problems += [f"{place} is not listed in {SUMS}" for place in extra]
    for place in extra:
        del files.sizes[place]
    return files


def _walk(folder: Path, files: FolderFiles) -> None:
    def refused(error: OSError) -> None:
        files.problems.append(f"{error.filename}: cannot be listed: {error.strerror}")

    for parent, folders, names in os.walk(folder, onerror=refused):
        folders.sort()
        for name in sorted((*names, *folders)):
            path = Path(parent, name)
            place = path.relative_to(folder).as_posix()
            status = path.lstat()
            if not place.isprintable():
                files.problems.append(f"{place!r}: expected a name of printable characters")
            elif stat.S_ISDIR(status.st_mode):
                continue
            elif not stat.S_ISREG(status.st_mode):
                kind = "a link" if stat.S_ISLNK(status.st_mode) else "no ordinary file"
                files.problems.append(f"{place!r} is {kind}; expected files alone")
            elif status.st_size > MOST_BYTES:
                files.problems.append(f"{place!r} has {status.st_size} bytes; expected at most {MOST_BYTES}")
            else:
                files.sizes[place] = status.st_size


def _read_sums(path: Path, files: FolderFiles) -> None:
    bad = 0
    with path.open("rb") as stream:
        number = 0
        while line := stream.readline(8192):
            number += 1
            wrong = _note(line, files)
            bad += bool(wrong)
            if wrong:
                files.problems.append(f"{SUMS}, line {number}: {wrong}")
            if bad > MOST_BAD:
                files.problems.append(f"{SUMS}: more wrong lines; it is damaged")
                return
    if not files.sums:
        files.problems.append(f"{SUMS} lists no file")


def _note(line: bytes, files: FolderFiles) -> str:
    """Add a line to the checksums; return what is wrong with it, or nothing."""
    match = LINE.fullmatch(line)
    if match is None:
        return f"{line[:100]!r} given, expected a SHA-256, two spaces, a file and the end of the line"
    try:
        place = match[2].decode()
    except UnicodeDecodeError:
        return f"{match[2][:100]!r} is no name in UTF-8"
    if place.startswith("/") or any(part in ("", ".", "..") for part in place.split("/")):
        return f"{place[:100]!r} leads out of the folder, or is no plain path; it is not looked at"
    if place == SUMS or place in files.sums:
        return f"{place!r} is listed twice" if place in files.sums else f"{SUMS} lists itself"
    files.sums[place] = match[1].decode()
    return ""
