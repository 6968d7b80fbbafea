"""Signals of one's own, of any length, as an excitation: from an array, from a list in TOML, and from a file."""

from dataclasses import replace

import numpy as np
import pytest

import hmtb_twin
import sysid
from hmtb_twin import IDEAL, JointLog
from hmtb_twin.parameters.values import HAND_CONTROLLER
from scenarios.experiments import Excitation, Scenario
from scenarios.experiments.registry import load
from scenarios.experiments.replacements import Changes
from scenarios.experiments.waveform import read_signals
from scenarios.files.errors import ScenarioError
from tests.refusals import refused

SIGNAL = np.random.default_rng(5).uniform(-0.5, 0.5, 333)


def played(excitation, duration=10.0):
    """The experiment that plays an excitation on one joint, without a chain in between."""
    return Scenario("mine", ("elbow_pitch",), (excitation,), duration=duration, chain=IDEAL)


def test_every_sample_is_played_once_and_the_signal_begins_anew():
    volts = Excitation.from_signal(SIGNAL[:, None]).requested_volts(20.0)[:, 0]
    np.testing.assert_array_equal(volts, np.tile(SIGNAL, 4)[:1000])
    once = Excitation.from_signal(SIGNAL, iterations=1).requested_volts(20.0)[:, 0]
    np.testing.assert_array_equal(once, np.concatenate([SIGNAL, np.zeros(667)]))
    # At half the rate each sample is held for two ticks.
    slow = Excitation.from_signal(SIGNAL, 25.0).requested_volts(10.0)[:, 0]
    np.testing.assert_array_equal(slow, np.repeat(SIGNAL, 2)[:500])
    assert Excitation.from_signal(SIGNAL).waveform().period == pytest.approx(6.66)
    assert "<333 numbers>" in repr(Excitation.from_signal(SIGNAL))
    assert len(repr(Excitation.from_signal(SIGNAL))) < 120


def test_the_arm_is_commanded_what_the_signal_asks_for():
    (log,) = hmtb_twin.simulate([played(Excitation.from_signal(SIGNAL), duration=6.66)])
    joint = log.joints.index("elbow_pitch")
    command = log.commanded[:, joint] - log.commanded[:, joint].mean()
    expected = HAND_CONTROLLER.gain * SIGNAL
    # The first command is the pose itself or already the first sample: the tick of the signal is found from the record.
    errors = [np.abs(np.roll(expected, lag)[5:] - expected.mean() - command[5:]).max() for lag in (0, 1)]
    assert min(errors) < 1e-4


def test_what_design_input_returns_can_be_played_and_saved(tmp_path):
    servo = sysid.oe(hmtb_twin.simulate(played(Excitation("prbs")))[0].iodata("elbow_pitch").detrend(), 2, 2)
    volts = sysid.design_input(servo, 1000, amplitude=0.5, seed=3).u
    scenario = played(Excitation.from_signal(volts), duration=20.0)
    log = hmtb_twin.simulate(scenario)[0]
    commands = log.iodata("elbow_pitch").u[:, 0]
    # A command follows its sample at once, or one tick later.
    likeness = [np.corrcoef(np.roll(volts[:, 0], lag)[5:], commands[5:])[0, 1] for lag in (0, 1)]
    assert max(likeness) > 0.999
    assert Scenario.from_toml(scenario.to_toml()) == scenario


def test_a_log_carries_all_samples_of_a_long_signal(tmp_path):
    long = np.tile(SIGNAL, 300)
    log = hmtb_twin.simulate(played(Excitation.from_signal(long), duration=4.0))[0]
    log.save(tmp_path / "long.nc")
    again = JointLog.load(tmp_path / "long.nc")
    np.testing.assert_array_equal(again.measured, log.measured)
    assert Scenario.from_toml(again.provenance["scenario"]).excitation[0].parameters["samples"] == tuple(long.tolist())


