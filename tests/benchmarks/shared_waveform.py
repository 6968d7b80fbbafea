"""What a shared waveform does to models of three joints: errors of their responses against the truth.

Full models are identified by OKID (order 18, p = 20) from the settled part of the whole record, block-diagonal ones by
OKID (order 6, p = 20) from each joint's own command. Errors are the largest over 0.25 to 3 Hz, of gains that are 1 at
0 Hz.
"""

import warnings
from dataclasses import replace

import numpy as np

import sysid
from hmtb_twin import JOINTS, STUDIED_JOINTS, linearize, load_arm, simulate
from scenarios import load
from scenarios.experiments.joint_inputs import settled_inputs
from tests.benchmarks.tables import heading, row

FREQUENCIES = np.array([0.25, 0.5, 1.0, 2.0, 3.0])
COLUMNS = [JOINTS.index(joint) for joint in STUDIED_JOINTS]


def errors(log, true):
    """Largest error of the full and of the block-diagonal model."""
    data = sysid.IOData(log.commanded[200:, COLUMNS], log.measured[200:, COLUMNS], log.dt).detrend()
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", sysid.SysidWarning)
        full = sysid.okid(data, 18, p=20).model.frequency_response(FREQUENCIES)
        alone = [sysid.okid(sysid.IOData(data.u[:, i], data.y[:, i], data.dt), 6, p=20).model for i in range(3)]
    diagonal = max(
        np.abs(model.frequency_response(FREQUENCIES)[:, 0, 0] - true[:, i, i]).max() for i, model in enumerate(alone)
    )
    return float(np.abs(full - true).max()), float(diagonal)


def main():
    true = linearize(load_arm()).model.frequency_response(FREQUENCIES)[:, COLUMNS][:, :, COLUMNS]
    shared = [load(name) for name in ("mimo-7", "mimo-7-independent", "mimo-8", "mimo-8-independent")]
    smooth = [
        replace(entry, name=f"{entry.name}-no-friction", chain=replace(entry.chain, friction=False)) for entry in shared
    ]
    chosen = [*shared, *smooth]
    heading("test", "condition between joints", "full model, error", "block-diagonal model, error")
    for scenario, log in zip(chosen, simulate(chosen), strict=True):
        inputs = settled_inputs(log.commanded, scenario)
        full, diagonal = errors(log, true)
        row(scenario.name, f"{inputs.condition if inputs else np.nan:.3g}", f"{full:.3f}", f"{diagonal:.3f}")


if __name__ == "__main__":
    main()
