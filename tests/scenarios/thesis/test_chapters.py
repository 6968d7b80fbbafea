"""Variables of the report's sections on the chapters of the thesis."""

import numpy as np
import pytest

from hmtb_twin import JOINTS
from scenarios.experiments.campaign import RPCM
from scenarios.experiments.log_review import SETTLING
from scenarios.identification.recovered_bandwidth import near_1_hz
from scenarios.thesis.chapters import chapter_6, printed_row, realisation
from scenarios.truth.published import BY_NAME


def test_realisation_is_laid_beside_the_print(study):
    for entry in study.joints.values():
        rows = {name for name, *_ in realisation(entry)}
        assert {"A", "B", "C", "D", "G", "poles", "zeros"} <= rows
    yaw = {name: printed for name, _, printed in realisation(study.joints["shoulder_yaw"])}
    assert yaw["G"] == "-276.41 -123.2"
    assert yaw["A"] == "0.99487 0.02896; -0.15355 0.55941"
    assert yaw["described by two states, %"] == "99.8691"


def test_printed_models_are_simulated_on_our_inputs(study):
    rows = {name: printed_row(study, BY_NAME[name], ("mimo-10", "rpcm")) for name in ("4.10", "5.9", "4.7")}
    for name, row in rows.items():
        assert set(row.singles) == set(range(1, 9))
        assert set(row.several) == {"mimo-10", "rpcm"}
        assert all(np.isfinite((fit.simulation, fit.one_step)).all() for fit in row.singles.values())
        assert near_1_hz(row.printed.bandwidth_hz) == (name == "4.10")
        assert np.all(np.abs(np.roots(row.printed.noise_polynomial)) < 1.0)
    # Without an observer the prediction is the simulation; with one it is better whatever the dynamics.
    oe, okid = rows["4.10"].singles[5], rows["5.9"].singles[5]
    assert oe.one_step == pytest.approx(oe.simulation)
    assert okid.one_step > okid.simulation + 5.0


def test_the_arm_goes_far_from_the_operating_point_with_the_unit_part_of_the_time(study):
    log, exchange = study.campaign.log(RPCM), chapter_6(study)["exchange"]
    yaw = JOINTS.index("shoulder_yaw")
    settled = log.true_angles[round(SETTLING / log.dt) :, yaw]
    away = np.degrees(np.abs(settled - study.truth.angles[yaw]).max())
    assert exchange["away"]["shoulder_yaw"] == pytest.approx(away)
    assert max(exchange["away"].values()) > 10.0
    assert 0.0 < exchange["loaded"] < 100.0