def test_a_file_beside_the_scenario(tmp_path):
    (tmp_path / "drive.txt").write_text("# V\n" + "\n".join(map(repr, SIGNAL.tolist())), encoding="utf-8")
    table = 'name = "mine"\naxes = ["elbow_pitch"]\nduration = 4.0\n[excitation]\nkind = "record"\n'
    (tmp_path / "mine.toml").write_text(table + 'path = "drive.txt"\nsample_rate = 100.0\n', encoding="utf-8")
    scenario = Scenario.read(tmp_path / "mine.toml")
    assert scenario.excitation == (Excitation.from_signal(SIGNAL, 100.0),)
    assert scenario.excitation[0].misses_points
    (tmp_path / "drive.txt").write_text("1 2 x", encoding="utf-8")
    refused(r"mine\.toml.*drive\.txt.*line 1.*given 'x'", Scenario.read, tmp_path / "mine.toml")
    (tmp_path / "drive.txt").unlink()
    refused(r"cannot read waveform file.*drive\.txt.*expected numbers in V", Scenario.read, tmp_path / "mine.toml")
    (tmp_path / "mine.toml").write_text(table + 'path = "drive.txt"\nsamples = [1.0, 2.0]\n', encoding="utf-8")
    refused("takes samples, or the path", Scenario.read, tmp_path / "mine.toml")


@pytest.mark.parametrize(
    ("signal", "rate", "says"),
    [
        (np.zeros((10, 2)), 50.0, r"one channel.*\(10, 2\)"),
        (np.array([0.0, np.nan, 1.0]), 50.0, r"samples\[1\] must be a finite number, given nan"),
        (np.array([1.0]), 50.0, "2 samples or more"),
        (np.array([0.0, 2000.0]), 50.0, "at most 1000 V"),
        (np.array([0.0, 1.0]), 0.0, "sample_rate must be above 0 Hz"),
        (np.array([0.0, 1.0]), np.nan, "sample_rate must be a finite number"),
        (["a", "b"], 50.0, "expected real numbers"),
        (np.zeros(10) + 1j, 50.0, "expected real numbers"),
    ],
)
def test_a_wrong_signal_is_one_line(signal, rate, says):
    with pytest.raises(ScenarioError, match=says) as error:
        Excitation.from_signal(signal, rate)
    assert "\n" not in str(error.value)


def table(path, *columns, header="t,left,right", interval=0.02):
    """A table with times and one column or two."""
    times = interval * np.arange(len(columns[0]))
    np.savetxt(path, np.column_stack([times, *columns]), delimiter=",", header=header, comments="", fmt="%.10g")
    return path


def test_columns_of_a_table_with_its_own_rate(tmp_path):
    path = table(tmp_path / "drive.csv", SIGNAL, -SIGNAL, interval=0.01)
    left, right = read_signals(path, ("left", "right"))
    np.testing.assert_allclose(left.samples, SIGNAL, rtol=1e-9)
    np.testing.assert_allclose(right.samples, -SIGNAL, rtol=1e-9)
    assert left.sample_rate == right.sample_rate == 100.0
    assert read_signals(path, ("left",), 100.0)[0] == left
    refused(r"a sampling rate of 50 Hz given, its times have 100 Hz", read_signals, path, ("left",), 50.0)
    refused(r"unknown column 'rigth' \(did you mean 'right'\?\)", read_signals, path, ("rigth",))
    refused("no file .*none.csv", read_signals, tmp_path / "none.csv", ("left",))


@pytest.fixture
def bare(tmp_path):
    """A table without a header, beside which no column is named."""
    np.savetxt(tmp_path / "bare.csv", np.column_stack([SIGNAL, SIGNAL]), delimiter=",")
    return tmp_path


def test_what_no_table_may_hold(bare):
    refused("666 numbers in 333 lines given, expected one number in V per line", read_signals, bare / "bare.csv")
    broken = SIGNAL.copy()
    broken[7] = np.nan
    refused("NaN|number", read_signals, table(bare / "nan.csv", broken, broken), ("left",))
    jumps = np.cumsum(np.where(np.arange(333) == 100, 0.5, 0.02))
    np.savetxt(bare / "gap.csv", np.column_stack([jumps, SIGNAL]), delimiter=",", header="t,left", comments="")
    refused("gap.csv", read_signals, bare / "gap.csv", ("left",))


