"""Random numbers that belong to a name."""

import hashlib

import numpy as np


def chance(name: str) -> np.random.Generator:
    """A generator that is the same for a name in any process and on any machine."""
    return np.random.default_rng(int.from_bytes(hashlib.sha256(name.encode()).digest()[:8], "big"))
