"""What was put in from the thesis is told with the arm's own numbers."""

from hmtb_twin.parameters.values import HAND_CONTROLLER, SERVOS
from scenarios.thesis.finding import CLAIMS
from scenarios.thesis.findings import findings
from scenarios.thesis.published_section import assumed_values, assumed_values_of


def test_the_numbers_are_those_of_the_arm():
    servos, delays, friction, gain = assumed_values()
    slow = f"{SERVOS['shoulder_yaw'].slow_pole:g}".replace("-", "−")
    assert f"a slow one at {slow} rad/s, fast ones at −36 to −80 rad/s" in servos.what
    assert delays.what == "bus delays of 0 to 1 samples"
    assert friction.what.startswith("seal friction: 1 %")
    assert f"{HAND_CONTROLLER.gain:g} rad/V" in gain.what
    assert "limit of 25 deg/s" in gain.why


def test_findings_that_rest_on_it_are_marked(study):
    decided = assumed_values_of(findings(study))
    assert set(decided) == {key for entry in assumed_values() for key in entry.findings}
    assert set(decided) < set(CLAIMS)
    assert [entry.what for entry in decided["F3"]] == ["bus delays of 0 to 1 samples"]
