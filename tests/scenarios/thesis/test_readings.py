"""One verdict for each reading of a claim."""

from scenarios.thesis.readings import by_reading


def test_readings_that_agree_give_their_verdict() -> None:
    decision, said = by_reading({"one way": (3, 3), "another way": (2, 2)})
    assert decision == "reproduced"
    assert "reproduced one way (3 of 3 parts), reproduced another way (2 of 2 parts)" in said
    assert "the same by every reading" in said
    assert by_reading({"one way": (0, 3), "another way": (0, 3)})[0] == "not reproduced"
    assert by_reading({"one way": (1, 3), "another way": (2, 3)})[0] == "partly"


def test_readings_that_do_not_agree_are_partly_and_said_so() -> None:
    decision, said = by_reading({"one way": (3, 3), "another way": (0, 3)})
    assert decision == "partly"
    assert "reproduced one way (3 of 3 parts), not reproduced another way (0 of 3 parts)" in said
    assert "depends on the reading" in said
