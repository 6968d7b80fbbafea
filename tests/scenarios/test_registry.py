"""Registered scenarios: Table 1, by name and by tag."""

from pathlib import Path

import pytest

from scenarios import Excitation, Scenario, ScenarioError, load, names
from scenarios.registry import Registry, table1


def test_table_1_is_there() -> None:
    joints = ("shoulder_yaw", "shoulder_pitch", "elbow_pitch")
    expected = {f"siso-{number}-{joint}" for number in range(1, 9) for joint in joints}
    assert set(names("table1")) == expected
    assert len({load(name).seed for name in expected}) == 24
    for name in expected:
        scenario = load(name)
        assert scenario.duration == 240.0
        assert scenario.axes == (name.split("-", 2)[2],)
        assert scenario.volts().shape == (12_000, 1)


@pytest.mark.parametrize(("number", "peak"), [(1, 1), (2, 1), (3, 2), (4, 1), (5, 1), (6, 2), (7, 4), (8, 1)])
def test_amplitudes_of_table_1(number: int, peak: float) -> None:
    for excitation in load(f"siso-{number}-elbow_pitch").excitation:
        assert excitation.parameters["amplitude"] == peak


def test_printed_scenario_can_be_saved_and_loaded(tmp_path: Path) -> None:
    path = tmp_path / "mine.toml"
    path.write_text(load("siso-5-shoulder_yaw").to_toml(), encoding="utf-8")
    assert load(path) == load("siso-5-shoulder_yaw")
    assert load(str(path)) == load("siso-5-shoulder_yaw")


def test_duplicates_are_rejected() -> None:
    registry = Registry()
    scenario = Scenario("one", ("elbow_pitch",), (Excitation("prbs"),))
    registry.add(scenario)
    with pytest.raises(ScenarioError, match="'one' is already registered"):
        registry.add(scenario)


def test_unknown_names_say_what_there_is(tmp_path: Path) -> None:
    with pytest.raises(ScenarioError, match=r"did you mean 'siso-5-shoulder_yaw' or .* There are 24, listed by"):
        load("siso5-shoulder_yaw")
    with pytest.raises(ScenarioError, match=r"^unknown scenario 'x'; there are 24, listed by: hmtb scenarios list$"):
        load("x")
    with pytest.raises(ScenarioError, match=r"unknown tag 'siro'.*did you mean 'siso'"):
        names("siro")
    with pytest.raises(ScenarioError, match="cannot read scenario file"):
        load(tmp_path / "missing.toml")


def test_names_by_tag() -> None:
    assert set(names("prbs")) == {entry.name for entry in table1() if entry.excitation[0].kind == "prbs"}
    assert names() == tuple(dict.fromkeys(names()))
