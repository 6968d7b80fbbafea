import gc
from dataclasses import replace
from itertools import product
from types import SimpleNamespace
from weakref import ref

import numpy as np
import pytest
from mujoco import batch

from hmtb_twin import IDEAL, JOINTS, Motion, OverloadError, Plant, Specimen, Status, TwinError, load_arm, simulate
from hmtb_twin.arm.arm import _load
from hmtb_twin.control.experiment import Chain
from hmtb_twin.parameters.values import RECORDER
from hmtb_twin.parameters.variants import MOTIONS
from tests.hmtb_twin.altered_arms import equal
from tests.refusals import refused


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
    push = experiment(axes=("shoulder_pitch",), pose="home", duration=4.0, spoil=dict.fromkeys(range(200), 9.9))
    log = simulate([push])[0]
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
    refused(message, simulate, [experiment(), replace(experiment(), **change)])


def test_progress_counts_every_tick_and_nothing_to_run_gives_no_logs(experiment):
    assert len(simulate([])) == 0
    for threads in (0, -1, 1.5, 10**11):
        refused(f"threads = {threads}", simulate, [experiment()], threads=threads)
    seen = []
    simulate([experiment(duration=1.0), experiment(name="b", duration=2.0)], progress=lambda *x: seen.append(x))
    assert seen[-1] == (150, 150)
    assert [done for done, _ in seen] == sorted(done for done, _ in seen)


@pytest.fixture
def batches(monkeypatch):
    """Rows of each batch that is made."""
    made = []

    class Counted(batch.Batch):
        def __init__(self, model, nsim, nthread):
            made.append(nsim)
            super().__init__(model, nsim=nsim, nthread=nthread)

    monkeypatch.setattr("hmtb_twin.run.batch_run.batch.Batch", Counted)
    return made


def assert_same_alone(mixed, batches, rows):
    """Check the rows of the batches of a simulation on two threads, and each log against that of a run alone."""
    together = simulate(mixed, threads=2)
    assert sorted(batches) == rows
    for one, log in zip(mixed, together, strict=True):
        assert equal(simulate([one], threads=1)[0], log), one.name
    return together


@pytest.mark.slow
def test_different_arms_side_by_side_log_what_each_logs_alone_and_another_seed_logs_otherwise(experiment, batches):
    arms = product(("nominal", "published"), (True, False), ("rpcm", "none", "mdm"))
    mixed = [
        experiment(
            name=f"{variant}-{friction}-{payload}",
            variant=variant,
            chain=Chain(friction=friction),
            payload=payload,
            axes=(JOINTS[1 + seed % 6],),
            seed=seed,
            # One of them is longer than what is computed ahead.
            duration=6.0 if seed == 3 else 1.0 + 0.5 * (seed % 2),
        )
        for seed, (variant, friction, payload) in enumerate(arms)
    ]
    mixed += [
        experiment(name="noisy", plant=Plant(friction_level=1.5, process_noise=0.02), duration=1.0),
        experiment(name="heavy", specimen=Specimen(payload_mass=1.2, resolver_noise=2.0), duration=1.0),
    ]
    # With the unit or without, with bristles or without: all else is numbers.
    together = assert_same_alone(mixed, batches, [2, 2, 4, 6])
    assert not equal(together[0], simulate([replace(mixed[0], seed=99)])[0])


def test_other_steps_and_other_valves_stand_in_batches_of_their_own(experiment, batches):
    mixed = [
        experiment(name="flight", variant="flight", duration=0.5),
        experiment(name="orifice", plant=Plant(actuator="orifice"), duration=0.5),
        experiment(name="worn", plant=Plant(actuator="orifice", friction_level=1.5), duration=0.4),
        experiment(duration=0.5),
    ]
    together = assert_same_alone(mixed, batches, [1, 1, 2])
    assert together.steps == 25 * 20 + (25 + 20) * 20 + 25 * 15


@pytest.mark.slow
@pytest.mark.parametrize("worksite", [False, True])
def test_each_arm_loses_its_own_power_and_is_given_it_back(experiment, worksite, batches):
    kind = experiment(duration=1.5, amplitude=3.0, worksite=worksite)
    mixed = [
        replace(kind, name=f"level-{level}", plant=Plant(friction_level=level, process_noise=0.01), shutdown=shutdown)
        for level, shutdown in ((0.5, (0.4,)), (1.0, (0.4, 0.8)), (1.5, (0.6, 1.0, 1.2)), (2.0, ()))
    ]
    together = assert_same_alone(mixed, batches, [4])
    # Without a second time the power stays off to the end.
    assert (together[0].status[20:] & Status.SHUT_DOWN).all()


def test_units_are_taken_and_let_go_by_arms_of_their_own(experiment, batches):
    class Handled(experiment):
        def operator(self):
            return SimpleNamespace(move=lambda view: Motion(np.full(1, 0.5), round(50 * view.time) != 10 * self.seed))

    mixed = [
        Handled(name=f"arm-{i}", seed=i, worksite=True, duration=1.0, specimen=specimen)
        for i, specimen in enumerate((Specimen(), Specimen(payload_mass=1.2), Specimen(payload_mass=0.8)), start=1)
    ]
    together = assert_same_alone(mixed, batches, [3])
    # Held again before it has fallen out of reach, each where it then is.
    assert [np.flatnonzero((log.status & Status.UNIT_HELD) == 0).tolist() for log in together] == [[10], [20], [30]]


