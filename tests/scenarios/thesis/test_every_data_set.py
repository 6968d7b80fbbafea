"""Models from every data set."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from scenarios.experiments.campaign import single_joint_test
from scenarios.experiments.model_structures import STRUCTURES, every_structure
from scenarios.thesis.estimates import Fits
from scenarios.thesis.every_data_set import (
    DataSetModel,
    distances,
    every_data_set,
    excitation_needed,
)
from sysid import StateSpace

YAW = "shoulder_yaw"
METHODS = ["arx", "armax", "iv4", "oe", "okid"]


def test_structures_are_the_thesis_and_share_their_orders():
    for joint, own in STRUCTURES.items():
        models = every_structure(joint)
        assert [entry.method for entry in models] == METHODS
        na, nb, _, nk = next(entry.orders for entry in own if entry.method == "armax")
        assert {entry.orders for entry in models if entry.method in ("arx", "iv4")} == {(na, nb, nk)}
        assert excitation_needed(models[0]) == excitation_needed(models[1]) == na + nb


def test_every_record_and_structure_has_a_row(study):
    for joint, sets in study.data_sets.items():
        assert sets.single == tuple(single_joint_test(number, joint) for number in range(1, 9))
        rows = {(m.record, m.method) for m in sets.models}
        rows |= {(record, structure.method) for record, structure, _ in sets.refused}
        assert rows == {(record, method) for record in sets.excited for method in METHODS}
        assert {"mimo-1", "mimo-13", "mimo-7-independent", "rpcm"} <= set(sets.excited)


def test_a_file_of_two_tones_excites_four_and_the_velocity_limit_more(study):
    sets = study.data_sets[YAW]
    for number, order in ((1, 2), (2, 4), (3, 4), (4, 4)):
        assert sets.excited[single_joint_test(number, YAW)].file == order
    assert sets.excited["rpcm"].file is None
    assert sets.excited[single_joint_test(2, YAW)].command > 8
    first = sets.find(single_joint_test(1, YAW), "armax")
    assert not first.enough, "a sine excites fewer parameters than five poles and two zeros have"
    assert all(m.enough for m in sets.models if m.record == single_joint_test(5, YAW))


def test_the_estimation_test_gives_the_models_of_the_study(study):
    for joint, entry in study.joints.items():
        own = single_joint_test(study.estimation_test, joint)
        for method in ("armax", "oe", "okid"):
            outcome, known = study.data_sets[joint].find(own, method), entry.models[method]
            assert outcome.bandwidth_hz == known.bandwidth_hz
            assert outcome.own.simulation == pytest.approx(known.fits[5].simulation)
            assert outcome.others[single_joint_test(8, joint)].one_step == pytest.approx(known.fits[8].one_step)
            assert len(outcome.others) == 6, "its own record and that of the same sequence are not among them"


def test_a_record_that_cannot_be_used_is_told_with_its_reason(study):
    campaign, name = study.campaign, single_joint_test(3, YAW)
    log = campaign.logs[name]
    still = replace(log, commanded=np.full_like(log.commanded, 0.1))
    # the other records are not played
    logs = {single_joint_test(5, YAW): campaign.logs[single_joint_test(5, YAW)], name: still}
    spoiled = replace(campaign, logs=logs, failed={single_joint_test(4, YAW): "diverged"})
    models = every_data_set(YAW, spoiled)
    assert [(record, structure.method) for record, structure, _ in models.refused] == [(name, one) for one in METHODS]
    assert all("constant" in reason for *_, reason in models.refused)
    others = {single_joint_test(number, YAW): "it was not played" for number in (1, 2, 6, 7, 8)}
    assert models.missing == {**others, single_joint_test(4, YAW): "diverged"}
    assert [one.method for one in models.models] == METHODS


def _model(gain, pole):
    model = StateSpace([[pole]], [[gain * (1 - pole)]], [[1.0]], [[0.0]], None, 0.02)
    return DataSetModel(
        **vars(every_structure(YAW)[0]),
        estimate=SimpleNamespace(model=model),
        bandwidth_hz=1.0,
        ci95=(0.9, 1.1),
        dc_gain=gain,
        half_power_hz=1.0,
        radius=pole,
        residual_test=None,
        fits={"siso-1-shoulder_yaw": Fits(90.0, 95.0)},
        record="siso-1-shoulder_yaw",
        needed=2,
        enough=True,
    )


def test_distances_are_relative_and_zero_between_equals():
    assert distances((_model(1.0, 0.9), _model(1.0, 0.9))) == pytest.approx([0.0])
    assert sorted(distances(tuple(_model(gain, 0.9) for gain in (0.9, 1.0, 1.1)))) == pytest.approx([0.1, 0.1, 0.2])
    assert len(distances((_model(1.0, 0.9),))) == 0


def test_others_are_records_of_other_waveforms():
    fits = {single_joint_test(number, YAW): Fits(90.0 + number, 95.0) for number in range(1, 9)}
    of_prbs, of_sine = (replace(_model(1.0, 0.9), record=single_joint_test(n, YAW), fits=fits) for n in (6, 2))
    assert set(of_prbs.others) == {single_joint_test(number, YAW) for number in (1, 2, 3, 4, 7, 8)}
    assert set(of_sine.others) == {single_joint_test(number, YAW) for number in (1, 3, 4, 5, 6, 7, 8)}


def test_an_unstable_model_says_so():
    assert _model(1.0, 0.9).stable
    assert not _model(1.0, 1.1).stable
    assert _model(1.0, 0.9) != _model(1.0, 1.1)
    assert np.isnan(_model(1.0, 0.9).others_simulation)
