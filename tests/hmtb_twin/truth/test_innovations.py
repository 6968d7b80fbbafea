from dataclasses import replace
from itertools import product

import numpy as np
import pytest
from scipy.stats import binom

import sysid
from hmtb_twin import IDEAL, JOINTS, Plant, linearize, load_arm, simulate
from hmtb_twin.bus.recorder import read_resolvers
from hmtb_twin.parameters.values import RECORDER
from hmtb_twin.truth.innovations import innovations_form
from sysid import IOData, StateSpace
from tests.refusals import refused

# What all of them set up takes seconds.
pytestmark = pytest.mark.slow

NOISY = Plant(friction="viscous", process_noise=0.005)
MOVING = JOINTS[1:]
ELBOW = "elbow_pitch"


@pytest.fixture(scope="module")
def noisy():
    return linearize(load_arm(plant=NOISY), amplitudes=())


@pytest.fixture(scope="module")
def records(experiment, noisy):
    """Records of all moving joints at 3 mrad, without any imperfection but those of drives and resolvers."""
    chain = replace(IDEAL, friction=True, resolver=True)
    kind = experiment(axes=MOVING, duration=15.0, amplitude=0.05, plant=NOISY, chain=chain)
    logs = simulate([replace(kind, name=f"noise {seed}", seed=seed) for seed in range(16)])
    return [IOData((log.commanded - noisy.angles)[:, 1:], (log.measured - noisy.angles)[:, 1:], log.dt) for log in logs]


@pytest.mark.parametrize(("a", "q", "r"), [(0.9, 0.3, 2.0), (1.5, 1.0, 1.0)])
def test_one_state_stable_or_growing_has_the_closed_form(a, q, r):
    form = innovations_form(StateSpace([[a]], [[1.0]], [[1.0]], [[0.0]], None, 0.02), np.sqrt([[q]]), np.array([[r]]))
    # p^2 + p (r (1 - a^2) - q) - q r = 0
    half = 0.5 * (q - r * (1 - a * a))
    p = half + np.sqrt(half * half + q * r)
    assert form.K[0, 0] == pytest.approx(a * p / (p + r), rel=1e-12)
    assert form.innovation_covariance[0, 0] == pytest.approx(p + r, rel=1e-12)


def assert_spectrum(form, driven, R, f, within=1e-8):
    """Check that the noise of an innovations form has the spectrum of drives and resolvers."""
    shaped = form.noise_response(f)
    spectrum = shaped @ form.innovation_covariance @ shaped.conj().swapaxes(1, 2)
    expected = driven @ driven.conj().swapaxes(1, 2) + R
    powers = np.einsum("fii->fi", expected).real
    assert (np.abs(spectrum - expected) / np.sqrt(np.einsum("fi,fj->fij", powers, powers))).max() < within


@pytest.mark.parametrize(
    ("variant", "actuator"),
    [("nominal", "linear"), ("nominal", "orifice"), ("flight", "linear"), ("published", "linear")],
)
def test_every_level_of_noise_has_its_noise_model(variant, actuator):
    plant = Plant(actuator=actuator, friction="viscous", process_noise=1.0)
    truth, f = linearize(load_arm(variant, plant=plant), amplitudes=()), np.geomspace(0.01, 24.9, 40)
    path, drives = replace(truth.model, K=None), truth.disturbances.drives
    unit = replace(path, B=drives).frequency_response(f)
    for level, outputs in product((3e-9, 1e-5, 1e-4, 1e-2, 1.0), (range(7), [3], [5, 1])):
        R = truth.disturbances.resolvers[np.ix_(outputs, outputs)]
        some = StateSpace(path.A, path.B, path.C[outputs], path.D[outputs], None, path.dt)
        form = innovations_form(some, level * drives, R)
        # Servo valves have rates from 0.1 /s of mean pressures to 1000 /s of spools: rounding shows.
        assert_spectrum(form, level * unit[:, outputs], R, f, 3e-8 if actuator == "orifice" else 1e-8)
        # Little noise moves the gain by its variance, but for the square of it: no digits of K are lost in R.
        if level == 3e-9:
            twice = innovations_form(some, 2.0 * level * drives, R)
            np.testing.assert_allclose(twice.K, 4.0 * form.K, atol=1e-4 * np.abs(form.K).max())


@pytest.mark.parametrize("measured", [JOINTS, (ELBOW,), ("wrist_roll", "shoulder_yaw")])
def test_subsets_keep_the_spectrum_of_the_noise_and_name_their_channels(noisy, measured):
    outputs, f = [JOINTS.index(name) for name in measured], np.geomspace(0.01, 24.9, 60)
    form = noisy.subset((ELBOW, "wrist_yaw"), measured)
    driven = replace(noisy.model, B=noisy.disturbances.drives).frequency_response(f)[:, outputs]
    assert_spectrum(form, driven, noisy.disturbances.resolvers[np.ix_(outputs, outputs)], f)
    assert np.abs(np.linalg.eigvals(form.A - form.K @ form.C)).max() < 1.0
    assert form.input_names == ("elbow_pitch commanded", "wrist_yaw commanded")
    assert form.output_names == tuple(f"{name} measured" for name in measured)
    np.testing.assert_array_equal(form.B, noisy.model.B[:, [3, 5]])