@pytest.mark.slow
def test_each_arm_is_loaded_once_and_gone_after(experiment, monkeypatch):
    loaded = []

    def counted(*arguments, **options):
        arm = load_arm(*arguments, **options)
        loaded.append((arm.plant.friction_level, ref(arm), ref(arm.model)))
        return arm

    monkeypatch.setattr("hmtb_twin.run.simulation.load_arm", counted)
    # Levels that no other test asks for: what it loads may still be held by it.
    levels = 2 * [1.07, 1.11, 1.22]
    kind = experiment(duration=0.2, shutdown=(0.1,))
    logs = simulate([replace(kind, name=str(i), plant=Plant(friction_level=x)) for i, x in enumerate(levels)])
    assert [level for level, *_ in loaded] == [1.07, 1.11, 1.22]
    # `load_arm` itself remembers a bounded number of arms.
    _load.cache_clear()
    gc.collect()
    assert len(logs) == 6
    assert all(arm() is None and model() is None for _, arm, model in loaded)


def test_what_cannot_be_run_fails_by_itself_where_asked(experiment, monkeypatch):
    def broken(variant, payload, **options):
        if payload == "mdm":
            raise ValueError("inertia must satisfy A + B >= C")
        return load_arm(variant, payload, **options)

    monkeypatch.setattr("hmtb_twin.run.simulation.load_arm", broken)
    weak = experiment(name="weak", plant=Plant(supply_pressure=4.0))
    unknown, uncompiled = experiment(name="unknown", variant="lunar"), experiment(name="uncompiled", payload="mdm")
    good, other = experiment(duration=1.0), experiment(name="other", seed=2, duration=0.5)
    # Failures of one name are listed by their seeds, and by their places where the seeds agree too.
    mixed = [weak, good, replace(weak, seed=2), unknown, uncompiled, other, weak]
    ticks = []
    logs = simulate(mixed, keep_going=True, progress=lambda *counts: ticks.append(counts))
    assert [log.name for log in logs] == ["binary", "other"]
    assert list(logs.failed) == ["weak@1#0", "weak@2", "unknown", "uncompiled", "weak@1#6"]
    assert logs.failed["weak@2"].startswith("at 4 MPa the drives cannot hold the arm")
    assert logs.failed["weak@2"].endswith("(rpcm_holster_out_approach)")
    assert "unknown variant 'lunar'" in logs.failed["unknown"]
    assert "A + B >= C" in logs.failed["uncompiled"]
    assert ticks[-1] == (75, 75)
    assert equal(logs[0], simulate([good])[0])
    ticks.clear()
    servo_valves = replace(weak, plant=Plant(actuator="orifice", supply_pressure=4.0))
    errors = OverloadError, OverloadError, TwinError, ValueError
    for one, error in zip((weak, servo_valves, unknown, uncompiled), errors, strict=True):
        with pytest.raises(error):
            simulate([good, one], progress=lambda *counts: ticks.append(counts))
    with pytest.raises(OverloadError, match=r"^weak: at 4 MPa the drives .* \(rpcm_holster_out_approach\)$"):
        simulate([good, weak], progress=lambda *counts: ticks.append(counts))
    assert ticks == []


def test_divergence_or_an_error_of_the_engine_fails_its_row_not_the_batch(experiment, monkeypatch):
    arm = load_arm()
    edge = arm.pose("rpcm_holster_out_approach")[3] + 0.1

    class Diverging:
        def gravity_torque(self, angles):
            torque = arm.controller.gravity_torque(angles)
            torque[np.asarray(angles)[:, 3] > edge] = np.nan
            return torque

    def broken(*arguments, plant, **options):
        loaded = load_arm(*arguments, plant=plant, **options)
        if plant.friction_level == 2.0:
            loaded.unpowered.opt.integrator = 99
        return loaded if plant.friction_level == 2.0 else replace(loaded, controller=Diverging())

    monkeypatch.setattr("hmtb_twin.run.simulation.load_arm", broken)
    calm = experiment(name="calm", amplitude=0.5, duration=1.0)
    wild = experiment(name="wild", amplitude=5.0)
    stopped = replace(calm, name="stopped", plant=Plant(friction_level=2.0), shutdown=(0.5,))
    logs = simulate([calm, wild, stopped, replace(calm, name="calm2")])
    _load.cache_clear()
    monkeypatch.undo()
    assert [log.name for log in logs] == ["calm", "calm2"]
    assert set(logs.failed) == {"wild", "stopped"}
    assert "CTRL" in logs.failed["wild"]
    assert logs.failed["stopped"].startswith("the physics engine stopped at 0.50 s: ")
    assert equal(logs[0], simulate([calm])[0])
