"""Many seeds: what is kept of each, what is taken up again, and what the report says of them."""

import json
from dataclasses import dataclass, field, replace
from types import SimpleNamespace

import numpy as np
import pytest

from hmtb_twin import STUDIED_JOINTS
from scenarios.commands.cli import main
from scenarios.experiments.campaign import NOMINAL
from scenarios.experiments.model_structures import STRUCTURES
from scenarios.files.codec import structure, unstructure
from scenarios.files.errors import ScenarioError
from scenarios.jobs.journal import Journal
from scenarios.thesis import monte_carlo
from scenarios.thesis.campaign import EVERY_TEST
from scenarios.thesis.comparison import Cost
from scenarios.thesis.finding import CLAIMS, Finding
from scenarios.thesis.frequencies import answer_text, chance, finding_record, frequency_text, seeds_record, source_text
from scenarios.thesis.monte_carlo import MethodBandwidth, SeedOutcome, Tally, read_tally, spread, tally, write_tally
from tests.refusals import refused


def made(seed, verdict="reproduced", value=1.0, *, hz=1.0):
    """An outcome of one finding, with the same bandwidth everywhere."""
    bandwidth = MethodBandwidth(hz, (hz - 0.1, hz + 0.1), abs(hz - 1.0) <= 0.1, hz + 0.01)
    return SeedOutcome(
        seed=seed,
        duration=None,
        verdicts={"F1": verdict},
        numbers={"F1": {"shoulder_yaw": value}},
        true_hz=dict.fromkeys(STUDIED_JOINTS, 1.0),
        recovered={joint: {"oe": bandwidth} for joint in STUDIED_JOINTS},
        failed={},
        cost=Cost(10.0, 12.0, 20.0),
        versions={"hmtb-twin": "0.1.0", "mujoco": "4.0.0"},
    )


def whole(seed):
    """An outcome of every finding and method."""
    outcome = made(seed, value=1.0 / seed)
    return replace(
        outcome,
        verdicts=dict.fromkeys(CLAIMS, "partly"),
        numbers=dict.fromkeys(CLAIMS, outcome.numbers["F1"]),
        recovered={
            joint: {entry.method: outcome.recovered[joint]["oe"] for entry in STRUCTURES[joint]}
            for joint in STUDIED_JOINTS
        },
    )


def finding(verdict):
    return Finding("F1", verdict, {"shoulder_yaw": 1.0}, "because")


@dataclass(frozen=True)
class Study:
    """A study that was run at once."""

    logs: dict[str, object] = field(default_factory=dict)
    joints: dict[str, object] = field(default_factory=dict)
    failed: dict[str, str] = field(default_factory=dict)
    cost: Cost = Cost(10.0, 12.0, 20.0)  # noqa: RUF009


@pytest.fixture(scope="module")
def twenty():
    """Twenty seeds; the last two of them say partly, and the numbers are 1 to 20."""
    return Tally(tuple(made(n, "reproduced" if n <= 18 else "partly", float(n)) for n in range(1, 21)), {})


@pytest.fixture
def quick(monkeypatch):
    """Studies that are made up at once, and the seeds that were run."""
    run = []

    def one(seed, duration, threads, messages):
        run.append(seed)
        messages("simulate", 1, 1)
        if seed == 3:
            raise ScenarioError("the physics diverged")
        return replace(whole(seed), duration=duration)

    monkeypatch.setattr(monte_carlo, "_run_seed", one)
    return run


def test_every_number_survives_file_and_journal_to_the_last_bit(tmp_path):
    outcome = made(3, value=1 / 3, hz=0.1 + 0.2)
    odd = replace(outcome, duration=24.0, numbers={"F1": {"a": float("inf"), "b": 1e-300, "c": -float("inf")}})
    many = Tally((outcome, odd, whole(3)), {21: "why"})
    write_tally(many, tmp_path / "tally.json")
    again = read_tally((tmp_path / "tally.json").read_text())
    assert (again.outcomes, again.failed) == (many.outcomes, many.failed)
    assert "Infinity" not in (tmp_path / "tally.json").read_text()
    with Journal(tmp_path / "seeds.sqlite", {"format": "thesis seeds"}) as journal:
        for entry in many.outcomes:
            journal.add("key", unstructure(entry))
            assert structure(SeedOutcome, journal.get("key")) == entry


def test_a_seed_among_many_is_the_study_on_the_nominal_arm(monkeypatch, tmp_path):
    """Without what no finding rests on; that records do not depend on threads is tried with the simulation."""
    asked = {}

    def run_study(**settings):
        asked.update(settings)
        return Study()

    monkeypatch.setattr(monte_carlo, "run_study", run_study)
    monkeypatch.setattr(monte_carlo, "findings", lambda study: type(study).__name__)
    monkeypatch.setattr(
        monte_carlo, "outcome", lambda study, outcome: replace(made(11), failed={outcome: ""}, cost=study.cost)
    )
    (alone,) = tally([11], tmp_path, duration=24.0, threads=1).outcomes
    assert alone.failed == {"Study": ""}
    assert alone.cost.total_s > 20.0, "what findings take is counted"
    assert asked.pop("steps").total > 0
    assert asked == {"seed": 11, "duration": 24.0, "threads": 1, "conditions": (NOMINAL,), "thorough": False}


