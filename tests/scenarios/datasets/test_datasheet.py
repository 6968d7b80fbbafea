"""What is played, in words: with units, and with frequencies and times as they come out."""

from dataclasses import replace

import pytest

from scenarios.datasets.metadata import ENVIRONMENT
from scenarios.datasets.spec import shipped
from scenarios.datasets.spec_tables import RecordBlock
from scenarios.experiments.excitation_computer import Excitation
from scenarios.experiments.multisines import Multisines

WORDS = ENVIRONMENT.get_template("datasheet_block.md.j2").module
played, conditions = WORDS.played, WORDS.conditions
JOINTS = ("shoulder_yaw", "elbow_pitch")
PRBS = Excitation("prbs", {"amplitude": 0.5, "clock": 2}, repeat_frequency=0.1)


@pytest.mark.parametrize(
    ("one", "text"),
    [
        (PRBS, "pseudorandom binary sequence (amplitude 0.5 V, a level for 0.2 s, seed 0, {}, repeated every 10 s)"),
        (Excitation("prbs", {"clock": 1, "register": 20, "seed": 3}), "seed 3, register of 20 bits, {}, "),
        (
            Excitation("chirp", {"f_start": 1.0, "f_end": 5.0}, repeat_frequency=0.25, iterations=3),
            "chirp (f_start 0.5 Hz, f_end 2.5 Hz, amplitude 1 V, {}, repeated every 4 s, 3 times, then nothing)",
        ),
        (
            Excitation("bipolar_ramping_pulse", {"growing": True}, repeat_frequency=0.25),
            "(frequency 0.5 Hz, pulse width 0.2 s, amplitude 4 V, growing, {}, repeated every 4 s)",
        ),
        (Excitation("points", {"points": (0.5,) * 100}), "points of a file ({}, repeated every 2 s)"),
    ],
)
def test_an_excitation_is_described_as_it_is_played(one, text):
    assert text.format("100 points") in WORDS.excitation(one, drawn=False)


BLOCK = RecordBlock("b", "train", axes=JOINTS, each_axis=True, excitation=(PRBS,), duration=20.0, draw_waveforms=True)


def test_seeds_and_amplitudes_that_are_none_are_left_out():
    assert played(replace(BLOCK, amplitudes=(0.5, 2.0))) == (
        "pseudorandom binary sequence (a level for 0.2 s, 100 points, repeated every 10 s); at 0.5, 2 V; drawn anew "
        "for each experiment"
    )
    together = replace(BLOCK, each_axis=False)
    assert played(together).startswith("one waveform that all axes share: ")
    assert played(replace(together, excitation=(PRBS, PRBS))).startswith("a waveform of its own on each axis: ")
    assert "; elbow_pitch: white noise (" in played(replace(together, excitation=(PRBS, Excitation("white_noise"))))


def test_multisines_are_described_with_strength_settling_and_records():
    multisines = Multisines(rms=0.02, f_min=0.1, f_max=3.0, period=20.48, realisations=2, periods=3, settling=1)
    block = RecordBlock("m", "test", axes=JOINTS, multisines=multisines)
    assert played(block) == (
        "random-phase multisines of 0.02 rad root mean square, 0.1 to 3 Hz, lines 0.04883 Hz apart; 2 realisations x 2 "
        "records, with phases that are orthogonal over these, of 1 + 3 periods of 20.48 s, the first one to settle"
    )
    assert " x " not in played(replace(block, each_axis=True))
    assert played(replace(block, amplitudes=(0.01, 0.1))).endswith("; at 0.01, 0.1 rad root mean square")


def test_conditions_are_described_in_words():
    thesis, mimo = (shipped()[name].records for name in ("hmtb-thesis-v1", "hmtb-mimo-v1"))
    assert "several joints at once" in conditions(mimo[0])
    assert "payload that of the scenario" in conditions(thesis[0]) and "single_joint" not in conditions(thesis[0])
    block = replace(BLOCK, process_noises=(0.01,))
    assert conditions(block).endswith("process noise 0.01 of the rated torque; the stick commands one joint")
    without = replace(block.chain, resolver=False)
    assert conditions(replace(block, chain=without)).endswith("; without resolver")
