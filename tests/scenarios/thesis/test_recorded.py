"""What the package records of many seeds holds: a study of one of them concludes the same, and another arm does not."""

import warnings
from dataclasses import replace

import numpy as np
import pytest

import hmtb_twin.arm.arm
from hmtb_twin import simulate
from hmtb_twin.parameters.arm_description import ArmDescription
from hmtb_twin.parameters.plant import Plant
from hmtb_twin.parameters.servo_gains import ServoGains
from scenarios.experiments.campaign import campaign_scenario
from scenarios.experiments.log_review import prepared
from scenarios.experiments.model_structures import STRUCTURES
from scenarios.identification.methods import estimate
from scenarios.thesis.finding import CLAIMS, Finding
from scenarios.thesis.frequencies import frequency_text, source_text
from scenarios.thesis.monte_carlo import MethodBandwidth, recorded, tally
from sysid import SysidWarning

SEED = 1
JOINT = "shoulder_pitch"  # the friction of the yaw would hide its servo


ROUNDING, DIGITS = 0.01, 1e-6
"""Rounding on another machine changes a number by less than this fraction of the range over the seeds, or of its "
"value."""


def contradictions(outcome, reference):
    """Lines for verdicts that are not the recorded ones of the seed, and for numbers outside those of all seeds."""
    (before,) = (entry for entry in reference.outcomes if entry.seed == outcome.seed)
    for key in sorted({*before.verdicts, *outcome.verdicts}, key=lambda name: int(name[1:])):
        verdicts = before.verdicts.get(key, "not recorded"), outcome.verdicts.get(key, "not tried")
        if verdicts[0] != verdicts[1]:
            yield f"{key}: {verdicts[1]}, recorded of seed {outcome.seed}: {verdicts[0]}"
    yield from _outside(_numbers(outcome), [_numbers(entry) for entry in reference.outcomes])


def _numbers(outcome):
    """Every number of an outcome by a unique name."""
    of_findings = {f"{key} {name}": value for key, part in outcome.numbers.items() for name, value in part.items()}
    of_methods = {
        f"bandwidth of {joint}, {method}, {what}": value
        for joint, methods in outcome.recovered.items()
        for method, entry in methods.items()
        for what, value in (
            ("Hz", entry.hz),
            ("lower end", entry.ci95[0]),
            ("upper end", entry.ci95[1]),
            ("0.707 at", entry.half_power_hz),
        )
    }
    true = {f"bandwidth of {joint}, truth": value for joint, value in outcome.true_hz.items()}
    return {**of_findings, **of_methods, **true}


def _outside(numbers, reference):
    names = dict.fromkeys(name for entry in reference for name in entry)
    for name in {**names, **numbers}:
        values = [entry[name] for entry in reference if name in entry]
        if name not in numbers:
            if len(values) == len(reference):
                yield f"{name}: not there, but with every seed recorded"
        elif not values:
            yield f"{name}: {numbers[name]:.6g}, not recorded"
        else:
            if np.isnan(numbers[name]):
                if not np.isnan(values).any():
                    yield f"{name}: none, but with every seed recorded"
                continue
            low, high = np.nanmin(values), np.nanmax(values)
            room = ROUNDING * (high - low) + DIGITS * max(abs(low), abs(high))
            # The first comparison handles values that are infinite with some seed, such as ends of intervals.
            if numbers[name] not in values and not low - room <= numbers[name] <= high + room:
                yield f"{name}: {numbers[name]:.6g}, recorded {low:.6g} to {high:.6g}"


def bandwidths() -> dict[str, float]:
    """Bandwidths of the joint by two quick methods, from its PRBS test alone, as the fixed seed has it."""
    (log,) = simulate([campaign_scenario(f"siso-5-{JOINT}", seed=SEED)])
    data = prepared(log, JOINT)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", SysidWarning)
        by_name = {
            entry.method: estimate(data, entry.estimator, entry.orders)
            for entry in STRUCTURES[JOINT]
            if entry.method in ("oe", "okid")
        }
    return {method: float(entry.bandwidth().hz[0, 0]) for method, entry in by_name.items()}


@pytest.fixture
def stiffer_servo(monkeypatch):
    """An arm whose position gains are ten percent higher."""
    tuned = hmtb_twin.arm.arm.tuned_gains

    def stiffer(variant: ArmDescription, plant: Plant) -> dict[str, ServoGains]:
        return {name: own._replace(kp=1.1 * own.kp) for name, own in tuned(variant, plant).items()}

    monkeypatch.setattr(hmtb_twin.arm.arm, "tuned_gains", stiffer)
    hmtb_twin.arm.arm._load.cache_clear()
    yield
    hmtb_twin.arm.arm._load.cache_clear()


@pytest.mark.thorough
def test_a_fixed_seed_concludes_what_is_recorded_of_it(tmp_path):
    """Whole records of every test: when this fails on purpose, tests/benchmarks/findings.py makes the record anew."""
    (outcome,) = tally([SEED], tmp_path).outcomes
    assert tuple(contradictions(outcome, recorded())) == ()


@pytest.mark.slow
def test_records_of_the_joint_alone_agree():
    before, again = recorded().outcomes[SEED - 1].recovered[JOINT], bandwidths()
    assert again == pytest.approx({name: before[name].hz for name in again}, rel=1e-6)


@pytest.mark.thorough
def test_a_servo_that_is_ten_percent_stiffer_is_found_out(stiffer_servo):
    reference = recorded()
    before = reference.outcomes[SEED - 1]
    moved = {
        method: MethodBandwidth(
            hz, before.recovered[JOINT][method].ci95, False, before.recovered[JOINT][method].half_power_hz
        )
        for method, hz in bandwidths().items()
    }
    outcome = replace(before, recovered={**before.recovered, JOINT: moved})
    lines = tuple(contradictions(outcome, reference))
    assert any(line.startswith(f"bandwidth of {JOINT}, oe, Hz") for line in lines)
    assert any(line.startswith(f"bandwidth of {JOINT}, okid, Hz") for line in lines)


def test_a_verdict_that_flips_is_found_out():
    before = recorded().outcomes[SEED - 1]
    flipped = "not reproduced" if before.verdicts["F1"] != "not reproduced" else "reproduced"
    outcome = replace(before, verdicts={**before.verdicts, "F1": flipped})
    line = f"F1: {flipped}, recorded of seed {SEED}: {before.verdicts['F1']}"
    assert tuple(contradictions(outcome, recorded())) == (line,)


def test_every_seed_agrees_with_the_tally_that_it_is_in():
    for entry in recorded().outcomes:
        assert not list(contradictions(entry, recorded()))


def test_whole_records_of_seeds_from_one_on_came_to_an_end():
    reference = recorded()
    assert [entry.seed for entry in reference.outcomes] == list(range(1, 21))
    assert reference.duration is None
    assert not reference.failed
    assert not any(entry.failed for entry in reference.outcomes)
    assert reference.cost.times_physics < 4
    assert "not of this run" in source_text(reference)


@pytest.mark.parametrize("key", CLAIMS)
def test_another_seed_concludes_the_same_or_the_report_says_that_it_depends(key):
    frequency = recorded().frequency(key)
    assert frequency.seeds == len(recorded().outcomes)
    sentence = frequency_text(Finding(key, frequency.usual, {}, ""), recorded())
    if frequency.counts[frequency.usual] == frequency.seeds:
        assert sentence == f"same on {frequency.seeds} of {frequency.seeds} seeds"
    else:
        assert sentence.startswith("depends on the seed")
