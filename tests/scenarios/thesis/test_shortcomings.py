"""What does not hold is collected from the study, nothing left out."""

from scenarios.thesis.shortcomings import shortcomings


def test_every_interval_that_misses_is_listed_with_its_distance(study):
    lists = shortcomings(study)
    models = [(name, model) for name, entry in study.joints.items() for model in entry.models.values()]
    assert lists.identified == len(models)
    assert {(miss.joint, miss.label) for miss in lists.missed_intervals} == {
        (n, m.label) for n, m in models if not m.covers
    }
    assert all(miss.half_widths > 1.0 for miss in lists.missed_intervals)
    distances = [abs(miss.percent) for miss in lists.missed_intervals]
    assert distances == sorted(distances, reverse=True)


def test_printed_models_far_from_1_hz_are_listed(study):
    lists = shortcomings(study)
    assert lists.printed == 8
    assert {model.label for joint, model in lists.printed_far if joint == "shoulder_yaw"} == {
        model.label for model in study.joints["shoulder_yaw"].published
    }
