"""What is played, in words: with units, and with frequencies and times as they come out."""

from dataclasses import replace

import pytest

from scenarios.datasets.datasheet import conditions, excitation, played
from scenarios.datasets.spec import shipped
from scenarios.datasets.spec_tables import RecordBlock
from scenarios.experiments.excitation_computer import Excitation
from scenarios.experiments.multisines import Multisines

JOINTS = ("shoulder_yaw", "elbow_pitch")
PRBS = Excitation("prbs", {"amplitude": 0.5, "clock": 2}, repeat_frequency=0.1)


@pytest.mark.parametrize(
    ("one", "said"),
    [
        (
            PRBS,
            "pseudorandom binary sequence (amplitude 0.5 V, a level for 0.2 s, seed 0, 100 points, repeated every "
            "10 s)",
        ),
        (
            Excitation("prbs", {"clock": 1, "register": 20, "seed": 3}),
            "pseudorandom binary sequence (amplitude 1 V, a level for 0.02 s, seed 3, register of 20 bits, 100 points, "
            "repeated every 2 s)",
        ),
        (
            Excitation("chirp", {"f_start": 1.0, "f_end": 5.0}, repeat_frequency=0.25, iterations=3),
            "chirp (f_start 0.5 Hz, f_end 2.5 Hz, amplitude 1 V, 100 points, repeated every 4 s, 3 times, then "
            "nothing)",
        ),
        (
            Excitation("bipolar_ramping_pulse", {"growing": True}, repeat_frequency=0.25),
            "bipolar ramping pulse (frequency 0.5 Hz, pulse width 0.2 s, amplitude 4 V, growing, 100 points, repeated "
            "every 4 s)",
        ),
        (Excitation("points", {"points": (0.5,) * 100}), "points of a file (100 points, repeated every 2 s)"),
    ],
)
def test_an_excitation_is_told_as_it_comes_out(one: Excitation, said: str) -> None:
    assert excitation(one, drawn=False) == said


def test_seeds_and_amplitudes_that_are_none_are_left_out() -> None:
    block = RecordBlock(
        "b", "train", axes=JOINTS, each_axis=True, excitation=(PRBS,), duration=20.0, draw_waveforms=True
    )
    told = played(replace(block, amplitudes=(0.5, 2.0)))
    assert told == (
        "pseudorandom binary sequence (a level for 0.2 s, 100 points, repeated every 10 s); at 0.5, 2 V; drawn anew "
        "for each experiment"
    )
    together = replace(block, each_axis=False)
    assert played(together).startswith("one waveform that all axes share: ")
    assert played(replace(together, excitation=(PRBS, PRBS))).startswith("a waveform of its own on each axis: ")
    other = Excitation("white_noise")
    assert "; elbow_pitch: white noise (" in played(replace(together, excitation=(PRBS, other)))


def test_multisines_tell_their_strength_their_settling_and_their_records() -> None:
    multisines = Multisines(rms=0.02, f_min=0.1, f_max=3.0, period=20.48, realisations=2, periods=3, settling=1)
    block = RecordBlock("m", "test", axes=JOINTS, multisines=multisines)
    assert played(block) == (
        "random-phase multisines of 0.02 rad root mean square, 0.1 to 3 Hz, lines 0.04883 Hz apart; 2 realisations x 2 "
        "records, with phases that are orthogonal over these, of 1 + 3 periods of 20.48 s, the first one to settle"
    )
    assert " x " not in played(replace(block, each_axis=True))
    assert played(replace(block, amplitudes=(0.01, 0.1))).endswith("; at 0.01, 0.1 rad root mean square")


def test_the_mode_is_told_in_words() -> None:
    thesis, mimo = (shipped()[name].records for name in ("hmtb-thesis-v1", "hmtb-mimo-v1"))
    assert "several joints at once" in conditions(mimo[0])
    assert "payload that of the scenario" in conditions(thesis[0]) and "single_joint" not in conditions(thesis[0])
    block = RecordBlock(
        "b", "train", axes=JOINTS, each_axis=True, excitation=(PRBS,), duration=20.0, process_noises=(0.01,)
    )
    assert conditions(block).endswith("process noise 0.01 of the rated torque; the stick commands one joint")
    without = replace(block.chain, resolver=False)
    assert conditions(replace(block, chain=without)).endswith("; without resolver")
