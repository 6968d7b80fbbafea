"""Sets of records, and what of them no model without coupling can follow."""

from dataclasses import replace

import pytest

from scenarios.files.errors import MissingRecordError
from scenarios.thesis.multivariable import WAYS
from scenarios.thesis.record_fits import (
    fits_to_records,
    held_out_fit,
    held_out_records,
    missing_fit_shares,
    ties,
    within_reach,
)
from scenarios.thesis.reference_fits import COUPLED, DIAGONAL
from scenarios.thesis.verdicts import MARGIN, ahead, tied
from tests.scenarios.thesis.altered import without_log

YAW = "shoulder_yaw"


@pytest.mark.parametrize("number", [5, 6])
def test_records_of_the_same_sequence_are_not_held_out(study, number):
    entry = study.joints[YAW]
    fits = {**entry.chosen.fits, number: replace(entry.chosen.fits[number], simulation=-1e9, one_step=-1e9)}
    models = {**entry.models, entry.chosen.method: replace(entry.chosen, fits=fits)}
    changed = replace(study, joints={**study.joints, YAW: replace(entry, models=models)})
    for way in WAYS:
        assert held_out_fit(changed, "SysID", YAW, way) == held_out_fit(study, "SysID", YAW, way)
    single, several = held_out_records(study, YAW)
    assert number not in tuple(single)
    assert not [name for name in several if name.startswith(("mimo-7", "mimo-8"))]


def test_without_records_nothing_is_held_out(study):
    joints = {name: replace(entry, data={5: entry.data[5]}) for name, entry in study.joints.items()}
    poor = replace(study, joints=joints, multivariable=replace(study.multivariable, records=("mimo-7",)))
    with pytest.raises(MissingRecordError, match="no record of shoulder_yaw is left"):
        held_out_fit(poor, "OKID", YAW, "simulation")


def test_a_missing_single_joint_test_is_not_passed_over(study):
    entry = study.joints[YAW]
    models = {
        key: replace(model, fits={n: fit for n, fit in model.fits.items() if n != 2})
        for key, model in entry.models.items()
    }
    poor = without_log(study, f"siso-2-{YAW}", "the physics diverged")
    poor = replace(poor, joints={**study.joints, YAW: replace(entry, models=models)})
    with pytest.raises(MissingRecordError, match="siso-2-shoulder_yaw: the physics diverged"):
        fits_to_records(poor, "OKID", YAW, ((1, 2), ()), "simulation")
    assert list(fits_to_records(poor, "OKID", YAW, ((1,), ("mimo-1",)), "simulation")) == ["siso-1", "mimo-1"]


@pytest.mark.parametrize("record", ["mimo-1", "siso-3"])
def test_the_shares_of_what_is_missing_add_up(study, record):
    for joint in study.joints:
        shares = missing_fit_shares(study, joint, record, 60.0)
        assert sum(shares.values()) == pytest.approx(40.0)
        assert shares["the noise of reading"] > 0.0
        if record.startswith("siso"):
            assert shares["coupling"] == pytest.approx(0.0, abs=0.1), "only this joint is commanded"
    assert missing_fit_shares(study, "shoulder_pitch", "mimo-1", 60.0)["coupling"] > 10.0


def test_ties_are_named():
    assert ties({"shoulder_yaw, one step": 0.1, "elbow": -0.3}) == "tied: shoulder yaw, one step"
    assert ties({"elbow": 0.2}) == "nothing is tied"


def test_what_coupling_costs_is_said_beside_what_models_differ_by(study):
    comparison_word = within_reach(study, ("mimo-12",))
    assert comparison_word.startswith("On mimo-12 the best linear truth of each joint under the PRBS follows")
    alone, whole = (study.multivariable.reference(kind, "mimo-12")["elbow_pitch"] for kind in (DIAGONAL, COUPLED))
    assert f"coupling, which neither model has, is worth up to {whole - alone:.1f} points" in comparison_word
    assert "In the median" in within_reach(study, ("mimo-12", "mimo-13"))


@pytest.mark.parametrize(
    ("difference", "word"),
    [(0.006, "tied"), (-0.19, "tied"), (0.21, "ahead"), (-0.21, "behind"), (MARGIN, "ahead"), (-MARGIN, "behind")],
)
def test_a_small_difference_is_a_tie(difference, word):
    assert tied(difference) == (word == "tied")
    assert ahead(difference) == (word == "ahead")
