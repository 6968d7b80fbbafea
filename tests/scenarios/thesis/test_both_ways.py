"""A verdict on fits says when it depends on the kind of fit."""

from scenarios.thesis.both_ways import both_ways, readings, without_noise_model
from scenarios.thesis.comparison import Comparison


def test_the_same_both_ways() -> None:
    decision, said = both_ways({"simulation": 3, "one_step": 3}, 3)
    assert decision == "reproduced"
    assert "does not depend" in said
    assert both_ways({"simulation": 1, "one_step": 2}, 3)[0] == "partly"
    assert both_ways({"simulation": 0, "one_step": 0}, 3)[0] == "not reproduced"


def test_a_verdict_that_depends_on_the_way_is_partly_and_says_so() -> None:
    decision, said = both_ways({"simulation": 0, "one_step": 3}, 3)
    assert decision == "partly"
    assert "depends on which" in said
    assert "not reproduced in simulation, reproduced one step ahead" in said


def test_joints_that_cannot_predict_are_named(study: Comparison) -> None:
    own, okid = study.multivariable.pair()
    assert "K = 0 on shoulder pitch" in without_noise_model(own)
    assert without_noise_model(okid) == "every joint of the OKID model has a noise model"


def test_readings_that_disagree_are_partly_and_each_is_named() -> None:
    decision, said = readings({"as one thing": "reproduced", "as another": "not reproduced"})
    assert decision == "partly"
    assert "reproduced as one thing, not reproduced as another" in said
    same, said = readings({"as one thing": "not reproduced", "as another": "not reproduced"})
    assert same == "not reproduced"
    assert "does not depend" in said
