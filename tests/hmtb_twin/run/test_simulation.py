from dataclasses import replace

import numpy as np
import pytest

from hmtb_twin import IDEAL, JOINTS, TwinError, load_arm, simulate
from hmtb_twin.parameters.values import MOTIONS, RECORDER

CHANNELS = ("commanded", "measured", "wrench", "true_angles", "load_pressure", "volts", "counts", "status")


def equal(first, second) -> bool:
    return all(np.array_equal(getattr(first, name), getattr(second, name)) for name in CHANNELS)


def test_threads_do_not_change_a_bit_and_seeds_do(experiment):
    tests = [experiment(name=f"n{i}", seed=i, axes=(JOINTS[1 + i % 6],), duration=2.0 + i % 2) for i in range(6)]
    one, two = simulate(tests, threads=1), simulate(tests, threads=2)
    assert all(equal(a, b) for a, b in zip(one, two, strict=True))
    assert not equal(one[0], simulate([replace(tests[0], seed=99)])[0])


def test_measurement_is_read_before_the_command_of_its_tick_acts(experiment):
    quiet = experiment(chain=IDEAL, axes=("shoulder_pitch",), spoil={})
    log = simulate([quiet])[0]
    data = log.iodata()
    first = np.flatnonzero(np.abs(np.diff(log.commanded[:, 2], prepend=log.commanded[0, 2])) > 0)
    assert log.commanded[0, 2] != load_arm().pose(quiet.pose)[2]
    # The first command acts at once, and shows one sample later on this joint.
    assert data.y[0, 0] == pytest.approx(load_arm().pose(quiet.pose)[2], abs=1e-12)
    assert abs(data.y[1, 0] - data.y[0, 0]) > 1e-9
    assert len(first) > 0


def test_bus_delay_shifts_the_measured_angles(experiment):
    log = simulate([experiment(chain=IDEAL)])[0]
    delays = load_arm().delays
    for joint, delay in enumerate(delays):
        shifted = log.true_angles[: len(log) - delay, joint]
        np.testing.assert_array_equal(log.measured[delay:, joint], shifted)
    assert delays.tolist() == [1, 1, 0, 1, 1, 1, 1]


def test_command_keeps_the_velocity_limit_and_the_other_joints_their_pose(experiment):
    log = simulate([experiment(amplitude=8.0, duration=6.0)])[0]
    elbow = JOINTS.index("elbow_pitch")
    rate = np.abs(np.diff(log.commanded[:, elbow])).max() / log.dt
    assert rate == pytest.approx(MOTIONS["elbow_pitch"].velocity_limit, rel=1e-9)
    others = np.delete(np.arange(7), elbow)
    assert (log.commanded[:, others] == load_arm().pose("rpcm_holster_out_approach")[others]).all()


def test_command_keeps_the_joint_range(experiment):
    class Push(experiment):
        def volts(self) -> np.ndarray:
            return np.full((round(50 * self.duration), 1), 9.9)

    log = simulate([Push(axes=("shoulder_pitch",), pose="home", duration=4.0)])[0]
    assert log.commanded[:, 2].max() == pytest.approx(MOTIONS["shoulder_pitch"].upper)


def test_resolver_rounds_to_its_counts(experiment):
    log = simulate([experiment(duration=1.0)])[0]
    counts = log.measured / RECORDER.resolver_step
    np.testing.assert_allclose(counts, np.rint(counts), atol=1e-9)
    assert (log.counts == np.rint(log.counts)).all()


def test_noise_has_the_stated_size(experiment):
    still = experiment(amplitude=0.0, duration=40.0)
    log = simulate([still])[0]
    error = (log.measured[1:] - log.true_angles[:-1])[:, [1, 3, 4]]
    assert error.std() == pytest.approx(RECORDER.noise, rel=0.05)


def test_wrench_carries_the_weight_outboard_of_the_sensor(experiment):
    for payload, mass in (("rpcm", 8.1), ("none", 4.0)):
        log = simulate([experiment(amplitude=0.0, chain=IDEAL, payload=payload, duration=1.0)])[0]
        assert np.linalg.norm(log.wrench[10:, :3], axis=1) == pytest.approx(9.81 * mass, rel=1e-4)


def test_divergence_fails_the_experiment_by_name_not_the_batch(experiment, monkeypatch, tmp_path):
    monkeypatch.chdir(tmp_path)
    arm = load_arm()
    edge = arm.pose("rpcm_holster_out_approach")[3] + 0.1

    class Faulty:
        def gravity_torque(self, angles):
            torque = arm.controller.gravity_torque(angles)
            torque[np.asarray(angles)[:, 3] > edge] = np.nan
            return torque

    faulty = replace(arm, controller=Faulty())
    monkeypatch.setattr("hmtb_twin.run.simulation.load_arm", lambda *_, **__: faulty)
    tests = [experiment(name="calm", amplitude=0.5), experiment(name="wild", amplitude=5.0), experiment(name="calm2")]
    logs = simulate(tests)
    assert [log.name for log in logs] == ["calm", "calm2"]
    assert set(logs.failed) == {"wild"}
    assert "CTRL" in logs.failed["wild"]
    monkeypatch.undo()
    assert equal(logs[0], simulate(tests[:1])[0])


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


def test_nothing_to_run_gives_no_logs():
    assert len(simulate([])) == 0


def test_progress_counts_every_tick(experiment):
    seen = []
    simulate([experiment(duration=1.0), experiment(name="b", duration=2.0)], progress=lambda *x: seen.append(x))
    assert seen[-1] == (150, 150)
    assert [done for done, _ in seen] == sorted(done for done, _ in seen)
