"""Fits to tests not seen, and none where there is no such test."""

from dataclasses import replace
from statistics import median

import pytest

from scenarios.files.errors import MissingRecordError
from scenarios.thesis.comparison import Comparison
from scenarios.thesis.findings_chapter_5 import percent_described
from scenarios.thesis.verdicts import held_out, held_out_one_step


def test_tests_of_the_same_sequence_are_not_held_out(study: Comparison) -> None:
    model = study.joints["elbow_pitch"].models["okid"]
    others = [model.fits[number] for number in (1, 2, 3, 4, 7, 8)]
    assert held_out(study, model) == median(fit.simulation for fit in others)
    assert held_out_one_step(study, model) == median(fit.one_step for fit in others)


def test_without_a_test_there_is_no_fit(study: Comparison) -> None:
    entry = study.joints["elbow_pitch"]
    alone = {
        name: replace(model, fits={number: model.fits[number] for number in (5, 6)})
        for name, model in entry.models.items()
    }
    bare = replace(study, joints={**study.joints, "elbow_pitch": replace(entry, models=alone)})
    for fit in (held_out, held_out_one_step):
        with pytest.raises(MissingRecordError, match="no test to be judged on"):
            fit(bare, alone["okid"])
    found = percent_described(bare)
    assert found.verdict == percent_described(study).verdict, "it does not rest on these fits"
    assert "(no such test)" in found.why
