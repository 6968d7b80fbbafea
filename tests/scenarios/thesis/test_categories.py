"""The seven categories, and who is ahead."""

from dataclasses import replace

import numpy as np
import pytest

from scenarios.thesis.categories import Category, Measure, categories
from tests.scenarios.thesis.altered import with_model

NAMES = [
    "frequency bandwidth",
    "model stability",
    "flexibility",
    "parsimony",
    "robustness",
    "RPCM fit",
    "MIMO data fits",
]


def test_all_seven_have_numbers_for_both_models(study):
    ranked = categories(study)
    assert [entry.name for entry in ranked] == NAMES
    for entry in ranked:
        assert entry.measures, entry.name
        assert entry.thesis
        for measure in entry.measures:
            assert {"SysID model", "OKID model"} <= set(measure.values)
            assert measure.ahead in {"SysID", "OKID", "neither"}
            assert measure.text("SysID model") != "–"


def test_the_category_says_when_its_measures_disagree():
    one, other = (Measure("x", {"SysID model": 1.0, "OKID model": 0.5}, more) for more in (True, False))
    assert Category("c", "SysID", (one, one)).ahead == "SysID"
    assert Category("c", "SysID", (one, other)).ahead == "depends on the measure"
    assert Category("c", "SysID", ()).ahead == "not tried"
    assert one.text("SysID model") == "1.0"
    assert one.text("hybrid model") == "–"


def test_an_unstable_model_is_behind(study):
    okid = study.multivariable.model("OKID")
    assert categories(study)[1].ahead == "neither"
    unstable = replace(okid.model, A=okid.model.A * (1.01 / okid.largest_pole))
    assert categories(with_model(study, "OKID", model=unstable))[1].ahead == "SysID"


def test_a_tie_of_fits_is_nobodys(study):
    own, okid = study.multivariable.pair()
    equal = {entry.name: entry for entry in categories(with_model(study, "OKID", fits=own.fits))}
    assert equal["RPCM fit"].ahead == "neither"
    assert all(sum(m.values[e.name] for e in (own, okid)) == 0.0 for m in equal["MIMO data fits"].measures)


def test_measures_are_what_they_say(study):
    by_name = {entry.name: entry.measures for entry in categories(study)}
    own, okid = study.multivariable.pair()
    assert by_name["parsimony"][0].values["OKID model"] == 6.0
    assert by_name["parsimony"][0].values["SysID model"] == 10.0
    assert by_name["RPCM fit"][0].values["OKID model"] == pytest.approx(okid.fit("rpcm").mean("simulation"))
    for measure in by_name["MIMO data fits"]:
        assert measure.values["SysID model"] + measure.values["OKID model"] <= 11.0, "no record of the same sequence"
    off = [abs(entry.chosen.bandwidth_hz / entry.best_linear.hz - 1) for entry in study.joints.values()]
    assert by_name["frequency bandwidth"][0].values["SysID model"] == pytest.approx(100 * np.mean(off))
    assert own.largest_pole == by_name["model stability"][0].values["SysID model"]
