import numpy as np
import pytest

from scenarios.problems import twin_records
from scenarios.problems.registry import problem
from scenarios.problems.trial import Trial
from scenarios.problems.twin_records import FOLDER, prepare, record_key

ELBOW = "twin-nominal-elbow_pitch-multisine-10mrad"
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
