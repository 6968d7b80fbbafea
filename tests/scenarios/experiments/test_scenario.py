"""A scenario is a TOML file, read strictly."""

import pickle
from dataclasses import replace
from decimal import Decimal

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from hmtb_twin import JOINTS, Chain, HandController, Plant, Specimen
from scenarios import Excitation, Scenario, load
from scenarios.experiments.scenario import NAME
from tests.refusals import refused

EXCITATIONS = st.one_of(
    st.builds(
        lambda amplitude, clock, seed: Excitation("prbs", {"amplitude": amplitude, "clock": clock, "seed": seed}),
        st.floats(0.01, 10),
        st.integers(1, 33),
        st.integers(0, 2**31),
    ),
    st.builds(lambda n: Excitation("sine", {"frequency": n / 2}), st.integers(1, 49)),
    st.builds(
        lambda points, frequency, count: Excitation("points", {"points": tuple(points)}, frequency, count),
        st.lists(st.floats(-10, 10), min_size=100, max_size=100),
        st.one_of(st.none(), st.floats(1e-3, 1e3)),
        st.one_of(st.none(), st.integers(1, 1000)),
    ),
)


@st.composite
def scenarios(draw):
    axes = tuple(draw(st.lists(st.sampled_from(JOINTS[1:]), min_size=1, max_size=3, unique=True)))
    count = draw(st.sampled_from([1, len(axes)]))
    return Scenario(
        name=draw(st.from_regex(NAME, fullmatch=True)),
        axes=axes,
        excitation=tuple(draw(st.lists(EXCITATIONS, min_size=count, max_size=count))),
        duration=draw(st.floats(0.02, 1e4)),
        seed=draw(st.integers(0, 2**63 - 1)),
        independent_channels=True,
        plant=draw(
            st.builds(
                Plant,
                actuator=st.sampled_from(["linear", "orifice"]),
                servo=st.just("torque"),
                friction=st.sampled_from(["none", "viscous", "coulomb", "lugre"]),
                oil_temperature=st.floats(0.0, 100.0),
                process_noise=st.floats(0.0, 1.0),
            )
        ),
        specimen=draw(
            st.builds(
                Specimen,
                payload_mass=st.floats(0.01, 100.0),
                shift=st.lists(st.floats(-3.0, 3.0), min_size=24, max_size=24),
                kp=st.lists(st.floats(0.01, 100.0), min_size=7, max_size=7) | st.just(()),
            )
        ),
        chain=draw(st.builds(Chain, friction=st.booleans(), adc=st.booleans())),
        hand_controller=draw(st.builds(HandController, gain=st.floats(0.01, 0.1), hold=st.integers(1, 5))),
        description=draw(st.text()),
        tags=tuple(draw(st.lists(st.text(), max_size=3))),
    )


@pytest.mark.slow
@given(scenarios())
def test_toml_round_trip(scenario):
    again = Scenario.from_toml(scenario.to_toml())
    assert (again, hash(again)) == (scenario, hash(scenario))
    assert pickle.loads(pickle.dumps(scenario)) == scenario


MINIMAL = """
name = "mine"
axes = ["elbow_pitch"]
[excitation]
kind = "sine"
frequency = 5
"""


def test_a_short_file_gets_the_defaults():
    scenario = Scenario.from_toml(MINIMAL)
    assert scenario.duration == 240.0
    assert dict(scenario.excitation[0].parameters) == {"frequency": 5.0, "amplitude": 1.0}
    assert scenario.volts().shape == (12_000, 1)


def test_payload_changes_are_tables_and_no_text_without_them():
    scenario = load("track-elbow_pitch")
    assert [(change.time, change.payload) for change in scenario.payload_changes] == [(60.0, "rpcm"), (120.0, "mdm")]
    assert "[[payload_changes]]" in scenario.to_toml()
    assert Scenario.from_toml(scenario.to_toml()) == scenario
    assert "payload_changes" not in Scenario.from_toml(MINIMAL).to_toml()


def test_volts_are_shared_or_one_per_axis():
    axes = ("shoulder_yaw", "elbow_pitch")
    sine, prbs = Excitation("sine", {"frequency": 5.0}), Excitation("prbs")
    shared = Scenario("shared", axes, (sine,), duration=2.0).volts()
    np.testing.assert_array_equal(shared[:, 0], shared[:, 1])
    apart = Scenario("apart", axes, (sine, prbs), duration=2.0).volts()
    asked = np.column_stack([sine.waveform().points, prbs.waveform().points])
    np.testing.assert_allclose(apart, asked, atol=0.5 * 20 / 4096 + 1e-12)
    smooth = Scenario("smooth", axes, (sine, prbs), duration=2.0, chain=Chain(dac=False)).volts()
    np.testing.assert_allclose(smooth, asked, rtol=1e-15)


