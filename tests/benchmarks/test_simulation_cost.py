"""What the campaign costs against the bare physics of its own model, side by side in one process, one thread each."""

from dataclasses import replace
from statistics import median
from time import process_time

import mujoco
import numpy as np

from hmtb_twin import load_arm, simulate
from scenarios import load, names

SECONDS = 10.0
ROUNDS = 7


def test_campaign_costs_little_more_than_bare_steps():
    campaign = [replace(load(name), duration=SECONDS) for name in names(tag="table1")]
    arm = load_arm()
    simulate(campaign[:1])
    ratios = []
    for _ in range(ROUNDS):
        started = process_time()
        logs = simulate(campaign, threads=1)
        ours = process_time() - started
        data = arm.rest(arm.pose("rpcm_holster_out_approach"))
        rest, push = data.ctrl.copy(), 0.02 * np.eye(arm.model.nu)[6]
        started = process_time()
        for k in range(len(campaign)):
            # The arm moves, as in the campaign.
            data.ctrl[:] = rest + (push if k % 2 else -push)
            mujoco.mj_step(arm.model, data, nstep=logs.steps // len(campaign))
        ratios.append(ours / (process_time() - started))
    print(f"\nsimulate / bare mj_step: median {median(ratios):.3f}, all {np.round(ratios, 3)}, {logs.steps} steps")
    assert median(ratios) <= 1.25
