import numpy as np
import pytest

from scenarios.estimators.task import STRUCTURES
from scenarios.files.errors import ScenarioError
from scenarios.problems.problem import Periodic
from scenarios.problems.registry import problem
from scenarios.problems.twin_name import twin_name
from scenarios.problems.twin_problem import twin_problem
from sysid import IOData
from sysid.models.predict import simulate

ELBOW = "twin-nominal-elbow_pitch-multisine-10mrad"


@pytest.mark.parametrize("text", [ELBOW, f"{ELBOW}-w3", f"{ELBOW}-w3@1024", "twin-published-wrist_roll-prbs-67.5mrad"])
def test_a_name_says_all_of_a_problem(text):
    assert str(twin_name(text)) == text
    assert problem(text).name == text


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("twin-nominal-elbow-multisine-10mrad", "did you mean 'elbow_pitch'"),
        ("twin-nominal-shoulder_roll-multisine-10mrad", "unknown joint"),
        ("twin-other-elbow_pitch-multisine-10mrad", "unknown variant"),
        ("twin-nominal-elbow_pitch-noise-10mrad", "unknown excitation"),
        ("twin-nominal-elbow_pitch-multisine-10", "expected a problem of the twin"),
        (f"{ELBOW}@600", "periods of 256"),
        (f"{ELBOW}@256", "two or more periods"),
        (f"{ELBOW}@0", "0 samples"),
        ("twin-nominal-elbow_pitch-multisine-0mrad", "above 0"),
    ],
)
def test_what_is_no_name_is_refused(text, said):
    with pytest.raises(ScenarioError, match=said):
        problem(text)


def test_waveforms_belong_to_class_and_number_whatever_the_length():
    name = twin_name(f"{ELBOW}-w3")
    assert name.waveform_seed(1) == name.waveform_seed(2) == twin_name(f"{ELBOW}-w3@1024").waveform_seed(1)
    assert name.waveform_seed(1) != twin_name(f"{ELBOW}-w4").waveform_seed(1)
    assert twin_name(ELBOW).waveform_seed(1) != twin_name(ELBOW).waveform_seed(2)


def test_tasks_of_every_structure_have_the_delay_of_the_joint():
    asked = problem(ELBOW)
    assert asked.task(None).structure == "armax"
    for structure, names in STRUCTURES.items():
        task = asked.task(structure)
        assert set(task.orders) == set(names)
        assert task.orders.get("nk", 2) == asked.joint_truth.delay_samples == 2
        assert asked.task(structure, "select").chooses
    assert asked.task("oe", "underfit").orders["nf"] == asked.task("oe").orders["nf"] - 1
    assert asked.bound("oe") is None


def test_the_response_without_a_model_is_that_of_a_linear_system():
    asked = twin_problem(f"{ELBOW}-w0")
    assert isinstance(asked, Periodic)
    rng = np.random.default_rng(1)
    u = np.tile(rng.standard_normal(asked.parsed.period), 3)[:, None]
    y = simulate(asked.truth.input_path(), u)
    record = IOData(u, np.asarray(y), 0.02, window=asked.parsed.period)
    expected = asked.truth.frequency_response(asked.frequencies)
    np.testing.assert_allclose(asked.nonparametric(record), expected, rtol=1e-6)


def test_an_estimate_as_good_as_any_scatters_about_the_best_linear_truth():
    asked = twin_problem("twin-nominal-elbow_pitch-multisine-40mrad")
    best = asked.best_linear
    models = [asked.scattered(seed) for seed in range(80)]
    assert all(model.is_stable() for model in models)
    responses = np.array([model.frequency_response(asked.frequencies)[:, 0, 0] for model in models])
    error, scatter = np.abs(responses.mean(0) - best.response) ** 2, responses.var(0, ddof=1)
    expected = np.sum(best.distortion_variance + best.noise_variance / 2)
    assert np.sum(scatter) == pytest.approx(expected, rel=0.35)
    assert np.sum(error) < 3e-5 * np.sum(np.abs(best.response) ** 2)
    repeats = [twin_problem("twin-nominal-elbow_pitch-multisine-40mrad-w1").scattered(seed) for seed in range(60)]
    of_noise = np.array([model.frequency_response(asked.frequencies)[:, 0, 0] for model in repeats]).var(0, ddof=1)
    assert np.sum(of_noise) == pytest.approx(np.sum(best.noise_variance / 2), rel=0.4)
