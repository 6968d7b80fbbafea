"""Findings on the excitation, F27 to F31: its band, its order, its noise and its mean [Morris1996, ch. II and III]."""

import numpy as np

from hmtb_twin import JOINTS
from scenarios.experiments.campaign import single_joint_test
from scenarios.experiments.log_review import settled
from scenarios.experiments.registry import load, names
from scenarios.files.errors import MissingRecordError
from scenarios.thesis.campaign import SAME_SEQUENCE
from scenarios.thesis.comparison import Comparison
from scenarios.thesis.finding import CLAIMS, Finding, decided_finding
from scenarios.thesis.findings_chapter_3 import spectrum_of
from scenarios.thesis.nonparametric import PRBS, PULSE, SINES
from sysid import IOData

TWO_SINES = (2, 3, 4)
"""Numbers of the single-joint tests with a sum of two sines [Morris1996, table 1]."""


def limited_to_10_hz(study: Comparison) -> Finding:
    """F27: all excitations were limited to 10 Hz, well below the Nyquist frequency."""
    limits = CLAIMS["F27"].limits
    # The commands as recorded, which is what the thesis analyses, not the files.
    commands: dict[str, dict[str, IOData]] = {"table 1": {}, "table 2": {}}
    for result in study.joints.values():
        for record in result.data.values():
            commands["table 1"][record.name] = record
    for name in names("table2"):
        if name in study.logs:
            commands["table 2"][name] = study.campaign.several(name)
    verdict_parts: dict[str, bool] = {}
    values: dict[str, float] = {}
    smallest: dict[str, float] = {}
    for table, records in commands.items():
        if not records:
            raise MissingRecordError(f"there is no record of {table}")
        for statement, hz in (("limited to 10 Hz", limits["fastest"]), ("well below Nyquist", limits["well"])):
            shares = {name: share_of_power(record, hz) for name, record in records.items()}
            verdict_parts[f"{statement} in {table}"] = min(shares.values()) >= limits["most"]
            values[f"{table}, up to {hz:g} Hz"] = 100 * min(shares.values())
            if hz == limits["fastest"]:
                smallest |= shares
    name = min(smallest, key=lambda record: smallest[record])
    record = {**commands["table 1"], **commands["table 2"]}[name]
    repeats = 100 * repeating_share(record, load(name).period, limits["fastest"])
    return decided_finding(
        "F27", verdict_parts, values, {"name": name, "repeats": repeats, "least": 100 * smallest[name]}
    )


def share_of_power(record: IOData, hz: float) -> float:
    """Return the share of the power of a record's inputs, without their means, up to a frequency in Hz."""
    # Every settled record holds whole periods of its file, but for noise: no window is needed.
    power = (np.abs(np.fft.rfft(record.u - record.u.mean(axis=0), axis=0)) ** 2).sum(axis=1)
    # Rounding shall not exclude the line at the limit.
    below = np.fft.rfftfreq(len(record), record.dt) <= hz + 1e-9
    return float(power[below].sum() / power.sum())


def repeating_share(record: IOData, period: int, hz: float) -> float:
    """Return the share of the inputs' power above a frequency, Hz, that repeats after a period, samples.

    NaN where nothing but rounding lies above.
    """
    periods = len(record) // period
    u = record.u[: periods * period]
    repeated = np.tile(u.reshape(periods, period, -1).mean(axis=0), (periods, 1))
    above = _power_above(IOData(u, u, record.dt), hz)
    if above <= np.finfo(float).eps * np.sum(u**2):
        return float("nan")
    return _power_above(IOData(repeated, repeated, record.dt), hz) / above


def _power_above(record: IOData, hz: float) -> float:
    """Sum of squares of a record's inputs above a frequency, Hz."""
    return float(np.sum((record.u - record.u.mean(axis=0)) ** 2) * (1.0 - share_of_power(record, hz)))