def test_a_failed_seed_is_counted_with_its_reason(quick, tmp_path):
    messages = []
    outcomes = tally([2, 3, 4], tmp_path, progress=lambda seed, before, *_: messages.append((seed, before)))
    assert [entry.seed for entry in outcomes.outcomes] == [2, 4]
    assert outcomes.failed == {3: "the physics diverged"}
    assert messages == [(2, 0), (3, 1), (4, 2)]
    assert "Seed 3 came to no conclusion: the physics diverged." in source_text(outcomes)
    refused("none of 1 seeds", tally, [3], tmp_path)


def test_what_was_done_is_taken_up_again(quick, tmp_path):
    first = tally([1, 2], tmp_path)
    assert quick == [1, 2]
    again = tally([1, 2, 4], tmp_path)
    assert quick == [1, 2, 4], "only the seed that was not there is run"
    assert again.outcomes[:2] == first.outcomes
    tally([1], tmp_path, duration=24.0)
    assert quick[3:] == [1], "records of another length are another study"


@pytest.mark.parametrize("what", ["versions", "fingerprint"])
def test_seeds_of_another_version_are_run_anew(quick, tmp_path, monkeypatch, what):
    tally([1], tmp_path)
    monkeypatch.setattr(monte_carlo, what, lambda: {"mujoco": "another"})
    tally([1], tmp_path)
    assert quick == [1, 1]


def test_an_interrupted_run_keeps_its_seeds_and_says_so(tmp_path, monkeypatch, capsys):
    def one(seed, *_):
        if seed == 6:
            raise KeyboardInterrupt
        return whole(seed)

    monkeypatch.setattr(monte_carlo, "_run_seed", one)
    assert main(["thesis", "--seeds", "20", "--seed", "5", "--out", str(tmp_path)]) == 130
    message = capsys.readouterr().err
    assert "saved in" in message and "hmtb thesis --seeds 20 --seed 5" in message
    with Journal(tmp_path / "seeds" / "seeds.sqlite", {"format": "thesis seeds"}) as journal:
        assert [key.split()[-1] for key, _ in journal.items()] == ["5"]
    assert not (tmp_path / "report.html").exists()


@pytest.mark.parametrize(
    ("words", "file", "folder"),
    [
        (("--figures",), "figures", ""),
        (("--figures",), "", "figures/gain.svg"),
        (("--seeds", "2"), "seeds", ""),
        (("--logs",), "", f"{EVERY_TEST[-1]}.nc"),
        ((), "", "report.html"),
    ],
)
def test_what_is_in_the_way_is_named_before_the_work(tmp_path, capsys, monkeypatch, words, file, folder):
    monkeypatch.setattr("scenarios.thesis.study.run_study", lambda **_: pytest.fail("the study was run"))
    if file:
        (tmp_path / file).touch()
    else:
        (tmp_path / folder).mkdir(parents=True)
    assert main(["thesis", *words, "--out", str(tmp_path)]) == 2
    error = capsys.readouterr().err
    assert "cannot write" in error
    assert error.count("\n") == 1


@pytest.fixture
def no_study(monkeypatch):
    """A study of one log that is run, judged and drawn at once."""
    logs = {"one": SimpleNamespace(name="one")}
    monkeypatch.setattr("scenarios.thesis.study.run_study", lambda **_: Study(logs))
    monkeypatch.setattr("scenarios.thesis.findings.findings", lambda study: ())
    monkeypatch.setattr("scenarios.thesis.report.write_report", lambda study, outcome, _, path, *__, **___: path)
    monkeypatch.setattr("scenarios.thesis.results.results", lambda *_: {"bandwidth": {}, "findings": {}})
    answer = SimpleNamespace(record=lambda: {"seeds": []})
    monkeypatch.setattr("scenarios.thesis.answer.measure_answer", lambda *_, **__: answer)
    monkeypatch.setattr("scenarios.thesis.answer.answer_texts", lambda *_: ("the answer", "not very"))


def test_a_seed_that_failed_is_a_difference(quick, no_study, tmp_path, capsys):
    assert main(["thesis", "--seeds", "2", "--out", str(tmp_path)]) == 0
    assert "failed:" not in capsys.readouterr().out
    assert main(["thesis", "--seeds", "3", "--out", str(tmp_path), "--overwrite"]) == 1
    assert "failed: seed 3: the physics diverged" in capsys.readouterr().out
    assert main(["thesis", "--seeds", "3", "--out", str(tmp_path), "--overwrite", "--json"]) == 1
    assert quick == [1, 2, 3, 3]


