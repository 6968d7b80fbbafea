"""What the outcomes of a contestant depend on."""

import os
import platform
from collections.abc import Mapping
from dataclasses import asdict
from hashlib import sha256
from pathlib import Path
from typing import Any

from scenarios.bench.source import source_hash
from scenarios.estimators.contestant import Contestant, Limits
from scenarios.estimators.task import PROTOCOL
from scenarios.jobs.bitwise_compatibility import kinship

CPU = Path("/proc/cpuinfo")


def key_of(contestant: Contestant, limits: Limits, seed: int) -> dict[str, Any]:
    """The key of a contestant's journal, of what JSON holds.

    Args:
        contestant: The estimator.
        limits: What it may use.
        seed: Of the run.
    """
    return {
        "contestant": asdict(contestant),
        "limits": asdict(limits),
        "seed": seed,
        "protocol": PROTOCOL,
        "source": source_hash(contestant),
        "software": sha256(repr(sorted(kinship().items())).encode()).hexdigest(),
    }


def machine() -> str:
    """Processor and number of cores of this machine, in words."""
    return f"{_processor()}, {os.cpu_count() or 1} cores"


def _processor() -> str:
    try:
        lines = CPU.read_text(encoding="utf-8", errors="replace").splitlines()
    except OSError:
        lines = []
    told: Mapping[str, str] = {
        name.strip(): value.strip() for name, _, value in (line.partition(":") for line in lines) if value
    }
    return told.get("model name") or platform.processor() or platform.machine()
