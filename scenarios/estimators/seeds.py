"""Seeds from texts, and the seeds of a run, independent for each thing that reaches an estimator.

Records and problems are public. An estimator that could compute the seed of its record could look up the truth, so a
run draws its seed from the system's entropy when the files of all estimators are already fixed, and the seed of a task
does not follow from anything that the estimator knows.
"""

import secrets
from collections.abc import Iterable
from hashlib import sha256

import numpy as np

RUN_SEED_BITS = 53
"""Every JSON reader keeps whole numbers of so many bits."""

TASK_SEED_BITS = 31
"""Other languages have no larger whole numbers."""


def seed_of(text: str, bits: int = 63) -> int:
    """A seed of so many bits that is the same for a text in any process and on any machine."""
    return int.from_bytes(sha256(text.encode()).digest()[:8], "big") >> (64 - bits)


def generator_of(name: str) -> np.random.Generator:
    """A random number generator that is the same for a name in any process and on any machine."""
    return np.random.default_rng(seed_of(name, 64))


def draw_run_seed(source_hashes: Iterable[str]) -> int:
    """Draw the seed of a run that is given none; the result file states it, so that the run can be repeated.

    Args:
        source_hashes: Of the files of all estimators. They go into the draw, so that it cannot come before them.
    """
    return seed_of("|".join((secrets.token_hex(32), *source_hashes)), RUN_SEED_BITS)


def task_seed(run_seed: int, trial_key: str) -> int:
    """Seed that an estimator receives for its own random numbers.

    Args:
        run_seed: Of the run; secret while a run with a drawn seed lasts.
        trial_key: Text that names the request among all.
    """
    return seed_of(f"task|{run_seed}|{trial_key}", TASK_SEED_BITS)
