"""What of a scenario `hmtb control` obeys: every field of it, in the runs and in the identification of the arm."""

from dataclasses import fields, replace

import pytest

import scenarios
from hmtb_twin import Chain, HandController, PayloadChange, Plant, Specimen
from scenarios.commands.control import MULTISINE, _tested
from scenarios.control import runs
from scenarios.control.campaign import CONTROLLED
from scenarios.control.ground_arm import ARM_FIELDS, identification_of, with_options
from scenarios.control.runs import run_scenarios
from scenarios.control.study import changed_arms
from scenarios.experiments.excitation_computer import Excitation
from scenarios.experiments.scenario import Scenario
from tests.refusals import refused
from tests.scenarios.control.test_runs import law

PLAIN = replace(scenarios.load("siso-5-elbow_pitch", duration=4.0), description="", tags=())

CHANGED = {
    "name": replace(PLAIN, name="mine"),
    "axes": replace(PLAIN, axes=("wrist_yaw",)),
    "excitation": replace(PLAIN, excitation=(Excitation("sine", {"amplitude": 0.5, "frequency": 1.0}),)),
    "duration": replace(PLAIN, duration=5.0),
    "seed": replace(PLAIN, seed=12),
    "variant": replace(PLAIN, variant="published"),
    "payload": replace(PLAIN, payload="mdm"),
    "pose": replace(PLAIN, pose="home"),
    "mode": replace(PLAIN, mode="single_joint_rate"),
    "worksite": replace(PLAIN, worksite=True),
    "task": replace(scenarios.load("reach", duration=4.0)),
    "shutdown": replace(PLAIN, shutdown=(1.0, 2.0)),
    "payload_changes": replace(PLAIN, payload_changes=(PayloadChange(2.0, "none"),)),
    "independent_channels": replace(PLAIN, independent_channels=True),
    "plant": replace(PLAIN, plant=Plant(oil_temperature=60.0, friction_level=3.0)),
    "specimen": replace(PLAIN, specimen=Specimen(payload_mass=1.2)),
    "chain": replace(PLAIN, chain=Chain(friction=False, resolver=False)),
    "hand_controller": replace(PLAIN, hand_controller=HandController(gain=0.01)),
    "description": replace(PLAIN, description="mine"),
    "tags": replace(PLAIN, tags=("mine",)),
}
"""For each field of a scenario one that differs from the plain one in it."""

EVERY_FIELD = pytest.mark.parametrize("field", [field.name for field in fields(Scenario)])


def planned(*words, seeds=(0,), payload=None, friction_level=None):
    """The identification and the runs of `hmtb control` with some words."""
    return _tested(list(map(str, words)), seeds, None, payload, friction_level)


@EVERY_FIELD
def test_a_file_is_obeyed_in_every_field(field, tmp_path):
    scenario, path = CHANGED[field], tmp_path / "mine.toml"
    assert getattr(scenario, field) != getattr(PLAIN, field)
    path.write_text(scenario.to_toml())
    ground, draws = planned(path)
    assert draws == [scenario]
    # The arm is identified as it runs; at the worksite it carries the unit.
    for name in ARM_FIELDS:
        assert getattr(ground, name) == getattr(scenario, name)


@EVERY_FIELD
def test_runs_differ_from_their_scenario_in_what_they_say_alone(field, monkeypatch):
    simulated = []
    monkeypatch.setattr(runs, "simulate", lambda experiments, **_: simulated.extend(experiments) or runs_of_nothing())
    scenario = CHANGED[field]
    run_scenarios([scenario], {"through": law()})
    of_reference = {"variant", "plant", "specimen"}
    allowed = [{"name"}, {"name", *of_reference}, {"name"}]
    if scenario.worksite or scenario.shutdown:
        # Requests follow the arm: the reference arm has no run.
        del allowed[1]
    assert len(simulated) == len(allowed)
    for experiment, names in zip(simulated, allowed, strict=True):
        changed = {one.name for one in fields(Scenario) if getattr(experiment, one.name) != getattr(scenario, one.name)}
        assert changed <= names


def runs_of_nothing():
    """Logs of no run."""
    from hmtb_twin.run.simulation import Logs

    return Logs(())


def test_options_stand_above_the_scenario_and_the_frequency_test_has_its_arm(tmp_path):
    path = tmp_path / "mine.toml"
    path.write_text(replace(CHANGED["plant"], payload="ballast", pose="home").to_toml())
    ground, (scenario, multisine) = planned(path, MULTISINE, payload="mdm", friction_level=2.0)
    assert scenario.payload == multisine.payload == ground.payload == "mdm"
    assert scenario.plant == multisine.plant == ground.plant == Plant(oil_temperature=60.0, friction_level=2.0)
    assert multisine.pose == ground.pose == "home"
    ground, (multisine,) = planned(MULTISINE, payload="none")
    assert (ground.payload, multisine.payload, ground.variant) == ("none", "none", "nominal")


def test_at_the_worksite_the_arm_is_identified_with_the_unit():
    rpcm = scenarios.load("rpcm")
    assert (rpcm.payload, identification_of([rpcm]).payload) == ("none", "rpcm")
    assert identification_of([rpcm, scenarios.load("reach")]).worksite is False
    assert identification_of([rpcm], payload="mdm").payload == "mdm"
    assert with_options(rpcm, "mdm", None) == rpcm


def test_seeds_draw_runs_and_identification():
    ground, draws = planned("reach", MULTISINE, seeds=range(5, 7))
    assert ground.seed == ground.multisines.seed == 5
    assert [draw.name for draw in draws] == ["reach", "multisine"] * 2
    assert len({draw.seed for draw in draws}) == 4
    assert planned("reach")[1] == [scenarios.load("reach")]


def test_what_control_cannot_obey_is_named():
    differing = [PLAIN, CHANGED["plant"]]
    refused("with plant.friction_level = 1.0 and .* with 3.0 given, expected one arm", identification_of, differing)
    refused("with chain.friction = True and .* with False given", identification_of, [PLAIN, CHANGED["chain"]])
    refused("payload = rpcm and .* with mdm given", identification_of, [PLAIN, CHANGED["payload"]])
    refused("stress test 'payload none': .* none follows itself", changed_arms, CHANGED["payload_changes"])
    released = scenarios.load("every-joint")
    refused("every-joint: axes with shoulder_roll given, which is not under control", identification_of, [released])
    assert identification_of([replace(released, axes=CONTROLLED, excitation=released.excitation[1:])])
