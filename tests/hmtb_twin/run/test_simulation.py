from dataclasses import replace

import numpy as np
import pytest

from hmtb_twin import IDEAL, JOINTS, TwinError, load_arm, simulate
from hmtb_twin.parameters.values import MOTIONS, RECORDER
from tests.hmtb_twin.altered_arms import equal


def test_threads_do_not_change_a_bit_and_seeds_do(experiment):
    tests = [experiment(name=f"n{i}", seed=i, axes=(JOINTS[1 + i % 6],), duration=2.0 + i % 2) for i in range(6)]
    one, two = simulate(tests, threads=1), simulate(tests, threads=2)
    assert all(equal(a, b) for a, b in zip(one, two, strict=True))
    assert not equal(one[0], simulate([replace(tests[0], seed=99)])[0])


def test_measurement_is_read_before_the_command_of_its_tick_acts(experiment):
    log = simulate([experiment(chain=IDEAL, axes=("shoulder_pitch",))])[0]
    data, start = log.iodata(), load_arm().pose("rpcm_holster_out_approach")[2]
    assert log.commanded[0, 2] != start
    # The first command acts at once, and shows one sample later on this joint.
    assert data.y[0, 0] == pytest.approx(start, abs=1e-12)
    assert abs(data.y[1, 0] - data.y[0, 0]) > 1e-9
    assert load_arm().delays.tolist() == [1, 1, 0, 1, 1, 1, 1]
    for joint, delay in enumerate(load_arm().delays):
        np.testing.assert_array_equal(log.measured[delay:, joint], log.true_angles[: len(log) - delay, joint])


def test_command_keeps_the_joint_range_and_resolvers_round_to_their_counts(experiment):
    class Push(experiment):
        def volts(self) -> np.ndarray:
            return np.full((round(50 * self.duration), 1), 9.9)

    log = simulate([Push(axes=("shoulder_pitch",), pose="home", duration=4.0)])[0]
    assert log.commanded[:, 2].max() == pytest.approx(MOTIONS["shoulder_pitch"].upper)
    counts = log.measured / RECORDER.resolver_step
    np.testing.assert_allclose(counts, np.rint(counts), atol=1e-9)
    assert (log.counts == np.rint(log.counts)).all()


def test_wrench_carries_the_weight_outboard_of_the_sensor(experiment):
    for payload, mass in (("rpcm", 8.1), ("none", 4.0)):
        log = simulate([experiment(amplitude=0.0, chain=IDEAL, payload=payload, duration=1.0)])[0]
        assert np.linalg.norm(log.wrench[10:, :3], axis=1) == pytest.approx(9.81 * mass, rel=1e-4)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"axes": ("ankle",)}, r"ankle.*shoulder_yaw"),
        ({"axes": ("shoulder_roll",)}, "indexed"),
        ({"axes": ("elbow_pitch", "elbow_pitch")}, "different ones"),
        ({"mode": "teleport"}, r"'teleport'.*single_joint"),
        ({"variant": "lunar"}, r"'lunar'.*nominal"),
        ({"payload": "brick"}, r"'brick'.*rpcm"),
        ({"pose": "asleep"}, r"'asleep'.*home"),
        ({"duration": 0.0}, "multiple of 0.02"),
        ({"duration": 1.013}, "multiple of 0.02"),
        ({"spoil": {3: float("nan")}}, "finite"),
    ],
)
def test_bad_experiments_are_refused_before_anything_runs(experiment, change, message):
    with pytest.raises(TwinError, match=message):
        simulate([experiment(), replace(experiment(), **change)])


@pytest.mark.parametrize("threads", [0, -1, 1.5, 10**11])
def test_threads_must_be_a_small_whole_number(experiment, threads):
    with pytest.raises(TwinError, match=f"threads = {threads}"):
        simulate([experiment()], threads=threads)


def test_progress_counts_every_tick_and_nothing_to_run_gives_no_logs(experiment):
    assert len(simulate([])) == 0
    seen = []
    simulate([experiment(duration=1.0), experiment(name="b", duration=2.0)], progress=lambda *x: seen.append(x))
    assert seen[-1] == (150, 150)
    assert [done for done, _ in seen] == sorted(done for done, _ in seen)