def test_a_record_takes_the_place_of_an_excitation(tmp_path):
    path = table(tmp_path / "drive.csv", SIGNAL, -SIGNAL)
    (tmp_path / "one.txt").write_text("\n".join(map(repr, SIGNAL.tolist())), encoding="utf-8")
    one = Changes(record=tmp_path / "one.txt").made(load("siso-5-elbow_pitch"))
    assert one.excitation == (Excitation.from_signal(SIGNAL),)
    two = replace(played(Excitation("prbs")), axes=("elbow_pitch", "shoulder_yaw"))
    both = Changes(record=path, columns=("left", "right")).made(two)
    first = [excitation.parameters["samples"][0] for excitation in both.excitation]
    assert first == pytest.approx([SIGNAL[0], -SIGNAL[0]])
    assert both.independent_channels
    refused("with 2 axes .* and 1 signals of one.txt given", Changes(record=tmp_path / "one.txt").made, two)
    refused("an operator moves the stick", Changes(record=path, columns=("left",)).made, load("rpcm"))
    refused("expected --record FILE beside it", Changes, columns=("left",))
    text = 'name = "mine"\naxes = ["elbow_pitch"]\nduration = 4.0\n[excitation]\nkind = "record"\npath = "drive.csv"\n'
    (tmp_path / "mine.toml").write_text(text + 'column = "right"\n', encoding="utf-8")
    assert Scenario.read(tmp_path / "mine.toml").excitation == (both.excitation[1],)


def test_the_command_line_plays_a_record_with_a_payload(tmp_path, monkeypatch, result, complaint):
    monkeypatch.chdir(tmp_path)
    table(tmp_path / "drive.csv", SIGNAL, -SIGNAL)
    words = ("siso-5-elbow_pitch", "--duration", 4, "--record", "drive.csv")
    own = ("--payload", "mass=2.5 centre=0,0,0.05 inertia=0.01,0.01,0.02")
    result("simulate", *words, "--record-column", "left", *own)
    log = JointLog.load("siso-5-elbow_pitch.nc")
    scenario = Scenario.from_toml(log.provenance["scenario"])
    np.testing.assert_allclose(scenario.excitation[0].parameters["samples"], SIGNAL, rtol=1e-9)
    load_text = hmtb_twin.Load(2.5, (0, 0, 0.05), (0.01, 0.01, 0.02, 0, 0, 0)).text
    assert scenario.payload == log.provenance["payload"] == load_text
    assert result("compare", "siso-5-elbow_pitch.nc", "--models", "truth")["models"][0]["fit"]["simulation"][0] > 50.0
    result("preview", *words, "--record-column", "right", *own)
    assert "unknown column 'up'" in complaint("simulate", *words, "--record-column", "up", "--overwrite")
    assert "none above the sum" in complaint("simulate", *words[:3], "--payload", "mass=1 inertia=1,1,9", "--overwrite")


def test_a_payload_is_a_table_of_a_scenario_file():
    text = 'name = "mine"\naxes = ["elbow_pitch"]\nduration = 4.0\nexcitation = { kind = "prbs" }\n'
    own = Scenario.from_toml(text + "payload = { mass = 2.0, centre = [0.0, 0.0, 0.1] }\n")
    assert own.payload == hmtb_twin.Load(2.0, (0.0, 0.0, 0.1), (0.0,) * 6).text
    assert Scenario.from_toml(own.to_toml()) == own
    refused("unknown key of payload 'weight'", Scenario.from_toml, text + "payload = { weight = 2.0 }\n")
    refused("0 numbers of mass", Scenario.from_toml, text + "payload = { centre = [0.0, 0.0, 0.1] }\n")
    refused("2 of centre", Scenario.from_toml, text + "payload = { mass = 1.0, centre = [0.0, 0.1] }\n")
