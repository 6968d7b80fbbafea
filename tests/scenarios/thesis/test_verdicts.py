"""A verdict says when it depends on the kind of fit or on the reading of a claim."""

from dataclasses import replace
from statistics import median

import pytest

from scenarios.files.errors import MissingRecordError
from scenarios.thesis.findings_chapter_5 import percent_described
from scenarios.thesis.verdicts import (
    held_out,
    held_out_one_step,
    verdict_by_reading,
    verdict_by_way,
    verdict_of_readings,
    without_noise_model,
)


@pytest.mark.parametrize(
    ("simulation", "one_step", "decision", "text"),
    [
        (3, 3, "reproduced", "does not depend"),
        (0, 0, "not reproduced", "does not depend"),
        (1, 2, "partly", "does not depend"),
        (
            0,
            3,
            "partly",
            "depends on which of them the thesis means, not reproduced in simulation, reproduced one step",
        ),
    ],
)
def test_a_verdict_on_fits_is_given_both_ways(simulation, one_step, decision, text):
    verdict, reason = verdict_by_way({"simulation": simulation, "one_step": one_step}, 3)
    assert verdict == decision
    assert text in reason


def test_joints_that_cannot_predict_are_named(study):
    own, okid = study.multivariable.pair()
    assert "K = 0 on shoulder pitch" in without_noise_model(own)
    assert without_noise_model(okid) == "every joint of the OKID model has a noise model"


def test_readings_that_disagree_are_partly_and_each_is_named():
    assert verdict_of_readings({"as one thing": "reproduced", "as another": "not reproduced"}) == (
        "partly",
        "reproduced as one thing, not reproduced as another: the verdict depends on the reading",
    )
    assert (
        verdict_of_readings({"as one thing": "not reproduced", "as another": "not reproduced"})[0] == "not reproduced"
    )
    decision, reason = verdict_by_reading({"one way": (3, 3), "another way": (0, 3)})
    assert decision == "partly"
    assert "reproduced one way (3 of 3 parts), not reproduced another way (0 of 3 parts)" in reason
    assert "depends on the reading" in reason


def test_readings_that_agree_give_their_verdict():
    decision, reason = verdict_by_reading({"one way": (3, 3), "another way": (2, 2)})
    assert decision == "reproduced"
    assert reason.endswith("reproduced another way (2 of 2 parts): the same by every reading")
    assert verdict_by_reading({"one way": (0, 3), "another way": (0, 3)})[0] == "not reproduced"
    assert verdict_by_reading({"one way": (1, 3), "another way": (2, 3)})[0] == "partly"


def test_tests_of_the_same_sequence_are_not_held_out(study):
    model = study.joints["elbow_pitch"].models["okid"]
    others = [model.fits[number] for number in (1, 2, 3, 4, 7, 8)]
    assert held_out(study, model) == median(fit.simulation for fit in others)
    assert held_out_one_step(study, model) == median(fit.one_step for fit in others)


def test_without_a_test_there_is_no_fit(study):
    entry = study.joints["elbow_pitch"]
    alone = {
        name: replace(model, fits={number: model.fits[number] for number in (5, 6)})
        for name, model in entry.models.items()
    }
    bare = replace(study, joints={**study.joints, "elbow_pitch": replace(entry, models=alone)})
    for fit in (held_out, held_out_one_step):
        with pytest.raises(MissingRecordError, match="no test to be judged on"):
            fit(bare, alone["okid"])
    verdict = percent_described(bare)
    assert verdict.verdict == percent_described(study).verdict, "it does not rest on these fits"
    assert "(no such test)" in verdict.why
