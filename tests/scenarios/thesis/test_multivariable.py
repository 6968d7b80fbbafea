"""The three-joint models on records of several joints."""

from dataclasses import replace

import numpy as np
import pytest

import sysid
from hmtb_twin import JOINTS, STUDIED_JOINTS
from scenarios.experiments.campaign import RPCM
from scenarios.experiments.joint_inputs import LIMIT
from scenarios.files.errors import MissingRecordError
from scenarios.thesis.multivariable import (
    ALONE,
    INDEPENDENT,
    METHODS,
    RECORDS,
    SHARED,
    TESTED,
    WAYS,
    multivariable,
    off_diagonal,
    pushed_by_others,
    relative_error,
    three_joint_truth,
)
from scenarios.truth.published import published_model
from sysid import StateSpace


def test_identified_and_printed_models_are_peers(study):
    matrix_models = study.multivariable
    assert [entry.name for entry in matrix_models.models] == [
        "SysID model",
        "OKID model",
        "hybrid model",
        "printed SysID model",
        "printed OKID model",
        "printed hybrid model",
    ]
    assert matrix_models.records == RECORDS
    for entry in matrix_models.models:
        assert tuple(entry.fits) == RECORDS
        assert set(entry.residual_tests) == set(TESTED)
    for kind in ("SysID", "OKID", "hybrid"):
        printed = published_model(kind.lower()).model
        entry = matrix_models.model(kind, printed=True)
        f = np.geomspace(0.1, 20.0, 20)
        np.testing.assert_allclose(entry.model.frequency_response(f), printed.frequency_response(f))
        assert entry.largest_pole == pytest.approx(np.abs(printed.poles()).max())


def test_the_twin_is_not_the_arm_of_the_thesis(study):
    for entry in study.multivariable.models:
        assert (entry.error > 0.3) == entry.printed
        assert entry.largest_pole < 1.0


@pytest.mark.parametrize("record", ["mimo-12", RPCM])
def test_fits_of_the_blocks_are_those_of_the_whole(study, record):
    data = study.campaign.several(record)
    for entry in study.multivariable.models:
        (whole,) = sysid.compare(entry.model, data)
        for way, values in zip(WAYS, (whole.simulation, whole.one_step), strict=True):
            np.testing.assert_allclose(list(entry.fit(record).of(way).values()), values, atol=1e-3)
            assert entry.fit(record).mean(way) == pytest.approx(np.mean(values), abs=1e-3)


def test_the_hybrid_has_the_yaw_of_one_and_the_pitches_of_the_other(study):
    own, okid = study.multivariable.pair()
    hybrid = study.multivariable.model("hybrid")
    yaw, *pitches = STUDIED_JOINTS
    for record in RECORDS:
        for way in WAYS:
            mixed = hybrid.fit(record).of(way)
            assert mixed[yaw] == own.fit(record).of(way)[yaw]
            assert [mixed[joint] for joint in pitches] == [okid.fit(record).of(way)[joint] for joint in pitches]


def test_without_a_noise_model_one_step_ahead_is_simulation(study):
    for printed in (False, True):
        own, okid = study.multivariable.pair(printed=printed)
        assert [own.predicts(joint) for joint in STUDIED_JOINTS] == [True, False, True]
        assert all(okid.predicts(joint) for joint in STUDIED_JOINTS)
        for record in RECORDS:
            fits = own.fit(record)
            assert fits.simulation["shoulder_pitch"] == fits.one_step["shoulder_pitch"]
            assert fits.simulation["shoulder_yaw"] != fits.one_step["shoulder_yaw"]


def test_a_record_that_is_not_there_is_named(study):
    entry = study.multivariable.model("OKID")
    poor = replace(entry, fits={}, residual_tests={})
    for ask in (poor.fit, poor.residual_test):
        with pytest.raises(MissingRecordError, match="rpcm"):
            ask(RPCM)


def test_a_predictor_that_grows_without_bound_leaves_nothing_to_test(study):
    blocks = dict(study.multivariable.model("OKID").blocks)
    yaw = blocks["shoulder_yaw"]
    blocks["shoulder_yaw"] = replace(yaw, A=3.0 * yaw.A, K=0.0 * yaw.gain)
    with np.errstate(all="ignore"):
        matrix_models = multivariable(blocks, blocks, study.campaign).model("OKID")
    assert not np.isfinite(matrix_models.fit(RPCM).simulation["shoulder_yaw"])
    assert np.isfinite(matrix_models.fit(RPCM).simulation["elbow_pitch"])
    with pytest.raises(MissingRecordError, match="not finite"):
        matrix_models.residual_test(RPCM)


def _gains(D):
    n = len(D)
    return StateSpace(np.zeros((0, 0)), np.zeros((0, n)), np.zeros((n, 0)), np.array(D), None, 0.02)


def _one_pole(pole):
    return StateSpace(np.array([[pole]]), np.array([[1 - pole]]), np.ones((1, 1)), np.zeros((1, 1)), None, 0.02)


def test_the_truth_is_the_part_of_the_whole_arm(study):
    chosen = [JOINTS.index(joint) for joint in STUDIED_JOINTS]
    f = np.array([0.3, 1.0, 6.0])
    whole = study.truth.model.frequency_response(f)[:, chosen][:, :, chosen]
    np.testing.assert_allclose(three_joint_truth(study.truth).frequency_response(f), whole)


def test_what_lies_off_the_diagonal():
    assert off_diagonal(_gains([[1.0, 0.0], [0.0, 2.0]])) == 0.0
    assert off_diagonal(_gains([[4.0, 3.0], [0.0, 0.0]])) == pytest.approx(0.6)


def test_errors_of_all_channels_and_of_the_diagonal():
    true, estimate = _gains([[3.0, 0.0], [0.0, 4.0]]), _gains([[3.0, 1.0], [0.0, 2.0]])
    assert relative_error(estimate, true) == pytest.approx(np.sqrt(5.0) / 5.0)
    assert relative_error(estimate, true, diagonal=True) == pytest.approx(0.4)


def test_the_band_decides_what_counts():
    slow, fast = _one_pole(0.99), _one_pole(0.5)
    assert relative_error(slow, fast, band=(0.01, 0.02)) < 0.2 < 0.8 < relative_error(slow, fast, band=(2.0, 10.0))


def test_the_pushes_of_both_other_joints_are_added_up():
    model = _gains([[1.0, 0.0, 0.0], [0.1, 2.0, -0.3], [0.0, 0.5, 1.0]])
    shares = pushed_by_others(model, band=(0.1, 10.0))
    assert list(shares.values()) == pytest.approx([0.0, 0.2, 0.5])


def test_independent_waveforms_find_what_a_shared_one_cannot(study):
    matrix_models = {(entry.record, entry.method): entry for entry in study.multivariable.full}
    assert set(matrix_models) == {(record, method) for record in (SHARED, INDEPENDENT) for method in METHODS}
    for method in METHODS:
        shared, independent = matrix_models[SHARED, method], matrix_models[INDEPENDENT, method]
        assert shared.condition > LIMIT > independent.condition
        if method == ALONE:
            assert shared.coupling == independent.coupling == 0.0
            assert shared.error < 2 * independent.error
        else:
            assert shared.error > independent.error