def test_one_joint_alone_knows_less_than_all_together_and_its_minimal_model_keeps_its_noise(noisy):
    f = np.geomspace(0.01, 24.9, 60)
    for name in MOVING:
        i, whole, joint = JOINTS.index(name), noisy.channel(name, name), noisy.joint(name)
        assert whole.innovation_covariance[0, 0] >= noisy.model.innovation_covariance[i, i]
        assert joint.model.order < whole.order
        np.testing.assert_allclose(joint.model.noise_response(f), whole.noise_response(f), atol=1e-6)
        np.testing.assert_allclose(joint.model.frequency_response(f), whole.frequency_response(f), atol=1e-7)
        assert joint.model.innovation_covariance == whole.innovation_covariance
    yaw, both = noisy.channel("wrist_yaw", "wrist_yaw"), noisy.subset(("wrist_yaw",), ("wrist_yaw", "shoulder_yaw"))
    assert both.innovation_covariance[0, 0] < yaw.innovation_covariance[0, 0]


def test_noise_leaves_the_path_of_the_commands_alone(noisy):
    quiet = linearize(load_arm(plant=replace(NOISY, process_noise=0.0)), amplitudes=())
    for matrix in ("A", "B", "C"):
        np.testing.assert_array_equal(getattr(quiet.model, matrix), getattr(noisy.model, matrix))
    for name in MOVING:
        np.testing.assert_allclose(quiet.joint(name).poles, noisy.joint(name).poles)
    assert not quiet.model.gain.any()
    np.testing.assert_array_equal(quiet.model.innovation_covariance, noisy.disturbances.resolvers)


@pytest.mark.thorough
def test_residuals_of_the_true_predictor_are_white_at_the_nominal_rate(noisy, records):
    model = noisy.subset(MOVING, MOVING)
    p = np.array([sysid.resid(model, record).whiteness_p for record in records])
    # The other commands are known, so that only noise is left of the coupling.
    elbows = [replace(record, y=record.y[:, [2]], output_names=None, output_units=None) for record in records]
    alone = noisy.subset(MOVING, (ELBOW,))
    for values in (p.ravel(), np.concatenate([sysid.resid(alone, record).whiteness_p for record in elbows])):
        rejected = int((values < 0.05).sum())
        assert binom.sf(rejected - 1, len(values), 0.05) > 1e-3
    # The test has power: a predictor without noise model fails it.
    blind = replace(model, K=None)
    assert (np.array([sysid.resid(blind, record).whiteness_p for record in records[:4]]) < 1e-6).all()


def test_innovation_covariance_is_that_of_the_records(noisy, records):
    model = noisy.subset(MOVING, MOVING)
    errors = np.vstack([sysid.residuals(model, record, x0=np.zeros(model.order))[50:] for record in records])
    # White innovations: (N S) is Wishart, its entries have variance (s_ii s_jj + s_ij^2) / N.
    S, N = model.innovation_covariance, len(errors)
    spread = np.sqrt((np.outer(np.diag(S), np.diag(S)) + S**2) / N)
    assert (np.abs(errors.T @ errors / N - S) < 4.0 * spread).all()
    assert (np.diag(S) > 1.3 * np.diag(noisy.disturbances.resolvers)[1:]).all()


def test_rounding_counts_as_uniform_noise():
    """Its variance is step^2/12 behind noise of a step at any angle, behind less noise where the arm moves."""
    rng, N = np.random.default_rng(0), 400_000
    noisy, moving = replace(RECORDER, noise=1e-4), rng.uniform(-0.01, 0.01, N)
    standing = [(np.full(N, fraction * RECORDER.resolver_step), noisy) for fraction in (0.0, 0.25, 0.5)]
    for angles, recorder in (*standing, (moving, RECORDER)):
        errors = read_resolvers(angles, rng.standard_normal(N), recorder, resolver=True) - angles
        variance = recorder.noise**2 + recorder.resolver_step**2 / 12.0
        assert errors.mean() == pytest.approx(0.0, abs=4 * np.sqrt(variance / N))
        assert errors.var() == pytest.approx(variance, rel=4 * np.sqrt(2 / N))


def test_noise_without_a_predictor_is_refused():
    unstable = StateSpace([[1.5]], [[1.0]], [[0.0]], [[0.0]], None, 0.02)
    refused("Riccati", innovations_form, unstable, np.array([[1.0]]), np.array([[1.0]]))
    refused("not positive definite", innovations_form, unstable, np.array([[1.0]]), np.array([[0.0]]))