def test_reseeding_draws_another_seed_for_every_name_and_keeps_the_file():
    one, two = (Scenario(name, ("elbow_pitch",), (Excitation("prbs"),)) for name in ("one", "two"))
    assert one.reseeded(1) == one.reseeded(1)
    assert len({one.reseeded(1).seed, one.reseeded(2).seed, two.reseeded(1).seed}) == 3
    assert one.reseeded(1).excitation == one.excitation


@pytest.mark.parametrize(
    ("change", "says"),
    [
        (lambda t: t.replace("elbow_pitch", "elbow_ptich"), "did you mean 'elbow_pitch'.*shoulder_yaw"),
        (lambda t: t.replace('"sine"', '"sin"'), "unknown excitation 'sin'.*did you mean 'sine'.*prbs"),
        (lambda t: t.replace("frequency", "frequencies"), "unknown parameter 'frequencies'.*amplitude"),
        (lambda t: t.replace("frequency = 5", ""), "needs frequency"),
        (lambda t: t.replace("frequency = 5", "frequency = true"), "must be a finite number, given True"),
        (lambda t: t.replace("frequency = 5", "frequency = 5.1"), "5.1 Hz does not repeat"),
        (lambda t: "duration = 0.001\n" + t, "duration of 0.02 to"),
        (lambda t: "seed = -1\n" + t, "a seed is a whole number"),
        (lambda t: t + "\n[chain]\nnoise = 1\n", "chain.noise must be true or false"),
        (lambda t: "variant = 'nominals'\n" + t, "unknown variant 'nominals'.*nominal"),
        (lambda t: t.replace('["elbow_pitch"]', "[]"), "one or more different entries"),
        (lambda t: t + "[[payload_changes]]\ntime = 9\n", "missing payload; it takes time, payload"),
        (
            lambda t: t + "[[payload_changes]]\ntime = 9\npayload = 'x'\n",
            "unknown payload 'x', available: rpcm",
        ),
        (lambda t: t + "[[payload_changes]]\ntime = 300\npayload = 'mdm'\n", "between 0 and the end at 240 s"),
        (lambda t: t + "[plant]\nprocess_noise = 2\n", "mine.toml: plant: process_noise = 2.0 given, expected 0 to 1"),
        (lambda t: t + "[plant]\nfriction = 'ice'\n", "mine.toml: plant: unknown friction 'ice', available: none"),
        (lambda t: t + "[specimen]\nmass = [1.1]\n", "mine.toml: specimen: 1 entries of mass given, expected 8"),
        (lambda t: t + "iterations = 1.5\n", "iterations must be a whole number"),
        (lambda t: t + "iterations = 0\n", "iterations must be 1 or more, given 0"),
        (lambda t: t + "repeat_frequency = 0.0\n", "in the longest experiment, to 1000 Hz, given 0"),
        (lambda t: t.replace("sine", "points"), "excitation 'points': unknown parameter 'frequency'"),
        (lambda t: t.replace("sine", "file"), "excitation 'file' takes a path and repeat_frequency"),
        (lambda t: t.replace("[excitation]\nkind", "[excitation]\nsort"), "must be a table with a kind"),
    ],
)
def test_a_wrong_file_is_refused_with_what_there_is(change, says):
    refused(says, Scenario.from_toml, change(MINIMAL), source="mine.toml")


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"plant": Plant("orifice", friction="none")}, 'no drag given .*damps the oil of the wrist roll.*"torque"$'),
        ({"payload": "mdm", "worksite": True}, "'mdm' at the worksite given, expected rpcm or none"),
        *(({"name": name}, "scenario name") for name in ("", ".", "../escape", "a/b", "a\nb", "a\0b", "x" * 101, "-x")),
        *(({"duration": duration}, "duration") for duration in (0.0, -1.0, 1e9, float("nan"), float("inf"))),
        *(({"seed": seed}, "seed") for seed in (-1, 2**63)),
        *(
            ({"shutdown": times}, "ascending times")
            for times in ((0.0,), (2.0, 1.0), (1e9,), (1e308,), (float("nan"),))
        ),
    ],
)
def test_values_that_no_experiment_can_have_are_refused(changes, message):
    refused(message, replace, load("siso-1-elbow_pitch"), **changes)


@pytest.mark.parametrize("name", ["translation_gain", "adc_range", "hum_frequency", "hold", "adc_bits"])
@pytest.mark.parametrize("value", [1e308, -1e308, 5e-324j, True, Decimal(3), "x", None, np.array(3.0)])
def test_wrong_values_of_the_hand_controller_are_refused_by_name(name, value):
    refused(f"^hand controller: {name} = .* given, expected", HandController, **{name: value})


def test_the_hand_controller_holds_whole_samples_and_its_converter_has_a_range():
    assert repr(HandController(gain=1, hold=3.0)) == repr(HandController(gain=np.float64(1.0)))
    refused("hold = 2.5 given, expected a whole number, 1 to 1000000", HandController, hold=2.5)
    refused("hold = a value of type int given", HandController, hold=10**5000)
    refused("adc_range = 5e-324 given, expected 0.001 V to 1000 V", HandController, adc_range=5e-324)