def orders_of_excitation(study: Comparison) -> Finding:
    """F28: a sum of two sines excites order four at least, the PRBS the order of its period."""
    limits = CLAIMS["F28"].limits
    # A sequence of zero mean lacks the line at 0 Hz.
    full_orders = (limits["period"], limits["period"] - 1)
    verdict_parts: dict[str, bool] = {}
    values: dict[str, float] = {}
    for joint, data_sets in study.data_sets.items():
        excited = data_sets.excited
        # Raises where a test failed or was not played.
        for test in (*TWO_SINES, *SAME_SEQUENCE):
            study.campaign.log(single_joint_test(test, joint))
        of_sines = min(excited[single_joint_test(test, joint)].command for test in TWO_SINES)
        of_files = [excited[single_joint_test(test, joint)].file or 0 for test in SAME_SEQUENCE]
        verdict_parts[f"two sines on {joint}"] = of_sines >= limits["sines"]
        verdict_parts[f"PRBS on {joint}"] = all(order in full_orders for order in of_files)
        values |= {f"{joint}, two sines": of_sines, f"{joint}, PRBS file": min(of_files)}
    facts = {
        "of_sines": [str(values[f"{joint}, two sines"]) for joint in study.joints],
        "of_files": [str(values[f"{joint}, PRBS file"]) for joint in study.joints],
    }
    return decided_finding("F28", verdict_parts, values, facts)


def noise_on_the_input(study: Comparison) -> Finding:
    """F29: the input has considerable noise, and shows sample-and-hold and rounding."""
    limits = CLAIMS["F29"].limits
    verdict_parts: dict[str, bool] = {}
    values: dict[str, float] = {}
    for joint, estimates in study.nonparametric.items():
        # Raises without a record.
        command = study.campaign.single(SINES, joint).u[:, 0]
        spectra = estimates.repeated[SINES]
        noise = np.sqrt(np.sum(spectra.input * (1.0 - spectra.repeating)) / np.sum(spectra.input))
        # Rounding gives a held command exactly the same value again.
        rests = np.mean(np.diff(command) == 0.0)
        verdict_parts[f"noise on {joint}"] = noise >= limits["noise"]
        verdict_parts[f"hold on {joint}"] = rests >= limits["held"]
        values |= {f"{joint}, noise": 100 * noise, f"{joint}, rests": 100 * rests}
    facts = {
        "noises": [values[f"{joint}, noise"] for joint in study.joints],
        "rests": [values[f"{joint}, rests"] for joint in study.joints],
    }
    return decided_finding("F29", verdict_parts, values, facts)


def zero_mean(study: Comparison) -> Finding:
    """F30: the PRBS has zero mean, so that its covariance and correlation are the same."""
    values: dict[str, float] = {}
    for joint in study.joints:
        log = study.campaign.log(single_joint_test(PRBS, joint))
        # Not about the first command, which holds the first bit of the sequence.
        command = settled(log, joint).u[:, 0] - study.truth.angles[JOINTS.index(joint)]
        values[joint] = 100 * float(command.mean() ** 2 / np.mean(command**2))
    limit = 100 * CLAIMS["F30"].limits["same"]
    verdict_parts = {joint: share <= limit for joint, share in values.items()}
    return decided_finding("F30", verdict_parts, values, {"shares": list(values.values())})


def pulse_around_1_hz(study: Comparison) -> Finding:
    """F31: the energy of the bipolar ramping pulse is focused around 1 Hz."""
    limits = CLAIMS["F31"].limits
    verdict_parts: dict[str, bool] = {}
    values: dict[str, float] = {}
    for joint, estimates in study.nonparametric.items():
        # Raises without a record.
        spectrum_of(study, PULSE, joint)
        spectra = estimates.repeated[PULSE]
        strongest = float(spectra.frequencies[np.argmax(spectra.input)])
        around = spectra.frequencies <= limits["around"]
        share = 100 * float(spectra.input[around].sum() / spectra.input.sum())
        verdict_parts[f"strongest line on {joint}"] = bool(np.isclose(strongest, limits["at"]))
        verdict_parts[f"power on {joint}"] = share > limits["most"]
        values |= {f"{joint}, strongest line": strongest, f"{joint}, power up to 1.5 Hz": share}
    facts = {
        "strongest": [values[f"{joint}, strongest line"] for joint in study.joints],
        "shares": [values[f"{joint}, power up to 1.5 Hz"] for joint in study.joints],
    }
    return decided_finding("F31", verdict_parts, values, facts)
