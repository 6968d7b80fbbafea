"""Rates of the automatic answer: what `hmtb identify` concludes without orders, on records whose plant is known.

    python tests/benchmarks/automatic_choice.py [--records 50] [--seed 0] [--kinds ramp hum ...]

Each kind is a situation that misleads a choice of orders. The plant is drawn anew for every record. An answer is right
if gain and bandwidth of its model are within 20 % of the plant's; of an integrator the position of its pole and the
slope count, of an unstable plant its unstable pole. Of a joint with friction or play no linear model is right, of one
with saturation that of its servo; none is right whose bandwidth lies far above what the input excites. Counted are
answers that a verdict calls sufficient and that are right, those that are wrong, and those that the verdict withholds;
and of those that are right, the share whose 95 % interval of the bandwidth holds the plant's.
"""

import argparse
import warnings
from collections.abc import Iterator
from dataclasses import dataclass, replace
from time import process_time

import numpy as np

from scenarios.identification.identification import Identification
from scenarios.identification.order_choice import choose_and_identify, hold_out
from scenarios.identification.result_tables import verdict
from sysid import IOData
from tests.benchmarks.misleading_records import KINDS, Kind


@dataclass(frozen=True)
class Answer:
    """One record's answer."""

    outcome: str
    """"right", "wrong" or "withheld"."""
    is_right: bool
    seconds: float
    """Of processor time."""
    holds: bool | None
    """Whether the interval of the bandwidth holds the plant's; None where none is printed."""


def answers(kind: Kind, records: int, seed: int, method: str | None) -> Iterator[Answer]:
    """Answers for records of a kind."""
    for k in range(records):
        plant, record = kind(np.random.default_rng([seed, k]))
        started = process_time()
        result = answered(record, method)
        sufficient = verdict(result).startswith("sufficient")
        is_right = plant.finds(result.fitted.estimate)
        outcome = ("right" if is_right else "wrong") if sufficient else "withheld"
        claim = result.fitted.claims[0][0]
        holds = bool(claim.low <= plant.bandwidth <= claim.high) if np.isfinite(claim.low) else None
        yield Answer(outcome, is_right, process_time() - started, holds)


def answered(records: tuple[IOData, ...], method: str | None) -> Identification:
    """The model and its verdict as `hmtb identify` gives them."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        named = tuple(replace(record, name=record.name or "record") for record in records)
        to_estimate, check = hold_out(named)
        result, _ = choose_and_identify(
            to_estimate, method, check=check, continued=True, whole=named if check else None
        )
    return result


def main() -> None:
    """Print the rates of every kind."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--records", type=int, default=50)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--method", default=None)
    parser.add_argument("--kinds", nargs="*", default=list(KINDS))
    given = parser.parse_args()
    words = ("right", "wrong", "withheld")
    heads = (("right", 6), ("wrong", 6), ("withheld", 9), ("right but withheld", 19), ("holds", 9), ("s each", 7))
    print(f"{'kind':14s}", *(f"{head:>{width}s}" for head, width in heads))
    for name in given.kinds:
        found = list(answers(KINDS[name], given.records, given.seed, given.method))
        right, wrong, withheld = (sum(one.outcome == word for one in found) for word in words)
        needless = sum(one.outcome == "withheld" and one.is_right for one in found)
        intervals = [one.holds for one in found if one.outcome == "right" and one.holds is not None]
        share = f"{sum(intervals)} of {len(intervals)}"
        seconds = np.mean([one.seconds for one in found])
        print(f"{name:14s} {right:6d} {wrong:6d} {withheld:9d} {needless:19d} {share:>9s} {seconds:7.2f}", flush=True)


if __name__ == "__main__":
    main()
