"""The 1 Hz finding on every arm of the study, over seeds: `docs/measured/one-hertz.md`.

Its table is renewed by: python tests/benchmarks/verification.py one_hertz
"""

from contextlib import nullcontext

import numpy as np

from hmtb_twin import STUDIED_JOINTS
from scenarios.identification.bandwidth_study import from_simulation
from scenarios.identification.one_hertz import best_linear_in_words, between, verdict
from scenarios.identification.recovered_bandwidth import METHODS
from scenarios.thesis.campaign import CONDITIONS
from sysid.models.bandwidth import half_power_hz
from tests.benchmarks.tables import heading, options, row

TEST = 5  # the PRBS of 1 V, which the thesis identifies from


def main():
    parser = options(__doc__)
    parser.add_argument("--seeds", type=int, default=5)
    asked = parser.parse_args()
    studies = [
        from_simulation(
            STUDIED_JOINTS,
            tuple(METHODS),
            (TEST,),
            seeds=range(1, asked.seeds + 1),
            condition=condition,
            stage=lambda name: nullcontext(lambda done, total: None),
        )
        for condition in CONDITIONS
    ]
    gains = ("gain 0.707, small-signal", "best linear")
    heading("arm", "joint", "small-signal / Hz", "best linear / Hz (95 %)", *gains)
    for study in studies:
        for joint in study.joints:
            true_row(study, joint)
    print()
    names = (f"{joint.replace('_', ' ')} / Hz" for joint in STUDIED_JOINTS)
    counts = ("near 1 Hz", "holds small-signal", "agrees with best linear", "gain 0.707 / Hz")
    heading("arm", "method", *names, *counts)
    for study in studies:
        for method in METHODS:
            recovered_row(study, method)
    print()
    for study in studies:
        print(f"- *{study.condition[:1].upper()}{study.condition[1:]}*: {verdict(study.rows)}")
        print(f"  {best_linear_in_words(study.rows)}")
        for text in study.refusals():
            print(f"  - not claimed: {text}")


def true_row(study, joint):
    """Print a row of the table of truths."""
    truth, one = study.truth.joint(joint), study.best_linear[joint, str(TEST)]
    hz = f"{one.hz:.3f} ({one.ci95[0]:.3f} to {one.ci95[1]:.3f})" if np.isfinite(one.hz) else "none shows"
    levels = f"{half_power_hz(truth.model):.3f}", f"{one.half_power_hz:.3f}"
    row(study.condition, joint, f"{truth.bandwidth_hz:.3f}", hz, *levels)


def recovered_row(study, method):
    """Print a row of the table of methods: all joints and seeds."""
    rows = [one for one in study.rows if one.method == method]
    ranges = (hz_range([one for one in rows if one.joint == joint]) for joint in STUDIED_JOINTS)
    counts = (
        f"{sum(bool(getattr(one, kind)) for one in rows)} of {len(rows)}"
        for kind in ("near", "covers", "covers_best_linear")
    )
    levels = between([one.half_power_hz for one in rows if np.isfinite(one.half_power_hz)])
    row(study.condition, METHODS[method], *ranges, *counts, levels)


def hz_range(rows):
    """Range of the bandwidths that are claimed; in brackets that of the models of which none is."""
    values = [row.hz for row in rows if np.isfinite(row.hz)]
    models = [row.model_hz for row in rows if row.refused and np.isfinite(row.model_hz)]
    texts = [between(values)] if values else []
    if refused := len(rows) - len(values):
        texts.append(f"{refused} not claimed" + (f" ({between(models)})" if models else ""))
    return ", ".join(texts)


if __name__ == "__main__":
    main()
