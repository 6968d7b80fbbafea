"""Other seeds are other experiments."""

import numpy as np
import pytest

from hmtb_twin import linearize
from scenarios.experiments.campaign import NOMINAL, RPCM, campaign_scenario
from scenarios.experiments.excitation import prbs
from scenarios.experiments.registry import load
from scenarios.thesis.campaign import EVERY_TEST, OTHER_WAVEFORMS, Campaign, plays_identified_sequence, run_campaign
from tests.refusals import refused

YAW = "siso-5-shoulder_yaw"


def played(name, seed):
    """One period of the file, without its mean and of unit length, as a spectrum."""
    (entry,) = campaign_scenario(name, seed=seed).excitation
    points = prbs(**entry.parameters).points
    points = points - points.mean()
    return np.fft.fft(points / np.linalg.norm(points))


def test_seeds_draw_sequences_that_are_not_one_another_played_later():
    files = [played(YAW, seed) for seed in (None, *range(1, 21))]
    for number, one in enumerate(files):
        for other in files[:number]:
            assert np.abs(np.fft.ifft(one * other.conj())).max() < 0.8


def test_all_tests_of_a_campaign_play_the_same_sequence():
    for name in ("siso-6-shoulder_yaw", "siso-5-elbow_pitch", "mimo-7", "mimo-8"):
        np.testing.assert_allclose(played(name, 4), played(YAW, 4))
        assert campaign_scenario(name, seed=4).seed != campaign_scenario(YAW, seed=4).seed


def test_what_plays_the_sequence_of_estimation_is_known():
    joints = ("shoulder_yaw", "shoulder_pitch", "elbow_pitch")
    several = {"mimo-7", "mimo-8", "mimo-7-independent", "mimo-8-independent"}
    assert {name for name in EVERY_TEST if plays_identified_sequence(name)} == several | {
        f"siso-{number}-{joint}" for number in (5, 6) for joint in joints
    }
    assert OTHER_WAVEFORMS == (1, 2, 3, 4, 7, 8)


def test_without_a_seed_a_scenario_is_played_as_registered():
    assert campaign_scenario(YAW) == load(YAW)
    assert campaign_scenario("mimo-7-independent", seed=4).excitation == load("mimo-7-independent").excitation


def test_the_exchange_keeps_its_length():
    assert campaign_scenario(RPCM, duration=24.0).duration == load(RPCM).duration
    assert campaign_scenario(YAW, duration=24.0).duration == 24.0


@pytest.mark.parametrize("seed", [1.5, -1, True, "1", np.int64(4)])
def test_a_seed_is_a_whole_number_of_python(seed):
    refused("whole number", campaign_scenario, YAW, seed=seed)


def test_a_campaign_plays_something_and_nothing_twice():
    refused("at least one", run_campaign, NOMINAL, [])
    refused(f"more than once: {YAW}", run_campaign, NOMINAL, [load(YAW), load(YAW, seed=3)])


def test_a_record_that_was_not_played_is_named():
    empty = Campaign(NOMINAL, linearize(NOMINAL.arm()), {}, {})
    refused("no record of siso-9-elbow_pitch: it was not played", empty.single, 9, "elbow_pitch")
    assert empty.singles("elbow_pitch") == {}
