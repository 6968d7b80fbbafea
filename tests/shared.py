"""Results that are expensive to make: made once for all processes of the tests, and kept while no source changes.

They lie in `build/tests`, in a folder named by the hash of everything that they depend on. A lock makes the second
process wait for the first. Values are pickled: whoever can write into the clone could as well change the tests.
"""

import copyreg
import fcntl
import os
import pickle
import shutil
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import cache
from hashlib import sha256
from pathlib import Path
from types import MappingProxyType
from typing import TypeVar

from scenarios.files.provenance import fingerprint, versions

ROOT = Path(__file__).parents[1]
FOLDER = ROOT / "build" / "tests"
MAKERS = ("tests/conftest.py", "tests/shared.py", "tests/scenarios/conftest.py")
"""Files of the tests that say what is made."""

T = TypeVar("T")


def read_only(items: dict[object, object]) -> MappingProxyType[object, object]:
    """A read-only mapping, as records hold them; Python pickles neither these nor their class."""
    return MappingProxyType(items)


copyreg.pickle(MappingProxyType, lambda mapping: (read_only, (dict(mapping),)))


@cache
def key() -> str:
    """Hash of the sources, of the versions of the packages, and of the files that say what is made."""
    digest = sha256(f"{fingerprint()} {sorted(versions().items())}".encode())
    for name in MAKERS:
        digest.update((ROOT / name).read_bytes())
    return digest.hexdigest()[:16]


@contextmanager
def locked(name: str) -> Iterator[Path]:
    """Hold the lock of a result; its path. Results of other sources are removed."""
    folder = FOLDER / key()
    folder.mkdir(parents=True, exist_ok=True)
    for other in FOLDER.iterdir():
        if other.name != folder.name:
            shutil.rmtree(other, ignore_errors=True)
    with (folder / f"{name}.lock").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        yield folder / name


def shared(name: str, make: Callable[[], T]) -> T:
    """A value by its name, made by `make` where it is not there yet."""
    with locked(name) as path:
        if path.exists():
            return pickle.loads(path.read_bytes())
        value = make()
        # Renamed when it is whole: a run that is killed leaves no half of it.
        partial = path.with_suffix(f".{os.getpid()}")
        partial.write_bytes(pickle.dumps(value))
        partial.rename(path)
        return value


def shared_folder(name: str, make: Callable[[Path], object]) -> Path:
    """A folder by its name, which `make` fills; tests that change it take a copy."""
    with locked(name) as path:
        if not path.exists():
            partial = path.with_suffix(f".{os.getpid()}")
            make(partial)
            partial.rename(path)
        return path
