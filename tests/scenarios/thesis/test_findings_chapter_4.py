"""Findings F8 to F13 follow from numbers."""

from dataclasses import replace

import numpy as np
import pytest

from scenarios.files.errors import MissingRecordError
from scenarios.thesis import findings_chapter_4 as chapter
from scenarios.thesis.estimates import Fits
from scenarios.truth.published import EQUATIONS


def with_sets(study, change):
    sets = {joint: replace(study.data_sets[joint], models=models) for joint, models in change.items()}
    return replace(study, data_sets={**study.data_sets, **sets})


def tipped(sets, *methods):
    """Every model stable, but one of each of these methods, from a file that excites enough."""
    out, done = [], set()
    for model in sets.models:
        method = model.method
        enough = model.record in sets.single and (sets.excited[model.record].file or 0) >= model.needed
        if method in methods and method not in done and enough:
            done.add(method)
            out.append(replace(model, radius=1.2))
        else:
            out.append(replace(model, radius=0.9))
    return tuple(out)


def test_consistency_asks_for_stable_models_and_responses_that_agree(study):
    every = study.data_sets.items()
    both = chapter.consistency(with_sets(study, {joint: tipped(sets, "arx", "iv4") for joint, sets in every}))
    assert both.verdict == "reproduced"
    one = chapter.consistency(with_sets(study, {joint: tipped(sets, "iv4") for joint, sets in every}))
    assert one.verdict in ("partly", "reproduced")
    assert "1 IV4" in one.why
    kept = chapter.consistency(with_sets(study, {joint: tipped(sets, "iv4", "oe") for joint, sets in every}))
    assert kept.verdict == "not reproduced", "where OE is unstable too, it is no better"
    assert all(value > 0 for value in one.value.values())


def test_consistency_does_not_depend_on_what_only_a_thorough_study_has(study):
    less = with_sets(
        study,
        {
            joint: tuple(model for model in sets.models if model.record in sets.single)
            for joint, sets in study.data_sets.items()
        },
    )
    for finding in (chapter.consistency, chapter.stable, chapter.shoulder_oe, chapter.elbow_armax):
        assert finding(less) == finding(study)


def test_consistency_without_models_cannot_be_told(study):
    with pytest.raises(MissingRecordError, match="fewer than two"):
        chapter.consistency(with_sets(study, {"elbow_pitch": ()}))


def test_the_printed_model_sets_what_is_near():
    assert chapter.nearest(EQUATIONS["4.7"].model) == pytest.approx(0.085, abs=1e-3)
    assert chapter.nearest(EQUATIONS["4.8"].model) > 1.0


def test_more_poles_that_stay_stable_are_no_reproduction(study):
    calm = tuple(replace(row, radius=0.9, free_radius=0.9) for row in study.more_poles)
    one = (calm[0], replace(calm[1], free_radius=1.01), *calm[2:])
    half = (calm[0], *(replace(row, free_radius=1.01) for row in calm[1:5]), *calm[5:])
    wild = (*half[:5], replace(calm[5], radius=0.99995), *calm[6:])
    assert len(calm) == 9
    for few in (calm, one, half):
        assert chapter.yaw_oe(replace(study, more_poles=few)).verdict == "partly", "not the most of them"
    decided = chapter.yaw_oe(replace(study, more_poles=wild))
    assert decided.verdict == "reproduced"
    assert "5 of 8 structures" in decided.why
    assert "1 zero(s) and 3 poles" in decided.why
    control = (replace(calm[0], free_radius=1.01), *wild[1:])
    assert chapter.yaw_oe(replace(study, more_poles=control)).verdict == "partly", (
        "where the thesis' own orders turn unstable too, more poles are not the reason"
    )


def with_fits(study, joint, method, percent):
    """The study with one method's model from the estimation test following every test by so much."""
    own = f"siso-5-{joint}"
    models = tuple(
        replace(m, fits={name: Fits(percent, percent) for name in m.fits})
        if (m.record, m.method) == (own, method)
        else m
        for m in study.data_sets[joint].models
    )
    return with_sets(study, {joint: models})


