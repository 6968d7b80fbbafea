"""Best linear truth of the twin's problems: what linear models of their records tend to, from a table or measured."""

import json
from dataclasses import dataclass
from functools import lru_cache
from hashlib import sha256
from importlib import resources
from pathlib import Path
from typing import Any

import mujoco
import numpy as np

from hmtb_twin.control.control_station import ControlStation
from hmtb_twin.control.modes import joint_index
from hmtb_twin.parameters.values import SAMPLE_TIME
from scenarios.experiments.logged_arm import experiment_arm
from scenarios.experiments.multisines import MultisineExperiment, Multisines
from scenarios.files.atomic_write import write_whole
from scenarios.problems.twin_experiment import multisines, twin_experiment
from scenarios.problems.twin_name import TwinName, twin_name
from scenarios.problems.twin_records import RECORDS, arm_hash
from scenarios.truth.best_linear import best_linear
from scenarios.truth.bla_of_record import multisine_like
from sysid import IOData
from sysid.records.arrays import ComplexArray, FloatArray, Locked

TABLE = "twin_best_linear.json"
"""File of those that are known beforehand; made by `python -m scenarios.problems.twin_best_linear_table`."""

REALISATIONS = 8
"""Waveforms from which one is measured that the table does not hold: about a second of two cores."""

SEED = 20260
"""Of phases and noise, none of which a record of a problem shares."""


@dataclass(frozen=True, eq=False)
class BestLinear(Locked):
    """The linear system nearest to the arm under an excitation class, at the class's own lines.

    Attributes:
        frequencies: (nf,), Hz.
        response: From commanded to measured angle (nf,).
        variance: Of the response, by noise and by the scatter over waveforms (nf,).
        distortion_variance: Of the response in one waveform, by nonlinear distortion (nf,).
        noise_variance: Of the response in one period, by noise (nf,).
        realisations: Waveforms that it rests on.
        bandwidth_hz: Half-power bandwidth, Hz; NaN where the lines show none.
        bandwidth_ci95: Its 95 % interval, Hz.
        command_rms: Root mean square of the command, rad: behind the velocity limit.
        slewing: Share of the time at the velocity limit.
    """

    frequencies: FloatArray
    response: ComplexArray
    variance: FloatArray
    distortion_variance: FloatArray
    noise_variance: FloatArray
    realisations: int
    bandwidth_hz: float
    bandwidth_ci95: tuple[float, float]
    command_rms: float
    slewing: float

    def to_table(self) -> dict[str, Any]:
        """For a file; six digits are a hundredth of its own uncertainty."""
        return {
            "frequencies": self.frequencies.tolist(),
            "real": _digits(self.response.real),
            "imaginary": _digits(self.response.imag),
            **{name: _digits(getattr(self, name)) for name in ("variance", "distortion_variance", "noise_variance")},
            "realisations": self.realisations,
            "bandwidth_hz": self.bandwidth_hz,
            "bandwidth_ci95": list(self.bandwidth_ci95),
            "command_rms": self.command_rms,
            "slewing": self.slewing,
        }

    @classmethod
    def from_table(cls, table: dict[str, Any]) -> "BestLinear":
        """Read `to_table`.

        Raises:
            KeyError, TypeError, ValueError: It is none.
        """
        low, high = table["bandwidth_ci95"]
        return cls(
            frequencies=np.array(table["frequencies"], dtype=float),
            response=np.array(table["real"], dtype=float) + 1j * np.array(table["imaginary"], dtype=float),
            variance=np.array(table["variance"], dtype=float),
            distortion_variance=np.array(table["distortion_variance"], dtype=float),
            noise_variance=np.array(table["noise_variance"], dtype=float),
            realisations=int(table["realisations"]),
            bandwidth_hz=float(table["bandwidth_hz"]),
            bandwidth_ci95=(float(low), float(high)),
            command_rms=float(table["command_rms"]),
            slewing=float(table["slewing"]),
        )


