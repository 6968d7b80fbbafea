"""Held-out fits, and models that cannot predict."""

from dataclasses import replace
from statistics import median

import pytest

from scenarios.files.errors import MissingRecordError
from scenarios.thesis.verdicts import held_out_one_step, without_noise_model


def test_joints_that_cannot_predict_are_named(study):
    own, okid = study.multivariable.pair()
    assert "K = 0 on shoulder pitch" in without_noise_model(own)
    assert without_noise_model(okid) == "every joint of the OKID model has a noise model"


def test_tests_of_the_same_sequence_are_not_held_out(study):
    model = study.joints["elbow_pitch"].models["okid"]
    others = [model.fits[number] for number in (1, 2, 3, 4, 7, 8)]
    assert held_out_one_step(study, model) == median(fit.one_step for fit in others)


def test_without_a_test_there_is_no_fit(study):
    model = study.joints["elbow_pitch"].models["okid"]
    alone = replace(model, fits={number: model.fits[number] for number in (5, 6)})
    with pytest.raises(MissingRecordError, match="no test to be judged on"):
        held_out_one_step(study, alone)
