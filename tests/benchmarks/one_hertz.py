"""The 1 Hz finding on every arm of the study, over seeds: `docs/bandwidth.md`.

Its output stands on that page; renewed by: python tests/benchmarks/verification.py one_hertz
"""

import argparse
from collections.abc import Callable, Iterator
from contextlib import contextmanager

import numpy as np

from hmtb_twin import STUDIED_JOINTS
from scenarios.experiments.campaign import CONDITIONS
from scenarios.identification.bandwidth_study import BandwidthStudy, from_simulation
from scenarios.identification.one_hertz import best_linear_in_words, between, verdict
from scenarios.identification.recovered_bandwidth import METHODS, RecoveredBandwidth
from sysid.models.bandwidth import half_power_hz

TEST = 5
"""The PRBS of 1 V, which the thesis identifies from."""


def main() -> None:
    """Print what is true of each arm, what each method recovers from it, the verdicts, and what is not claimed."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--seeds", type=int, default=5)
    parser.add_argument("--duration", type=float, default=None)
    asked = parser.parse_args()
    studies = [
        from_simulation(
            STUDIED_JOINTS,
            tuple(METHODS),
            (TEST,),
            seeds=range(1, asked.seeds + 1),
            condition=condition,
            duration=asked.duration,
            stage=quiet,
        )
        for condition in CONDITIONS
    ]
    print("| arm | joint | small-signal / Hz | best linear / Hz (95 %) | gain 0.707, small-signal | best linear |")
    print("|---|---|---|---|---|---|")
    for study in studies:
        for joint in study.joints:
            print(true_line(study, joint))
    names = " | ".join(joint.replace("_", " ") + " / Hz" for joint in STUDIED_JOINTS)
    print(f"\n| arm | method | {names} | near 1 Hz | holds small-signal | agrees with best linear | gain 0.707 / Hz |")
    print("|---|---|---|---|---|---|---|---|---|")
    for study in studies:
        for method in METHODS:
            print(recovered_line(study, method))
    print()
    for study in studies:
        print(f"- *{study.condition[:1].upper()}{study.condition[1:]}*: {verdict(study.rows)}")
        print(f"  {best_linear_in_words(study.rows)}")
        for text in study.refusals():
            print(f"  - not claimed: {text}")


def true_line(study: BandwidthStudy, joint: str) -> str:
    """A row of the table of truths."""
    truth, one = study.truth.joint(joint), study.best_linear[joint, str(TEST)]
    hz = f"{one.hz:.3f} ({one.ci95[0]:.3f} to {one.ci95[1]:.3f})" if np.isfinite(one.hz) else "none shows"
    levels = f"{half_power_hz(truth.model):.3f} | {one.half_power_hz:.3f}"
    return f"| {study.condition} | {joint} | {truth.bandwidth_hz:.3f} | {hz} | {levels} |"


def recovered_line(study: BandwidthStudy, method: str) -> str:
    """A row of the table of methods: all joints and seeds."""
    rows = [row for row in study.rows if row.method == method]
    shown = " | ".join(hz_range([row for row in rows if row.joint == joint]) for joint in STUDIED_JOINTS)
    counts = [
        f"{sum(row.near for row in rows)} of {len(rows)}",
        f"{sum(row.covers for row in rows)} of {len(rows)}",
        f"{sum(bool(row.covers_best_linear) for row in rows)} of {len(rows)}",
    ]
    levels = [row.half_power_hz for row in rows if np.isfinite(row.half_power_hz)]
    return f"| {study.condition} | {METHODS[method]} | {shown} | {' | '.join(counts)} | {between(levels)} |"


def hz_range(rows: list[RecoveredBandwidth]) -> str:
    """Range of the bandwidths that are claimed; in brackets that of the models of which none is."""
    values = [row.hz for row in rows if np.isfinite(row.hz)]
    models = [row.model_hz for row in rows if row.refused and np.isfinite(row.model_hz)]
    said = [between(values)] if values else []
    if refused := len(rows) - len(values):
        said.append(f"{refused} not claimed" + (f" ({between(models)})" if models else ""))
    return ", ".join(said)


@contextmanager
def quiet(name: str) -> Iterator[Callable[[int, int], None]]:
    """Tell nobody how far it is."""
    yield lambda done, total: None


if __name__ == "__main__":
    main()