def twin_best_linear(name: TwinName) -> BestLinear:
    """The best linear truth of a problem: from the table, from the folder of the records, else measured.

    Args:
        name: The problem; which waveform and how long do not matter.

    Returns:
        That of its excitation class. For a multisine these are its own lines; for a binary sequence or a chirp those of
        a multisine whose command has the same strength and band, see `scenarios.truth.bla_of_record`.
    """
    return _of_class(twin_name(name.excitation_class), RECORDS.folder)


@lru_cache(maxsize=256)
def _of_class(name: TwinName, folder: Path | None) -> BestLinear:
    known = _table().get(str(name))
    key = class_key(name)
    if known is not None and known["key"] == key:
        return BestLinear.from_table(known)
    path = None if folder is None else folder / f"best-linear-{key}.json"
    if path is not None:
        try:
            return BestLinear.from_table(json.loads(path.read_text(encoding="utf-8")))
        except (OSError, ValueError, KeyError, TypeError):
            pass  # none there, or a damaged one: it is measured
    found = measured_best_linear(name)
    if path is not None:
        path.parent.mkdir(parents=True, exist_ok=True)
        write_whole(path, json.dumps(found.to_table()))
    return found


def class_key(name: TwinName) -> str:
    """Hash of what a best linear truth is made from: excitation, laboratory, arm, version of MuJoCo, machine type."""
    experiment = twin_experiment(name, 0)
    text = f"{experiment!r}|{arm_hash(experiment_arm(experiment))}|{mujoco.__version__}"
    return sha256(text.encode()).hexdigest()


def measured_best_linear(name: TwinName, *, realisations: int = REALISATIONS, threads: int | None = None) -> BestLinear:
    """Measure one by the robust method [Pintelon2012, sec. 4.3].

    Args:
        name: The problem.
        realisations: Waveforms.
        threads: Threads for the physics; the bits do not depend on it.
    """
    setting, excitation = _measurement(name, realisations)
    found = best_linear(setting, excitation, threads=threads)
    servo, (low, high) = found.servo, found.bandwidth.ci95
    return BestLinear(
        frequencies=servo.response.frequencies,
        response=servo.response.response[:, 0, 0],
        variance=servo.total_variance[:, 0, 0],
        distortion_variance=servo.distortion_variance[:, 0, 0],
        noise_variance=servo.noise_variance[:, 0, 0] * servo.realisations * excitation.periods,
        realisations=servo.realisations,
        bandwidth_hz=float(found.bandwidth.hz[0, 0]),
        bandwidth_ci95=(float(low[0, 0]), float(high[0, 0])),
        command_rms=float(found.command_rms[0]),
        slewing=found.slewing,
    )


def _measurement(name: TwinName, realisations: int) -> tuple[MultisineExperiment, Multisines]:
    setting = MultisineExperiment(str(name), (name.joint,), variant=name.variant, seed=SEED)
    if name.excitation == "multisine":
        return setting, multisines(name, SEED, realisations=realisations)
    experiment = twin_experiment(name, SEED)
    arm = experiment_arm(experiment)
    # The command is known without the physics.
    station = ControlStation(experiment, arm, np.random.default_rng(SEED).spawn(2)[0])
    command = station.commands[:, joint_index(name.joint)]
    record = IOData(command - command.mean(), command - command.mean(), SAMPLE_TIME)
    base, excitation, _ = multisine_like(setting, arm, [record], seed=SEED, realisations=realisations)
    return base, excitation


@lru_cache(maxsize=1)
def _table() -> dict[str, Any]:
    file = resources.files("scenarios.problems") / TABLE
    if not file.is_file():
        return {}
    table: dict[str, Any] = json.loads(file.read_text(encoding="utf-8"))
    return table


def _digits(values: FloatArray) -> list[float]:
    return [float(f"{value:.6g}") for value in values]
