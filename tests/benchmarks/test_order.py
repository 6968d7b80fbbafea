"""How the sufficient orders were chosen: by the Bayesian information criterion, without a look at the truth."""

from dataclasses import replace
from itertools import product

import numpy as np

import sysid
from hmtb_twin import STUDIED_JOINTS, simulate
from scenarios import load
from scenarios.experiments.campaign import Condition
from scenarios.experiments.log_review import prepared
from scenarios.experiments.model_structures import SUFFICIENT
from scenarios.thesis.attribution import scaled

GRID = tuple(product(range(1, 7), range(1, 6)))


def test_information_criterion_chooses_the_sufficient_orders():
    linear = {joint: scaled(Condition(friction=False).applied(load(f"siso-5-{joint}"))) for joint in STUDIED_JOINTS}
    total = {joint: dict.fromkeys(GRID, 0.0) for joint in STUDIED_JOINTS}
    for log in simulate([replace(test, seed=seed) for test in linear.values() for seed in range(101, 106)]):
        (joint,) = log.axes
        data = prepared(log, joint)
        for nb, nf in GRID:
            residuals = sysid.oe(data, nb, nf, SUFFICIENT[joint][2]).residuals
            loss = len(data) * np.log(np.mean(residuals**2))
            total[joint][nb, nf] += loss + (nb + nf) * np.log(len(data))
    chosen = {}
    for joint, criterion in total.items():
        best = sorted(criterion, key=criterion.__getitem__)
        chosen[joint] = (*best[0], SUFFICIENT[joint][2])
        runners = ", ".join(f"{order} +{criterion[order] - criterion[best[0]]:.1f}" for order in best[1:4])
        print(f"\n{joint}: {best[0]}, then {runners}")
    assert chosen == SUFFICIENT
