"""Problems of the twin: their names, tasks, records, and the best linear truth that they compare with."""

from functools import partial
from unittest.mock import Mock

import numpy as np
import pytest
from scipy.stats import f

from scenarios.bench.amplitude_split import AMPLITUDES, JOINTS, multisine_class
from scenarios.bench.bandwidth import sequence_class
from scenarios.problems import twin_best_linear as module
from scenarios.problems import twin_records
from scenarios.problems.problem import common_frequencies
from scenarios.problems.registry import problem
from scenarios.problems.trial import Trial
from scenarios.problems.twin_best_linear import (
    TABLE_CLASSES,
    BestLinear,
    class_key,
    measured_best_linear,
    twin_best_linear,
)
from scenarios.problems.twin_name import twin_name
from scenarios.problems.twin_records import FOLDER, prepare, record_key
from sysid import IOData
from sysid.models.predict import simulate
from sysid.polynomial.structures import STRUCTURES
from tests.refusals import refused

ELBOW = "twin-nominal-elbow_pitch-multisine-10mrad"
LARGE = "twin-nominal-elbow_pitch-multisine-40mrad"


@pytest.mark.parametrize(
    "text", [ELBOW, f"{ELBOW}-w3", f"{ELBOW}-w3@1024", "twin-released-shoulder_roll-prbs-67.5mrad"]
)
def test_a_name_says_all_of_a_problem(text):
    assert str(twin_name(text)) == text
    assert problem(text).name == text


