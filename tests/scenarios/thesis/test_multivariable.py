"""The three-joint models on records of several joints."""

from dataclasses import replace

import numpy as np
import pytest

import sysid
from hmtb_twin import STUDIED_JOINTS
from scenarios.experiments.campaign import RPCM
from scenarios.files.errors import MissingRecordError
from scenarios.thesis.multivariable import RECORDS, TESTED, WAYS, multivariable
from scenarios.truth.published import published_model


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
