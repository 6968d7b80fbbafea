"""The conclusions of one seed as a file, and read back only where nothing about them is in doubt."""

import json
import math
from collections.abc import Iterable, Mapping
from hashlib import sha256
from pathlib import Path
from typing import Any, get_args

from hmtb_twin import STUDIED_JOINTS
from scenarios.experiments.model_structures import STRUCTURES
from scenarios.files.atomic_write import write_whole
from scenarios.thesis.claims import CLAIMS
from scenarios.thesis.finding import Verdict
from scenarios.thesis.outcome import Outcome, Recovered, outcome_from


def keep(found: Outcome, setting: Mapping[str, object], path: Path) -> None:
    """Write the conclusions of a seed.

    Args:
        found: The conclusions.
        setting: All that they depend on besides the seed, as JSON holds it.
        path: The file.
    """
    record = found.record()
    whole = {"setting": setting, "digest": _digest(record), "outcome": record}
    write_whole(path, json.dumps(whole, indent=1, allow_nan=False))


def kept(path: Path, seed: int, setting: Mapping[str, object]) -> Outcome | None:
    """The conclusions that an earlier run kept.

    Args:
        path: The file.
        seed: Whose conclusions they must be.
        setting: What they must have been made with.

    Returns:
        The conclusions; None where there is no file, or one of another seed or setting, or a spoilt one: whoever asks
        runs the seed anew and writes the file again.
    """
    try:
        record = json.loads(path.read_text(encoding="utf-8"))
        if record["setting"] != setting or record["digest"] != _digest(record["outcome"]):
            return None
        found = outcome_from(record["outcome"])
        whole = found.record() == record["outcome"] and sound(found)
    except FileNotFoundError:
        return None
    except (ValueError, LookupError, TypeError, AttributeError, ArithmeticError, RecursionError):
        return None  # whatever else is written there, it is none of ours
    return found if whole and found.seed == seed and found.duration == setting["duration"] else None


def _digest(record: Mapping[str, Any]) -> str:
    """What tells a number that was changed after it was written."""
    return sha256(json.dumps(record, sort_keys=True).encode()).hexdigest()


def sound(found: Outcome) -> bool:
    """Whether conclusions are whole: every finding, joint and method is there, and no number where none can be.

    Args:
        found: The conclusions, their kinds of values unchecked.
    """
    return (
        _whole_number(found.seed)
        and set(found.verdicts) == set(CLAIMS) == set(found.numbers)
        and all(verdict in get_args(Verdict) for verdict in found.verdicts.values())
        # A verdict rests on a number, unless it says that there is none.
        and all(found.numbers[key] or verdict == "cannot be told" for key, verdict in found.verdicts.items())
        and set(found.true_hz) == set(STUDIED_JOINTS) == set(found.recovered)
        and all(map(_positive, found.true_hz.values()))
        and all(_recovered(joint, found) for joint in STUDIED_JOINTS)
        and all(map(_positive, (found.cost.physics_s, found.cost.simulation_s, found.cost.total_s)))
        and _texts((*found.failed.items(), *found.versions.items()))
    )


def _recovered(joint: str, found: Outcome) -> bool:
    methods, true = found.recovered[joint], found.true_hz[joint]
    return set(methods) == {entry.method for entry in STRUCTURES[joint]} and all(
        _bandwidth(entry, true) for entry in methods.values()
    )


def _bandwidth(entry: Recovered, true: float) -> bool:
    low, high = entry.ci95
    return (
        not any(value <= 0.0 for value in (entry.hz, high, entry.half_power_hz))
        and not low < 0.0
        and not high < low
        and isinstance(entry.covers, bool)
        and entry.covers == (low <= true <= high)
    )


def _positive(value: Any) -> bool:  # as it came from the file
    return isinstance(value, float) and math.isfinite(value) and value > 0.0


def _whole_number(value: Any) -> bool:
    return isinstance(value, int) and not isinstance(value, bool)


def _texts(pairs: Iterable[tuple[Any, Any]]) -> bool:
    return all(isinstance(key, str) and isinstance(value, str) for key, value in pairs)
