"""F27 to F31: verdicts follow from the commands, on studies of which the claim is true and of which it is not."""

from dataclasses import replace

import numpy as np
import pytest

from hmtb_twin import JOINTS, STUDIED_JOINTS
from scenarios.experiments.log_review import prepared
from scenarios.experiments.registry import names
from scenarios.thesis import findings_excitation as findings
from scenarios.thesis.nonparametric import PULSE, SINES
from sysid import IOData
from tests.scenarios.thesis.altered import with_joints, with_log, with_nonparametric
from tests.scenarios.thesis.conftest import joint_log

YAW = STUDIED_JOINTS[0]
T = 0.02 * np.arange(1000)


def _commanded(study, signal):
    """The study with one command in every test of both tables."""
    angles = np.tile(signal[:, None], (1, len(JOINTS)))
    logs = {name: joint_log(name, angles, angles, angles) for name in names("table2")}
    main = replace(study.campaign, logs={**study.campaign.logs, **logs})

    def data(result):
        records = {}
        for number, record in result.data.items():
            records[number] = prepared(joint_log(record.name, angles, angles, angles), result.joint)
        return {"data": records}

    return with_joints(replace(study, campaigns=(main, *study.campaigns[1:])), data)


@pytest.mark.parametrize(
    ("hz", "verdict"), [(2.0, "reproduced"), (10.0, "reproduced"), (11.0, "partly"), (20.0, "not reproduced")]
)
def test_the_power_of_the_commands_decides_on_their_band(study, hz, verdict):
    assert findings.limited_to_10_hz(_commanded(study, np.sin(2 * np.pi * hz * T))).verdict == verdict


def test_the_share_of_power_counts_both_lines():
    u = np.sin(2 * np.pi * 2.0 * T) + 2.0 * np.sin(2 * np.pi * 15.0 * T)
    record = IOData(u[:, None], u[:, None], 0.02)
    assert findings.share_of_power(record, 10.0) == pytest.approx(0.2)
    assert findings.share_of_power(record, 2.0) == pytest.approx(0.2), "the line at the limit is in"
    assert findings.share_of_power(record, 15.0) == pytest.approx(1.0)


def test_what_repeats_with_the_file_is_told_from_noise():
    """Lines of 15 Hz, and white noise, of which two fifths of the band lie below 10 Hz."""
    noise = np.random.default_rng(6).standard_normal(100_000)
    wave = np.sin(2 * np.pi * 15.0 * 0.02 * np.arange(100_000))
    for level, share in ((0.0, 1.0), (1.0, 0.5 / (0.5 + 0.6))):
        u = (wave + level * noise)[:, None]
        assert findings.repeating_share(IOData(u, u, 0.02), 100, 10.0) == pytest.approx(share, abs=0.02)


@pytest.mark.parametrize(
    ("sines", "sequence", "verdict"),
    [
        (4, 99, "reproduced by construction"),
        (6, 100, "reproduced by construction"),
        (3, 100, "partly"),
        (2, 50, "not reproduced"),
    ],
)
def test_orders_of_excitation_are_counted(study, sines, sequence, verdict):
    data_sets = {}
    for joint, sets in study.data_sets.items():
        excited = {}
        for name, order in sets.excited.items():
            number = name.removeprefix("siso-")[0]
            excited[name] = order._replace(command=sines, file=sequence if number in "56" else order.file)
        data_sets[joint] = replace(sets, excited=excited)
    assert findings.orders_of_excitation(replace(study, data_sets=data_sets)).verdict == verdict


@pytest.mark.parametrize(
    ("repeating", "hold", "verdict"),
    [(0.9, 2, "reproduced by construction"), (1.0, 2, "partly"), (0.999, 1, "not reproduced")],
)
def test_noise_and_hold_are_found_in_the_command(study, repeating, hold, verdict):
    changed = with_nonparametric(
        study,
        lambda joint, estimates: {
            "repeated": {
                **estimates.repeated,
                SINES: replace(
                    estimates.repeated[SINES], repeating=np.full(len(estimates.repeated[SINES].input), repeating)
                ),
            }
        },
    )
    for joint in STUDIED_JOINTS:
        log = study.campaign.log(f"siso-{SINES}-{joint}")
        fresh = np.random.default_rng(3).standard_normal(log.commanded.shape)
        held = np.repeat(fresh, hold, axis=0)[: len(log.commanded)]
        changed = with_log(changed, log.name, replace(log, commanded=held))
    decided = findings.noise_on_the_input(changed)
    assert decided.verdict == verdict
    assert decided.value[f"{YAW}, noise"] == pytest.approx(100 * np.sqrt(1.0 - repeating))
    assert decided.value[f"{YAW}, rests"] == pytest.approx(100 * (1 - 1 / hold), abs=0.2)


@pytest.mark.parametrize(("mean", "verdict"), [(0.0, "reproduced"), (0.05, "reproduced"), (0.5, "not reproduced")])
def test_a_mean_counts_beside_the_motion_about_the_start(study, mean, verdict):
    changed = study
    for joint in STUDIED_JOINTS:
        log = study.campaign.log(f"siso-5-{joint}")
        swing = np.resize([1.0, -1.0], len(log.commanded)) + mean
        changed = with_log(changed, log.name, replace(log, commanded=study.truth.angles + 0.01 * swing[:, None]))
    decided = findings.zero_mean(changed)
    assert decided.verdict == verdict
    assert decided.value[YAW] == pytest.approx(100 * mean**2 / (1 + mean**2), abs=0.01)


@pytest.mark.parametrize(
    ("lines", "verdict"),
    [
        ({1.0: 3.0, 3.0: 1.0}, "reproduced"),
        ({1.0: 1.0, 3.0: 0.9, 5.0: 0.8}, "partly"),
        ({1.0: 1.0, 3.0: 5.0}, "not reproduced"),
    ],
)
def test_the_strongest_line_and_the_power_of_the_pulse_decide(study, lines, verdict):
    def change(joint, estimates):
        spectra = estimates.repeated[PULSE]
        power = np.zeros(len(spectra.frequencies))
        for hz, density in lines.items():
            power[np.isclose(spectra.frequencies, hz)] = density
        return {"repeated": {**estimates.repeated, PULSE: replace(spectra, input=power)}}

    assert findings.pulse_around_1_hz(with_nonparametric(study, change)).verdict == verdict
