"""Findings F8 to F13 follow from numbers."""

from dataclasses import replace

import pytest

from scenarios.errors import MissingRecordError
from scenarios.published import YAW_ARMAX, YAW_OE
from scenarios.thesis import findings_chapter_4 as chapter
from scenarios.thesis.comparison import Comparison
from scenarios.thesis.every_data_set import DataSetModel, DataSets

JOINTS = ("shoulder_yaw", "shoulder_pitch", "elbow_pitch")


def changed(study: Comparison, joint: str, **fields: object) -> Comparison:
    entries = dict(study.prediction_errors)
    entries[joint] = replace(entries[joint], **fields)  # type: ignore[arg-type]
    return replace(study, prediction_errors=entries)


def with_sets(study: Comparison, change: "dict[str, tuple[DataSetModel, ...]]") -> Comparison:
    for joint, models in change.items():
        study = changed(study, joint, data_sets=replace(study.data_sets[joint], models=models))
    return study


def tipped(sets: DataSets, *methods: str) -> tuple[DataSetModel, ...]:
    """Every model stable, but one of each of these methods."""
    out, done = [], set()
    for model in sets.models:
        method = model.structure.method
        if method in methods and method not in done and model.record in sets.single and model.enough:
            done.add(method)
            out.append(replace(model, poles=(1.2 + 0j,)))
        else:
            out.append(replace(model, poles=(0.9 + 0j,)))
    return tuple(out)


def test_consistency_asks_for_stable_models_and_responses_that_agree(study: Comparison) -> None:
    every = study.data_sets.items()
    both = chapter.consistency(with_sets(study, {joint: tipped(sets, "arx", "iv4") for joint, sets in every}))
    assert both.verdict == "reproduced"
    one = chapter.consistency(with_sets(study, {joint: tipped(sets, "iv4") for joint, sets in every}))
    assert one.verdict in ("partly", "reproduced")
    assert "1 IV4" in one.why
    kept = chapter.consistency(with_sets(study, {joint: tipped(sets, "iv4", "oe") for joint, sets in every}))
    assert kept.verdict == "not reproduced", "where OE is unstable too, it is no better"
    assert isinstance(one.value, dict)
    assert all(value > 0 for value in one.value.values())


def test_consistency_does_not_depend_on_what_only_a_thorough_study_has(study: Comparison) -> None:
    less = with_sets(
        study,
        {
            joint: tuple(model for model in sets.models if model.record in sets.single)
            for joint, sets in study.data_sets.items()
        },
    )
    for finding in (chapter.consistency, chapter.stable, chapter.shoulder_oe, chapter.elbow_armax):
        assert finding(less) == finding(study)


def test_consistency_without_models_cannot_be_told(study: Comparison) -> None:
    with pytest.raises(MissingRecordError, match="fewer than two"):
        chapter.consistency(with_sets(study, {"elbow_pitch": ()}))


def test_the_printed_model_sets_what_is_near() -> None:
    assert chapter.nearest(YAW_ARMAX.model) == pytest.approx(0.085, abs=1e-3)
    assert chapter.nearest(YAW_OE.model) > 1.0


def test_more_poles_that_stay_stable_are_no_reproduction(study: Comparison) -> None:
    entry = study.prediction_errors["shoulder_yaw"]
    calm = tuple(replace(row, radius=0.9, free_radius=0.9) for row in entry.more_poles)
    wild = (calm[0], replace(calm[1], free_radius=1.01), *calm[2:])
    assert chapter.yaw_oe(changed(study, "shoulder_yaw", more_poles=calm)).verdict == "partly"
    found = chapter.yaw_oe(changed(study, "shoulder_yaw", more_poles=wild))
    assert found.verdict == "reproduced"
    assert "1 zero(s) and 3 poles" in found.why
    control = (replace(calm[0], free_radius=1.01), *wild[1:])
    assert chapter.yaw_oe(changed(study, "shoulder_yaw", more_poles=control)).verdict == "partly", (
        "where the thesis' own orders turn unstable too, more poles are not the reason"
    )


def test_best_is_what_follows_the_tests_not_seen(study: Comparison) -> None:
    fits = chapter.flexible(study, "elbow_pitch")
    assert {"ARMAX", "OE"} <= set(fits)
    found = chapter.elbow_armax(study)
    better = fits["ARMAX"] > fits["OE"]
    assert found.verdict == ("reproduced" if better else "partly"), "ARMAX has a C and is whiter than OE"
    assert "points better" in found.why if better else "points worse" in found.why


def test_what_the_thesis_does_not_show_is_beside_the_verdict(study: Comparison) -> None:
    every = study.data_sets.items()
    aside = chapter.stable(with_sets(study, {joint: tipped(sets, "arx", "iv4") for joint, sets in every}))
    assert aside.verdict == "reproduced"
    assert isinstance(aside.value, dict)
    assert aside.value["unstable ARX and IV4"] == 6
    shown = chapter.stable(with_sets(study, {joint: tipped(sets, "armax") for joint, sets in every}))
    assert shown.verdict == "partly"
