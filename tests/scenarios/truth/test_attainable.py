"""What is attainable on a record: floors that no model goes below, and that the right one reaches."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from hmtb_twin import IDEAL, Chain, Plant, Specimen, load_arm, simulate
from hmtb_twin.parameters.values import LARGE_MOTION
from scenarios import Scenario, load
from scenarios.truth.attainable import attainable
from scenarios.truth.noise_free import conditional_mean
from sysid import armax, arx, compare, oe, predict
from tests.benchmarks.attainable import error
from tests.benchmarks.best_linear import QUIET
from tests.refusals import refused


def run(name, seeds=(1,), *, duration=60.0, **changes):
    """Records of 20 mrad, whose noise of a whole step makes rounding independent noise."""
    own = {"hand_controller": replace(LARGE_MOTION, gain=0.02), "specimen": Specimen(resolver_noise=5.0), **changes}
    scenario = replace(load(name), duration=duration, **own)
    return list(simulate([replace(scenario, seed=seed) for seed in seeds]))


def thorough(*values):
    """Parameters of a test that runs with the thorough ones."""
    return pytest.param(*values, marks=pytest.mark.thorough)


@pytest.fixture(scope="module")
def sliding():
    """The yaw joint without friction: as linear as the arm gets."""
    return run("siso-5-shoulder_yaw", chain=QUIET)[0]


@pytest.fixture(scope="module")
def floors(sliding):
    """Those of the yaw joint without friction."""
    return attainable(sliding)


@pytest.mark.slow
def test_on_a_linear_joint_all_floors_are_the_recorder_noise(sliding, floors):
    noise = float(np.hypot(1e-4, 2 * np.pi / 2**16 / np.sqrt(12)))
    assert floors.joint == "shoulder_yaw"
    assert floors.samples == 3000
    floor = floors.simulation.any_model.rmse
    assert floor == pytest.approx(noise, rel=3 / np.sqrt(2 * floors.samples))
    for other in (floors.simulation.small_signal, floors.simulation.best_linear, floors.right_order):
        assert other.rmse == pytest.approx(floor, rel=2e-3)
    for other in (floors.one_step.any_model, floors.one_step.small_signal, floors.one_step.best_linear):
        assert other.rmse == pytest.approx(floor, rel=2e-2)
    assert floors.distortion < 1e-6
    assert floors.simulation.any_model.fit == pytest.approx(100 * (1 - floor / sliding.iodata().y.std()))


@pytest.mark.slow
def test_without_noise_nothing_is_left(floors):
    ideal = attainable(run("siso-5-shoulder_yaw", duration=20.0, chain=IDEAL)[0], steps=10)
    assert ideal.simulation.any_model.rmse == 0.0
    assert ideal.simulation.any_model.fit == 100.0
    assert ideal.simulation.best_linear.rmse == pytest.approx(ideal.distortion)
    assert ideal.simulation.best_linear.rmse < 1e-2 * floors.simulation.best_linear.rmse


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore::sysid.SysidWarning")
@pytest.mark.parametrize(
    ("name", "changes"),
    [
        ("siso-5-shoulder_yaw", {"chain": QUIET}),
        thorough("siso-5-elbow_pitch", {"chain": Chain()}),
        ("siso-5-shoulder_yaw", {"chain": Chain(), "plant": Plant(process_noise=0.005)}),
    ],
)
def test_no_estimator_goes_below_on_fresh_data(name, changes):
    train, fresh = run(name, (1, 2), duration=16.0, **changes)
    data, record, floors = train.iodata().detrend(), fresh.iodata().detrend(), attainable(fresh, steps=10)
    for fit in compare([oe(data, 5, 5), armax(data, 4, 4, 4)], record):
        for estimated, horizon in ((fit.simulated, floors.simulation), (fit.predicted, floors.one_step)):
            for floor in (horizon.any_model, horizon.best_linear):
                # The initial state is fitted to the fresh record, and its mean is taken off.
                assert error(record, estimated) > floors.by_chance(floor.rmse, 7)


@pytest.mark.slow
def test_a_sufficient_model_reaches_them_on_fresh_data(sliding):
    fresh = run("siso-5-shoulder_yaw", (2,), chain=QUIET)[0]
    record, floors = fresh.iodata().detrend(), attainable(fresh, steps=10)
    best = error(record, compare(oe(sliding.iodata().detrend(), 5, 5), record)[0].simulated)
    assert best < 1.01 * floors.simulation.any_model.rmse


@pytest.mark.slow
def test_process_noise_parts_simulation_from_prediction(floors):
    """The right predictor is that with the true K; a simulation cannot know what the drives did."""
    noisy = run("siso-5-shoulder_yaw", chain=QUIET, plant=Plant(process_noise=0.01))[0]
    shaken = attainable(noisy, steps=10)
    assert shaken.provenance["noise-free angles"] == "simulated anew without process noise"
    assert shaken.simulation.any_model.rmse > 2 * shaken.one_step.small_signal.rmse
    assert shaken.simulation.small_signal.rmse == pytest.approx(shaken.simulation.any_model.rmse, rel=0.01)
    assert shaken.one_step.small_signal.rmse == pytest.approx(shaken.one_step.best_linear.rmse, rel=0.02)
    assert shaken.one_step.small_signal.rmse > 1.2 * shaken.one_step.any_model.rmse
    # What is simulated anew is what the arm does without that noise.
    assert shaken.distortion == pytest.approx(floors.distortion, rel=1e-6)


@pytest.mark.slow
def test_friction_is_left_over_by_linear_systems_in_the_right_sequence():
    log = run("siso-5-shoulder_yaw", duration=30.0, chain=Chain(), hand_controller=LARGE_MOTION)[0]
    floors = attainable(log)
    sequence = [
        floors.simulation.any_model,
        floors.simulation.best_linear,
        floors.right_order,
        floors.simulation.small_signal,
    ]
    assert all(a.rmse < b.rmse and a.fit > b.fit for a, b in pairwise(sequence))
    assert floors.simulation.small_signal.rmse > 5 * floors.simulation.any_model.rmse
    left = np.sqrt(floors.simulation.best_linear.rmse**2 - floors.simulation.any_model.rmse**2)
    assert floors.distortion == pytest.approx(left, rel=0.1)


@pytest.mark.thorough
def test_a_long_regression_from_another_record_does_not_beat_the_best_linear_system():
    """Sticking joints distort what a system of high order takes along where a file repeats within its memory."""
    train, fresh = run("siso-5-shoulder_yaw", (1, 2), chain=Chain(), plant=Plant(friction_level=8.0))
    floors, record = attainable(fresh), fresh.iodata().detrend()
    assert floors.settling < 200 < floors.memory == 2 * floors.settling
    long = arx(train.iodata().detrend(), 200, 200)
    simulated, predicted = (error(record, predict(long, record, steps=steps)) for steps in (None, 1))
    # Such a model comes near, far below systems of the truth's order, so that the floor is no empty one.
    fitted = 200 + 1
    for own, horizon in ((simulated, floors.simulation), (predicted, floors.one_step)):
        assert floors.by_chance(horizon.best_linear.rmse, fitted) < own < 1.2 * horizon.best_linear.rmse
    assert floors.right_order.rmse > 2 * simulated
    assert floors.mean_error == 0.0


@pytest.mark.thorough
def test_where_process_noise_shakes_friction_the_floor_is_that_of_the_mean_response():
    """A stuck joint creeps under noise; the motion without noise is not what to expect."""
    plant = Plant(process_noise=0.05, friction_level=20.0)
    log = run("siso-5-shoulder_yaw", duration=20.0, chain=Chain(), plant=plant)[0]
    floors = attainable(log, steps=10)
    assert floors.provenance["noise-free angles"] == "mean of 8 draws of process noise"
    still, variance = conditional_mean(
        load_arm(plant=replace(plant, process_noise=0.0), specimen=Specimen(resolver_noise=5.0)),
        load_arm().pose(log.provenance["pose"]),
        log.commanded,
        draws=2,
        seed=0,
    )
    assert np.abs(variance).max() < 1e-30
    assert floors.simulation.any_model.rmse < 0.95 * error(log.iodata(), still[:, 1:2])
    assert 0.0 < floors.mean_error < 0.6 * floors.simulation.any_model.rmse


@pytest.mark.slow
def test_several_axes_need_a_name_and_count_every_command():
    both = Scenario("both", ("shoulder_pitch", "elbow_pitch"), load("siso-5-elbow_pitch").excitation, 20.0, chain=QUIET)
    log = simulate([both])[0]
    refused("excites shoulder_pitch, elbow_pitch: name the joint", attainable, log)
    one = attainable(log, "shoulder_pitch", steps=10)
    assert one.parameters[0] == 2 * (one.memory + 1) + 1


@pytest.mark.slow
def test_the_window_is_not_scored(sliding):
    floors = attainable(sliding, window=1000, steps=10)
    error = sliding.measured[1000:, 1] - sliding.true_angles[999:-1, 1]
    assert floors.samples == 2000
    assert floors.simulation.any_model.rmse == pytest.approx(np.sqrt(np.mean(error**2)), rel=1e-12)


@pytest.mark.thorough
def test_a_few_steps_find_nearly_what_a_long_search_finds(sliding, floors):
    """Nothing else depends on the search, and what it was is said."""
    quick = attainable(sliding, steps=10)
    assert floors.right_order.rmse <= quick.right_order.rmse < 1.05 * floors.right_order.rmse
    assert quick.right_order.rmse < quick.simulation.small_signal.rmse
    assert quick.simulation.any_model == floors.simulation.any_model
    assert quick.provenance["steps of each search for the right order"] == "10"


@pytest.mark.slow
def test_chance_is_that_of_chi_square(floors):
    """A constant fitted to white noise undercuts by one degree of freedom; nothing else is claimed."""
    rng = np.random.default_rng(0)
    noise = rng.standard_normal((2000, floors.samples))
    fitted = noise - noise.mean(axis=1, keepdims=True)
    floor = np.sqrt(np.mean(noise**2, axis=1))
    undercut = [np.sqrt(np.mean(e**2)) < floors.by_chance(f) for e, f in zip(fitted, floor, strict=True)]
    assert np.mean(undercut) == pytest.approx(0.05, abs=0.015)


@pytest.mark.slow
def test_refusals(sliding):
    off, still = sliding.status.copy(), sliding.measured.copy()
    off[5], still[:, 6] = 16, 0.3
    cases = (
        (sliding, {"window": 3000}, "window = 3000 given, expected 0 to 2999"),
        (sliding, {"window": 2900}, r"100 samples to score, expected \d+ or more"),
        (replace(sliding, status=off), {}, "a shutdown, or work in contact, has no linear truth"),
        (replace(sliding, measured=still), {"joint": "wrist_roll"}, "wrist_roll does not move"),
    )
    for log, options, message in cases:
        refused(message, attainable, log, **options)
    refused("unknown joint", attainable, sliding, "knee")
    refused("provenance lacks variant, payload, pose, friction", attainable, replace(sliding, provenance={}))


@pytest.mark.thorough
def test_servo_valves_rest_beside_their_command_and_the_floor_counts_from_there():
    """Loaded valves rest about a milliradian off the command, several times what the drives' noise leaves."""
    plain, noisy = (
        run("siso-5-elbow_pitch", duration=16.0, chain=QUIET, plant=Plant(actuator="orifice", process_noise=noise))[0]
        for noise in (0.0, 0.002)
    )
    quiet, floors = attainable(plain, steps=10), attainable(noisy, steps=10)
    assert floors.provenance["noise-free angles"] == "mean of 8 draws of process noise"
    assert abs(plain.true_angles[0, 3] - plain.commanded[0, 3]) > 5e-4
    # Simulated anew, the arm does on average what it did without that noise; what is left is noise without an offset.
    assert 0.0 < floors.mean_error < 1e-4
    true = noisy.true_angles[1:, 3] - plain.true_angles[1:, 3]
    expected = np.hypot(np.sqrt(np.mean(true**2)), quiet.simulation.any_model.rmse)
    assert floors.simulation.any_model.rmse == pytest.approx(expected, rel=0.05)


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore::sysid.SysidWarning")
@pytest.mark.parametrize(
    ("joint", "plant"),
    [
        ("shoulder_pitch", Plant()),
        thorough("elbow_pitch", Plant(process_noise=0.001)),
        thorough("shoulder_pitch", Plant(friction="coulomb", oil_temperature=15.0, process_noise=0.001)),
        thorough("elbow_pitch", Plant(actuator="orifice")),
        thorough("shoulder_pitch", Plant(actuator="orifice", process_noise=0.001)),
        thorough("elbow_pitch", Plant(actuator="orifice", supply_pressure=16.0, process_noise=0.002)),
    ],
)
def test_no_linear_system_goes_below_the_floor_of_any_model(joint, plant):
    floors = attainable(run(f"siso-5-{joint}", duration=14.0, chain=Chain(), plant=plant)[0])
    # The mean is fitted to the very record.
    allowed = floors.by_chance(floors.simulation.any_model.rmse, 1)
    for floor in (floors.simulation.best_linear, floors.simulation.small_signal):
        assert floor.rmse > allowed
    # So are numerator and denominator of the model of the right order.
    assert floors.right_order.rmse > floors.by_chance(floors.simulation.any_model.rmse, 1 + 2 * floors.order)
