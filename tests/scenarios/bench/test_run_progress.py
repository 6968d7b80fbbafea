"""Journals of trials are resumed where they still count, and removed where they are outdated."""

from contextlib import closing

import numpy as np
import pytest

from scenarios.bench.job_runner import RecordJob, TrialResult
from scenarios.bench.measurement import Measurement
from scenarios.bench.run_progress import TrialJournal, file_name, pilot_jobs, problem_kind, remaining_cost
from scenarios.files.errors import ScenarioError
from scenarios.problems.trial import Trial

ESTIMATOR = {"name": "mine", "target": "a:b", "home": "", "program": False}
FINGERPRINT = {"estimator": ESTIMATOR, "source": "1", "software": "2", "seed": 0}
RESPONSE = np.array([[[1.0 + 2.0j]]])
TRIALS = [Measurement(Trial("p1", k), "model", response=RESPONSE, whiteness_p=0.1 * k) for k in range(3)]


def opened(folder, notes=None, name="mine", **changes):
    notify = [].append if notes is None else notes.append
    return closing(TrialJournal(folder, name, {**FINGERPRINT, **changes}, run="a", notify=notify))


def test_trials_are_there_again(tmp_path):
    with opened(tmp_path) as journal:
        for one in TRIALS:
            journal.add(one)
    with opened(tmp_path) as journal:
        assert (journal.run, journal.done) == ("a", {one.trial.key for one in TRIALS})
        assert str([m.to_table() for m in journal.measurements().values()]) == str([m.to_table() for m in TRIALS])
        with pytest.raises(ScenarioError, match="another process is at work here"):
            opened(tmp_path)


def test_hangs_at_the_end_are_counted(tmp_path):
    with opened(tmp_path) as journal:
        for draw, kind in enumerate(("hang", "model", "hang", "hang")):
            journal.add(Measurement(Trial("p1", draw), kind))
    with opened(tmp_path) as journal:
        assert journal.hangs == 2
        journal.add(Measurement(Trial("p1", 4), "hang", "given up after 2"))
        assert journal.hangs == 0


def test_an_outdated_journal_is_removed_unless_it_is_open(tmp_path):
    file = "mine: its file changed since the last run: its trials start again"
    software = "mine: this software, or a package that it uses, changed since the last run"
    for change, words in (({"source": "changed"}, file), ({"software": "changed"}, software)):
        notes = []
        with opened(tmp_path) as journal:
            journal.add(TRIALS[0])
            with opened(tmp_path, notes, **change):
                assert journal.path.exists() and not notes
        with opened(tmp_path, notes, **change) as other:
            other.add(TRIALS[0])
            assert not journal.path.exists()
        assert len(notes) == 1 and notes[0].startswith(words)
        other.path.unlink()


def test_journals_of_other_seeds_and_estimators_stay_and_empty_ones_go(tmp_path):
    notes = []
    with opened(tmp_path) as journal:
        journal.add(TRIALS[0])
    with opened(tmp_path, notes, seed=1), opened(tmp_path, notes, "mine-2", source="3"):
        pass
    assert notes == []
    assert list(tmp_path.iterdir()) == [journal.path]


def test_names_become_names_of_files():
    assert file_name("our-oe_2.1+x") == "our-oe_2.1+x"
    names = ["our oe/2 (n=3)", "our-oe/2 (n=3)", "../..", "\u03b1", "\u03b2"]
    files = [file_name(name) for name in names]
    assert len(set(files)) == 5 and files[0].startswith("our-oe-2-n-3-") and files[3].startswith("estimator-")


def test_the_first_job_of_each_kind_of_problem_predicts_the_cost():
    names = ("twin-a-w0", "twin-a-w1", "p1@300", "twin-a-w2", "p1", "twin-a-w3", "p1")
    first, others = pilot_jobs([RecordJob(name, draw, (("fit", 0),)) for draw, name in enumerate(names)])
    assert [problem_kind(job.problem) for job in first] == ["twin-a", "p1@300", "p1"]
    finished = [TrialResult(0, Measurement(Trial(job.problem, job.draw), "crash"), 1.0 + job.draw) for job in first]
    assert remaining_cost(finished, others, 2) == "4 requests, 8 s of one core, about 4 s with all workers"