def test_results_are_there_before_the_logs(no_study, tmp_path, monkeypatch):
    def full(log, path):
        assert (tmp_path / "results.json").is_file()
        raise ScenarioError(f"cannot write {path}: No space left on device")

    monkeypatch.setattr("scenarios.files.data_file.write_log", full)
    assert main(["thesis", "--logs", "--out", str(tmp_path)]) == 2
    assert json.loads((tmp_path / "results.json").read_text()) == {
        "bandwidth": {},
        "findings": {},
        "answer": "the answer",
        "certainty": "not very",
        "responses": {"seeds": []},
    }


def test_verdicts_are_counted_and_numbers_ranged(twenty):
    frequency = twenty.frequency("F1")
    assert (frequency.usual, frequency.seeds, frequency.counts) == ("reproduced", 20, {"reproduced": 18, "partly": 2})
    assert frequency.depends_on_seed("reproduced"), "not every seed reaches it"
    same = Tally(twenty.outcomes[:18], {}).frequency("F1")
    assert not same.depends_on_seed("reproduced")
    limits = twenty.spread("F1")["shoulder_yaw"]
    assert (limits.low, limits.median, limits.high, limits.seeds) == (1.0, 10.5, 20.0, 20)
    assert np.isnan(spread([1.0, np.nan]).median)


def test_coverage_counts_intervals_that_hold_the_truth():
    coverage = Tally((made(1, hz=1.0), made(2, hz=1.05), made(3, hz=1.4)), {}).coverage()["elbow_pitch"]["oe"]
    assert (coverage.covers, coverage.near_1_hz, coverage.hz.median) == (2, 2, 1.05)
    assert coverage.ci95_width.high == pytest.approx(0.2)


def test_the_tally_says_when_a_verdict_depends_on_the_seed(twenty):
    assert frequency_text(finding("reproduced"), Tally(twenty.outcomes[:18], {})) == "same on 18 of 18 seeds"
    sentence = "depends on the seed: of 20 seeds 18 reproduced, 2 partly"
    assert frequency_text(finding("partly"), twenty) == frequency_text(finding("reproduced"), twenty) == sentence
    assert twenty.frequency("F1").against("partly")
    assert not twenty.frequency("F1").against("reproduced")
    half = Tally(tuple(made(n, "partly" if n % 2 else "reproduced") for n in range(10)), {})
    sentence = "depends on the seed: of 10 seeds 5 reproduced, 5 partly"
    assert frequency_text(finding("partly"), half) == sentence
    assert frequency_text(replace(finding("partly"), key="F2"), twenty) == ""


def test_the_source_of_the_frequencies_is_said(twenty):
    assert source_text(twenty).startswith("Frequencies and ranges are of 20 seeds (1 to 20)")
    shipped = source_text(Tally(twenty.outcomes, {}, recorded=True))
    assert "not of this run" in shipped
    assert "seed 7, which is that of this run" in source_text(Tally(twenty.outcomes, {}, recorded=True), 7)
    assert "not of this run" in source_text(Tally(twenty.outcomes, {}, recorded=True), 77)
    assert "recorded earlier, with hmtb-twin 0.1.0 and MuJoCo 4.0.0" in shipped
    gap = Tally((made(1), made(4)), {})
    assert "2 seeds (1, 4)" in source_text(gap)
    assert "of one seed (3) on the same arm" in source_text(Tally((made(3),), {}))
    assert source_text(replace(gap, failed={2: "It fell."})).endswith("Seed 2 came to no conclusion: It fell.")


def test_the_answer_says_how_often_it_comes_out():
    outcomes = Tally((made(1, hz=1.0), made(2, hz=1.6), made(3, hz=1.0)), {})
    assert answer_text(outcomes) == (
        "Over 3 seeds 6 of 9 bandwidths of 3 models are near 1 Hz, and 6 agree with the best linear truth."
    )


def test_the_report_names_verdicts_that_depend_and_those_that_most_seeds_contradict(twenty):
    assert chance([finding("reproduced")], None) == {}
    usual, other = chance([finding("reproduced")], twenty), chance([finding("partly")], twenty)
    assert (usual["depends"], usual["against"]) == (["F1"], [])
    assert (other["depends"], other["against"]) == (["F1"], ["F1"])


def test_results_carry_frequencies_and_cost(twenty):
    record = finding_record(finding("reproduced"), twenty)
    assert record["frequency"] == {
        "seeds": 20,
        "verdicts": {"reproduced": 18, "partly": 2},
        "depends_on_seed": True,
    }
    steady = finding_record(finding("reproduced"), Tally(twenty.outcomes[:18], {}))
    assert steady["frequency"]["depends_on_seed"] is False
    assert finding_record(replace(finding("partly"), key="F2"), twenty) == {}
    assert finding_record(finding("partly"), None) == {}
    whole = seeds_record(twenty)
    assert whole["of_this_run"] is True
    assert whole["cost"] == {"physics_s": 200.0, "total_s": 400.0, "ratio": 2.0}
