"""What is not known of a condition is said, and never taken for another condition."""

from types import SimpleNamespace

import sysid
from hmtb_twin import linearize
from scenarios.experiments.campaign import NOMINAL, Condition
from scenarios.thesis.attribution import AS_IT_IS, CONDITIONS, GENTLE, SMOOTH, Attributions, attribute
from scenarios.thesis.campaign import Campaign
from scenarios.thesis.results import friction_in_words
from sysid import SysidError

NAME, JOINT = "siso-5-elbow_pitch", "elbow_pitch"
TRUTH = linearize(NOMINAL.arm())


def found(rough, smooth, failed):
    campaigns = Campaign(NOMINAL, TRUTH, rough, {}), Campaign(Condition(friction=False), TRUTH, smooth, failed)
    return attribute(JOINT, *campaigns, (2, 2, 1))


def test_a_record_that_is_missing_is_named_and_the_others_keep_their_places(synthetic_logs):
    logs = synthetic_logs([NAME, f"{NAME}-small"])
    whole = found({NAME: logs[NAME]}, logs, {})
    assert tuple(part.label for part in whole.parts) == CONDITIONS
    assert not whole.missing
    part = found({NAME: logs[NAME]}, {f"{NAME}-small": logs[f"{NAME}-small"]}, {NAME: "the drives stalled"})
    assert [entry.label for entry in part.parts] == [AS_IT_IS, GENTLE]
    assert part.find(SMOOTH) is None
    assert part.find(GENTLE).bandwidth_hz == whole.find(GENTLE).bandwidth_hz
    assert list(part.missing) == [SMOOTH]
    assert "the drives stalled" in part.missing[SMOOTH]


def test_a_record_that_gives_no_model_is_named(synthetic_logs, monkeypatch):
    logs = synthetic_logs([NAME, f"{NAME}-small"])
    oe = sysid.oe

    def refuses(data, *orders, **options):
        if data.name.endswith("-small"):
            raise SysidError("too little motion")
        return oe(data, *orders, **options)

    monkeypatch.setattr(sysid, "oe", refuses)
    part = found({NAME: logs[NAME]}, logs, {})
    assert [entry.label for entry in part.parts] == [AS_IT_IS, SMOOTH]
    assert dict(part.missing) == {GENTLE: "too little motion"}


def study(**rows):
    """By joint and condition the bandwidth and where the gain is 0.707."""

    def models(parts):
        places = parts.items()
        return tuple(SimpleNamespace(label=name, bandwidth_hz=hz, half_power_hz=level) for name, (hz, level) in places)

    return SimpleNamespace(attribution={joint: Attributions(models(parts)) for joint, parts in rows.items()})


def test_friction_is_what_lies_between_the_first_two_conditions_and_no_others():
    whole = {AS_IT_IS: (0.9, 0.8), SMOOTH: (1.02, 1.0), GENTLE: (1.0, 1.6)}
    gap = {AS_IT_IS: (0.7, 0.9), GENTLE: (1.01, 1.8)}
    both = study(yaw=whole, elbow=gap)
    assert "by −20.0 to −20.0 %" in friction_in_words(both)
    assert "on 1 of 2 joints" in friction_in_words(both)


def test_where_nothing_is_known_it_is_said():
    rough = study(yaw={AS_IT_IS: (0.9, 0.8)}, elbow={})
    assert "is unknown: no joint has a model that reaches it both with friction and without" in friction_in_words(rough)


def test_friction_that_raises_is_not_said_to_lower():
    mixed = study(yaw={AS_IT_IS: (1.0, 0.9), SMOOTH: (1.0, 1.0)}, elbow={AS_IT_IS: (1.0, 1.1), SMOOTH: (1.0, 1.0)})
    assert "moves the frequency at which the gain is 0.707 by −10.0 to +10.0 %" in friction_in_words(mixed)
