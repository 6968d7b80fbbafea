"""Registered scenarios: both tables, by name and by tag."""

from scenarios import load, names
from tests.refusals import refused


def test_table_1_is_there_for_every_joint_and_by_tag():
    joints = ("shoulder_yaw", "shoulder_pitch", "elbow_pitch")
    expected = {f"siso-{number}-{joint}" for number in range(1, 9) for joint in joints}
    assert set(names("table1")) == set(names("thesis")) == expected
    peaks = [load(f"siso-{number}-elbow_pitch").excitation[0].parameters["amplitude"] for number in range(1, 9)]
    assert peaks == [1, 1, 2, 1, 1, 2, 4, 1]
    for name in expected:
        scenario = load(name)
        assert scenario.duration == 240.0
        assert scenario.axes == (name.split("-", 2)[2],)
        assert scenario.volts().shape == (12_000, 1)
        assert (name in names("prbs")) == (scenario.excitation[0].kind == "prbs")
    assert {load(name).excitation[0].kind for name in names("prbs")} == {"prbs"}
    wrist = ("wrist_pitch", "wrist_yaw", "wrist_roll")
    others = {f"siso-{number}-{joint}" for number in range(1, 9) for joint in wrist}
    assert (set(names("other-joints")), set(names("siso"))) == (others, expected | others)
    assert len({load(name).seed for name in names("siso")}) == 48
    for name in others:
        assert load(name).excitation == load(name.replace(load(name).axes[0], "elbow_pitch")).excitation


# [Morris1996, table 2]
TABLE_2 = [
    ("sine", 1, {"frequency": 5.0}),
    ("sine", 2, {"frequency": 5.0}),
    ("sine", 2, {"frequency": 10.0}),
    ("two_sines", 1, {"frequency": 1.25}),
    ("two_sines", 2, {"frequency": 1.25}),
    ("two_sines", 2, {"frequency": 2.5}),
    ("prbs", 1, {}),
    ("prbs", 2, {}),
    ("bipolar_ramping_pulse", 4, {"frequency": 1.0, "pulse_width": 0.1, "growing": False}),
    ("chirp", 1, {"f_start": 0.0, "f_end": 1.0}),
    ("chirp", 1, {"f_start": 0.0, "f_end": 5.0}),
    ("chirp", 1, {"f_start": 5.0, "f_end": 10.0}),
    ("chirp", 1, {"f_start": 5.0, "f_end": 15.0}),
]


def test_table_2_is_there():
    assert names("table2") == tuple(f"mimo-{number}" for number in range(1, 14))
    for name, (kind, amplitude, parameters) in zip(names("table2"), TABLE_2, strict=True):
        scenario = load(name)
        (excitation,) = scenario.excitation
        assert (excitation.kind, excitation.parameters["amplitude"]) == (kind, amplitude)
        assert {key: excitation.parameters[key] for key in parameters} == parameters
        assert (scenario.mode, scenario.axes, scenario.duration) == ("cartesian", ("x", "y", "z"), 240.0)
        assert scenario.hand_controller.compensation == 0.95
        volts = scenario.volts()
        assert volts.shape == (12_000, 3)
        assert (volts == volts[:, :1]).all()


def test_independent_channels_have_three_different_waveforms():
    assert names("independent") == ("mimo-7-independent", "mimo-8-independent")
    for name in names("independent"):
        volts = load(name).volts()
        assert len({column.tobytes() for column in volts.T}) == 3
        assert volts.max() == load(name.removesuffix("-independent")).volts().max()


def test_a_saved_scenario_loads_and_unknown_names_say_what_there_is(tmp_path):
    path = tmp_path / "mine.toml"
    path.write_text(load("siso-5-shoulder_yaw").to_toml(), encoding="utf-8")
    assert load(path) == load(str(path)) == load("siso-5-shoulder_yaw")
    refused(r"did you mean 'siso-5-shoulder_yaw' or .* There are 70, listed by", load, "siso5-shoulder_yaw")
    refused("^unknown scenario 'x'; there are 70, listed by: hmtb scenarios list$", load, "x")
    refused("unknown tag 'siro'.*did you mean 'siso'", names, "siro")
    refused("cannot read scenario file", load, tmp_path / "missing.toml")
