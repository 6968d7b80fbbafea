"""Hashes of arrays and files: what a citation can be held to."""

from hashlib import file_digest, sha256
from pathlib import Path

import numpy as np


def array_hash(array: np.ndarray) -> str:
    """Hash numbers and shape of an array, whatever file they stand in.

    Args:
        array: Numbers of any shape; their type in little-endian order and the shape are part of the hash.

    Returns:
        SHA-256, hexadecimal.
    """
    ordered = np.ascontiguousarray(array, dtype=array.dtype.newbyteorder("<"))
    digest = sha256(f"{ordered.dtype.str} {array.shape}\n".encode())
    if ordered.size:
        digest.update(ordered.data)
    return digest.hexdigest()


def bytes_hash(content: bytes) -> str:
    """SHA-256 of some bytes, hexadecimal."""
    return sha256(content).hexdigest()


def file_hash(path: Path) -> str:
    """SHA-256 of a file, hexadecimal, as `sha256sum` gives it."""
    with path.open("rb") as stream:
        return file_digest(stream, "sha256").hexdigest()
