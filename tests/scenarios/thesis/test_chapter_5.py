"""Chapter V on the page: the realisation beside the print, the printed models."""

import numpy as np
import pytest

from scenarios.thesis.chapter_5 import realisation
from scenarios.thesis.published_section import printed_row, several_records
from scenarios.truth.published import BY_NAME


def test_realisation_is_laid_beside_the_print(study):
    for joint, entry in study.joints.items():
        rows = {row.name: row for row in realisation(entry, study.observers[joint])}
        assert {"A", "B", "C", "D", "G", "poles", "zeros"} <= set(rows)
    yaw = {row.name: row for row in realisation(study.joints["shoulder_yaw"], study.observers["shoulder_yaw"])}
    assert yaw["G"].printed == "-276.41 -123.2"
    assert yaw["A"].printed == "0.99487 0.02896; -0.15355 0.55941"
    assert yaw["described by two states, %"].printed == "99.8691"


def test_printed_models_are_simulated_on_our_inputs(study):
    records = several_records(study, ("mimo-10", "mimo-99", "rpcm"))
    assert list(records) == ["mimo-10", "rpcm"]
    rows = {name: printed_row(study, BY_NAME[name], records) for name in ("4.10", "5.9", "4.7")}
    for name, row in rows.items():
        assert set(row.singles) == set(range(1, 9))
        assert set(row.several) == {"mimo-10", "rpcm"}
        assert all(np.isfinite((fit.simulation, fit.one_step)).all() for fit in row.singles.values())
        assert row.near == (name == "4.10")
        assert row.observer < 1.0
    # Without an observer the prediction is the simulation; with one it is better whatever the dynamics.
    oe, okid = rows["4.10"].singles[5], rows["5.9"].singles[5]
    assert oe.one_step == pytest.approx(oe.simulation)
    assert okid.one_step > okid.simulation + 5.0