@pytest.mark.parametrize(
    ("text", "message"),
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
def test_what_is_no_name_is_refused(text, message):
    refused(message, problem, text)


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
        assert np.array_equal(task.frequencies, common_frequencies(0.02))
        assert set(task.orders) == set(names)
        assert task.orders.get("nk", 2) == asked.joint_truth.delay_samples == 2
        assert asked.task(structure, "select").chooses
    assert asked.task("oe", "underfit").orders["nf"] == asked.task("oe").orders["nf"] - 1
    assert asked.bound("oe") is None


def test_the_response_without_a_model_is_that_of_a_linear_system():
    asked = problem(f"{ELBOW}-w0")
    rng = np.random.default_rng(1)
    u = np.tile(rng.standard_normal(asked.parsed.period), 3)[:, None]
    y = simulate(asked.truth.input_path(), u)
    record = IOData(u, np.asarray(y), 0.02, window=asked.parsed.period)
    expected = asked.truth.frequency_response(asked.frequencies)
    np.testing.assert_allclose(asked.nonparametric(record), expected, rtol=1e-6)


@pytest.mark.slow
def test_an_estimate_as_good_as_any_scatters_about_the_best_linear_truth():
    asked = problem(LARGE)
    best = asked.best_linear
    models = [asked.scattered(seed) for seed in range(80)]
    assert all(model.is_stable() for model in models)
    responses = np.array([model.frequency_response(asked.frequencies)[:, 0, 0] for model in models])
    error, scatter = np.abs(responses.mean(0) - best.response) ** 2, responses.var(0, ddof=1)
    expected = np.sum(best.distortion_variance + best.noise_variance / 2)
    assert np.sum(scatter) == pytest.approx(expected, rel=0.35)
    assert np.sum(error) < 3e-5 * np.sum(np.abs(best.response) ** 2)
    repeats = [problem(f"{LARGE}-w1").scattered(seed) for seed in range(60)]
    of_noise = np.array([model.frequency_response(asked.frequencies)[:, 0, 0] for model in repeats]).var(0, ddof=1)
    assert np.sum(of_noise) == pytest.approx(np.sum(best.noise_variance / 2), rel=0.4)


TRIALS = (
    Trial(f"{ELBOW}-w0", 0),
    Trial(f"{ELBOW}-w0", 1),
    Trial(f"{ELBOW}-w1", 0),
    Trial("twin-nominal-shoulder_yaw-prbs-67mrad@200", 0),
)


@pytest.fixture
def fresh(monkeypatch):
    """Records of nobody else, and a way to forget those that there are."""
    monkeypatch.delenv(FOLDER, raising=False)
    twin_records._KEPT.clear()
    return twin_records._KEPT.clear


def drawn(trials):
    return [problem(trial.problem).draw(trial.seed(7)) for trial in trials]


def same(one, other):
    return np.array_equal(one.u, other.u) and np.array_equal(one.y, other.y) and one.window == other.window


@pytest.mark.slow
def test_a_record_has_the_same_bits_alone_in_a_batch_on_threads_and_from_a_file(fresh, tmp_path, monkeypatch):
    monkeypatch.setenv(FOLDER, str(tmp_path / "none yet"))
    assert prepare([*TRIALS, Trial("p1", 0)], 7, folder=tmp_path, threads=2) == len(TRIALS)
    together = drawn(TRIALS)
    assert prepare(TRIALS, 7, folder=tmp_path) == 0
    fresh()
    assert all(map(same, together, drawn(TRIALS))), "from files"
    monkeypatch.delenv(FOLDER)
    fresh()
    alone = drawn(TRIALS[:1] + TRIALS[3:])
    assert all(map(same, (together[0], together[3]), alone)), "alone"
    for record, trial in zip(together, TRIALS, strict=True):
        assert record.window == 256
        assert np.abs(np.concatenate([record.scored.u, record.scored.y]).mean(axis=0)).max() < 1e-6, trial
    waves = [record.scored.u - record.scored.u.mean() for record in together[:3]]
    assert np.std(waves[0] - waves[1]) < 0.15 * np.std(waves[0]) < np.std(waves[0] - waves[2]), "repeats and waveforms"
    assert not np.array_equal(together[0].y, together[1].y)


def test_a_file_is_taken_only_for_what_it_was_made_from(fresh, tmp_path, monkeypatch):
    trial = TRIALS[3]
    prepare([trial], 7, folder=tmp_path)
    (file,) = tmp_path.glob("*.npz")
    first = drawn([trial])[0]
    name = problem(trial.problem).parsed
    assert file.stem == record_key(name, trial.seed(7)) != record_key(name, trial.seed(8))
    monkeypatch.setattr(twin_records, "fingerprint", lambda: "other source")
    record_key.cache_clear()
    assert file.stem != record_key(name, trial.seed(7))
    monkeypatch.undo()
    record_key.cache_clear()
    fresh()
    monkeypatch.setenv(FOLDER, str(tmp_path))
    file.write_bytes(file.read_bytes()[:100])
    assert same(first, drawn([trial])[0]), "a damaged file is made anew"
    assert len(file.read_bytes()) > 1000


def test_the_table_holds_all_that_the_quick_figures_compare_with():
    quick = {multisine_class(joint, mrad) for joint in JOINTS for mrad in AMPLITUDES["quick"]}
    assert set(TABLE_CLASSES) == quick | {sequence_class(joint) for joint in JOINTS} == set(module._table())


@pytest.mark.slow
def test_a_measurement_of_today_agrees_with_the_table(monkeypatch):
    name = twin_name(LARGE)
    known = twin_best_linear(name)
    monkeypatch.setattr(module, "SEED", module.SEED + 1)
    today = measured_best_linear(name, realisations=3)
    np.testing.assert_allclose(today.frequencies, known.frequencies)
    variance = known.variance * (known.realisations / today.realisations) + known.variance
    ratio = np.mean(np.abs(today.response - known.response) ** 2 / variance)
    lines = len(known.frequencies)
    # a few lines go together, so the limits are those of half as many
    assert f.ppf(1e-4, lines, lines * 20) < ratio < f.isf(1e-4, lines, lines * 20)


def test_one_that_the_table_does_not_hold_is_measured_and_kept(monkeypatch, tmp_path):
    monkeypatch.setenv(FOLDER, str(tmp_path))
    monkeypatch.setattr(module, "REALISATIONS", 2)
    measure = Mock(wraps=partial(measured_best_linear, realisations=2))
    monkeypatch.setattr(module, "measured_best_linear", measure)
    name = twin_name("twin-nominal-elbow_pitch-multisine-30mrad")
    first = twin_best_linear(name)
    module._of_class.cache_clear()
    again = twin_best_linear(name)
    measure.assert_called_once_with(name)
    np.testing.assert_allclose(again.response, first.response, rtol=1e-4)
    assert list(tmp_path.glob(f"*{class_key(name)}*"))
    assert BestLinear.from_table(again.to_table()).bandwidth_hz == again.bandwidth_hz
