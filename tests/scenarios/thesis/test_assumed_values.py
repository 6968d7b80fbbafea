"""What was put in from the thesis is told with the arm's own numbers."""

from hmtb_twin.parameters.values import HAND_CONTROLLER
from hmtb_twin.parameters.variants import ACTUATORS, SERVOS
from scenarios.thesis.chapters import assumed_values
from scenarios.thesis.finding import CLAIMS


def test_the_numbers_are_those_of_the_arm():
    servos, delays, friction, gain = assumed_values()
    slow = f"{SERVOS['shoulder_yaw'].slow_pole:g}".replace("-", "−")
    assert servos.what == f"slow pole of the servos: {slow} rad/s"
    assert delays.what == "bus delays of 0 to 1 samples"
    yaw, pitch = (
        f"{100 * ACTUATORS[name].coulomb_torque / ACTUATORS[name].rated_torque:g}"
        for name in ("shoulder_yaw", "shoulder_pitch")
    )
    assert f" {pitch} to {yaw} % of the greatest torque" in friction.what
    assert f"{HAND_CONTROLLER.gain:g} rad/V" in gain.what
    assert "limit of 25 deg/s" in gain.why


def test_findings_that_rest_on_it_are_marked(report):
    assert report.assumed_values.findings < set(CLAIMS)
    assert [entry.what for entry in assumed_values() if "F3" in entry.findings] == ["bus delays of 0 to 1 samples"]
