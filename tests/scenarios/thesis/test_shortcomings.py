"""What does not hold is collected from the study, nothing left out."""

from dataclasses import replace

from scenarios.thesis.finding import Finding
from scenarios.thesis.monte_carlo import recorded
from scenarios.thesis.report import shortcomings


def test_findings_fall_into_their_lists(study):
    entries = [
        Finding("F1", "reproduced", {}, "so"),
        Finding("F2", "partly", {}, "so"),
        Finding("F3", "not reproduced", {}, "so"),
        Finding("F4", "cannot be told", {}, "so"),
        Finding("F5", "depends on the reading", {}, "so"),
        Finding("F6", "reproduced by construction", {}, "so"),
    ]
    lists = shortcomings(replace(study, joints={}), entries)
    listed = {verdict: [entry.key for entry in found] for verdict, found in lists["findings"].items() if found}
    assert listed == {
        "partly": ["F2"],
        "depends on the reading": ["F5"],
        "not reproduced": ["F3"],
        "cannot be told": ["F4"],
    }
    assert (lists["intervals"], lists["misses"], lists["printed"]) == (0, [], 0)


def test_every_interval_that_misses_is_listed_with_its_distance(study):
    lists = shortcomings(study, ())
    models = [(name, model) for name, entry in study.joints.items() for model in entry.models.values()]
    assert lists["intervals"] == len(models)
    assert {(joint, label) for joint, label, *_ in lists["misses"]} == {(n, m.label) for n, m in models if not m.covers}
    assert all(widths > 1.0 for *_, widths in lists["misses"])
    distances = [abs(away) for *_, away, _ in lists["misses"]]
    assert distances == sorted(distances, reverse=True)


def test_printed_models_far_from_1_hz_are_listed(study):
    lists = shortcomings(study, ())
    assert lists["printed"] == 8
    assert {model.label for joint, model in lists["printed_far"] if joint == "shoulder_yaw"} == {
        model.label for model in study.joints["shoulder_yaw"].published
    }


def test_verdicts_that_most_seeds_contradict_are_listed(study):
    bare, many = replace(study, joints={}), recorded()
    other = "partly" if many.frequency("F15").usual != "partly" else "reproduced"
    entries = [
        Finding("F14", many.frequency("F14").usual, {}, "so"),
        Finding("F15", other, {}, "so"),
    ]
    turned = shortcomings(bare, entries, many)["turned"]
    assert [entry.key for entry, _ in turned] == ["F15"]
    assert turned[0][1].startswith("depends on the seed: of ")
    assert shortcomings(bare, entries)["turned"] == []
