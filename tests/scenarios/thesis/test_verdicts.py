"""A verdict says when it depends on the kind of fit or on the reading of a claim."""

import pytest

from scenarios.thesis.comparison import Comparison
from scenarios.thesis.verdicts import verdict_by_reading, verdict_by_way, verdict_of_readings, without_noise_model


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
def test_a_verdict_on_fits_is_given_both_ways(simulation: int, one_step: int, decision: str, text: str) -> None:
    verdict, said = verdict_by_way({"simulation": simulation, "one_step": one_step}, 3)
    assert verdict == decision
    assert text in said


def test_joints_that_cannot_predict_are_named(study: Comparison) -> None:
    own, okid = study.multivariable.pair()
    assert "K = 0 on shoulder pitch" in without_noise_model(own)
    assert without_noise_model(okid) == "every joint of the OKID model has a noise model"


def test_readings_that_disagree_are_partly_and_each_is_named() -> None:
    assert verdict_of_readings({"as one thing": "reproduced", "as another": "not reproduced"}) == (
        "partly",
        "reproduced as one thing, not reproduced as another: the verdict depends on the reading",
    )
    assert (
        verdict_of_readings({"as one thing": "not reproduced", "as another": "not reproduced"})[0] == "not reproduced"
    )
    decision, said = verdict_by_reading({"one way": (3, 3), "another way": (0, 3)})
    assert decision == "partly"
    assert "reproduced one way (3 of 3 parts), not reproduced another way (0 of 3 parts)" in said
    assert "depends on the reading" in said


def test_readings_that_agree_give_their_verdict() -> None:
    decision, said = verdict_by_reading({"one way": (3, 3), "another way": (2, 2)})
    assert decision == "reproduced"
    assert said.endswith("reproduced another way (2 of 2 parts): the same by every reading")
    assert verdict_by_reading({"one way": (0, 3), "another way": (0, 3)})[0] == "not reproduced"
    assert verdict_by_reading({"one way": (1, 3), "another way": (2, 3)})[0] == "partly"