def test_best_is_ahead_by_more_than_a_tie(study):
    level = with_fits(study, "elbow_pitch", "oe", 90.0)
    for lead, verdict, message in ((5.0, "reproduced", "−5.00"), (0.1, "partly", "−0.10"), (-5.0, "partly", "+5.00")):
        decided = chapter.elbow_armax(with_fits(level, "elbow_pitch", "armax", 90.0 + lead))
        assert decided.verdict == verdict, "ARMAX has a C and is whiter than OE"
        assert f"OE is {message} points from it" in decided.why
    level = with_fits(study, "shoulder_pitch", "armax", 90.0)
    ahead, tied = (chapter.shoulder_oe(with_fits(level, "shoulder_pitch", "oe", fit)) for fit in (95.0, 90.1))
    independent = bool(study.joints["shoulder_pitch"].models["oe"].residual_test.independent[0, 0])
    assert ahead.verdict == ("reproduced" if independent else "partly")
    assert tied.verdict == ("partly" if independent else "not reproduced")


def test_an_unstable_model_loses_and_is_told(study):
    for joint, finding in (("shoulder_pitch", chapter.shoulder_oe), ("elbow_pitch", chapter.elbow_armax)):
        models = tuple(
            replace(m, radius=1.2) if m.record == f"siso-5-{joint}" and m.method == "armax" else m
            for m in study.data_sets[joint].models
        )
        tipped_over = with_sets(study, {joint: models})
        decided = finding(tipped_over)
        assert "ARMAX is unstable" in decided.why
        assert "ARMAX" not in decided.value
    assert chapter.elbow_armax(tipped_over).verdict == "partly", "whiter, not better"


def test_what_the_thesis_does_not_show_is_beside_the_verdict(study):
    every = study.data_sets.items()
    aside = chapter.stable(with_sets(study, {joint: tipped(sets, "arx", "iv4") for joint, sets in every}))
    assert aside.verdict == "reproduced by construction"
    assert aside.value["unstable ARX and IV4"] == 6
    shown = chapter.stable(with_sets(study, {joint: tipped(sets, "armax") for joint, sets in every}))
    assert shown.verdict == "partly"


def test_a_file_of_two_tones_does_not_decide_on_models_that_need_more(study):
    """The yaw ARMAX has eight parameters from input to output, a file of two tones excites four."""
    sets = study.data_sets["shoulder_yaw"]
    for number, verdict in ((3, "reproduced by construction"), (7, "partly")):
        models = tuple(
            replace(m, radius=1.008)
            if (m.record, m.method) == (f"siso-{number}-shoulder_yaw", "armax")
            else replace(m, radius=0.9)
            for m in sets.models
        )
        calm = {
            joint: tuple(replace(m, radius=0.9) for m in study.data_sets[joint].models)
            for joint in ("shoulder_pitch", "elbow_pitch")
        }
        decided = chapter.stable(with_sets(study, {"shoulder_yaw": models, **calm}))
        assert decided.verdict == verdict
        assert f"ARMAX from siso-{number}-shoulder_yaw" in decided.why
        assert decided.value["unstable ARMAX, OE and OKID"] == (number == 7)
        assert decided.value["unstable ARMAX, OE and OKID, too little excitation"] == (number == 3)


FITS = {"ARMAX": 97.60, "OE": 97.55, "ARX": 96.9, "IV4": 97.61}


def test_a_small_lead_is_a_tie_and_wins_nothing():
    assert not chapter.best(FITS, "ARMAX", "OE")
    assert not chapter.best(FITS, "OE", "ARMAX")
    assert "OE is −0.05 points from it, ARX is −0.70 points from it" in chapter.comparison_text(FITS, "ARMAX")
    ahead = {**FITS, "OE": 97.2}
    assert chapter.best(ahead, "ARMAX", "OE")
    assert not chapter.best(ahead, "OE", "ARMAX")


def test_an_unstable_model_is_worse_than_any_and_two_are_level():
    one, two = {**FITS, "ARMAX": -np.inf}, {**FITS, "ARMAX": -np.inf, "OE": -np.inf}
    assert chapter.best(one, "OE", "ARMAX")
    assert not chapter.best(two, "OE", "ARMAX")
    assert not chapter.best(two, "ARMAX", "OE")
    assert chapter.comparison_text(one, "ARMAX").startswith("ARMAX is unstable on the tests not seen")
