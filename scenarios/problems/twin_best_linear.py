"""Best linear truth of the arm's problems: what linear models of their records tend to, from a table or measured.

`python -m scenarios.problems.twin_best_linear` makes the table anew.
"""

import json
from contextlib import suppress
from dataclasses import dataclass, fields
from functools import lru_cache
from hashlib import sha256
from itertools import product
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
from scipy.linalg import block_diag

from hmtb_twin.files.atomic_write import write_whole
from hmtb_twin.run.experiment_row import experiment_arm
from scenarios.problems.twin_name import TwinName, twin_name
from scenarios.problems.twin_records import arm_hash, records_folder
from scenarios.truth.best_linear import best_linear
from scenarios.truth.bla_of_test import joint_command, multisine_like
from sysid import StateSpace
from sysid.records.arrays import ComplexArray, FloatArray, Locked

TABLE = Path(__file__).with_name("twin_best_linear.json")

TABLE_REALISATIONS = 24
"""Waveforms behind each entry of the table: a fifth of the scatter of one waveform is left."""

REALISATIONS = 8
"""Waveforms behind a truth that the table does not hold: about a second of two cores."""

SEED = 20260
"""Of phases and noise, none of which a record of a problem shares."""

_JOINTS = ("shoulder_yaw", "shoulder_pitch", "elbow_pitch")
# Binary sequences as the thesis' test 5 has them.
_EXCITATIONS = ("multisine-5mrad", "multisine-10mrad", "multisine-40mrad", "prbs-67mrad")

TABLE_CLASSES = tuple(f"twin-nominal-{joint}-{excitation}" for joint, excitation in product(_JOINTS, _EXCITATIONS))
"""Excitation classes of the table: those that the quick bench compares with."""

FUNCTIONS = 8
"""Laguerre functions that are added to the small-signal truth for a scattered estimate."""

POLE = 0.85
"""Their pole: a time constant of 0.12 s, a bandwidth of about 1 Hz."""


@dataclass(frozen=True, eq=False)
class BestLinear(Locked):
    """The linear system nearest to the arm under an excitation class, at the class's own lines.

    Attributes:
        frequencies: (nf,), Hz.
        response: From commanded to measured angle (nf,).
        variance: Of the response, by noise and by the scatter over waveforms (nf,).
        distortion_variance: Of the response in one waveform, by nonlinear distortion (nf,).
        noise_variance: Of the response in one period, by noise (nf,).
        realisations: Number of waveforms.
        bandwidth_hz: Half-power bandwidth, Hz; NaN where the lines show none.
        bandwidth_ci95: Its 95 % interval, Hz.
        command_rms: Root mean square of the command behind the velocity limit, rad.
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
        """The values as a table for JSON; six digits are a hundredth of the response's own uncertainty."""
        table = {field.name: getattr(self, field.name) for field in fields(self)}
        response = table.pop("response")
        table |= {"real": response.real, "imaginary": response.imag}
        for name in ("real", "imaginary", "variance", "distortion_variance", "noise_variance"):
            table[name] = [float(f"{value:.6g}") for value in table[name]]
        return {**table, "frequencies": self.frequencies.tolist()}

    @classmethod
    def from_table(cls, table: dict[str, Any]) -> "BestLinear":
        """Make one from a table that `to_table` made.

        Raises:
            KeyError, TypeError, ValueError: It is no such table.
        """
        low, high = table["bandwidth_ci95"]
        values: dict[str, Any] = dict(table)
        for name, value in table.items():
            if isinstance(value, list):
                values[name] = np.array(value)
        values |= {"response": values["real"] + 1j * values["imaginary"], "bandwidth_ci95": (low, high)}
        return cls(**{field.name: values[field.name] for field in fields(cls)})


def twin_best_linear(name: TwinName) -> BestLinear:
    """The best linear truth of a problem: from the table, from the folder of the records, else measured.

    Args:
        name: The problem; which waveform and how long do not matter.

    Returns:
        That of its excitation class. For a multisine these are its own lines; for a binary sequence or a chirp those of
        a multisine whose command has the same strength and band, see `scenarios.truth.bla_of_test`.
    """
    return _of_class(twin_name(name.excitation_class), records_folder())


@lru_cache(maxsize=256)
def _of_class(name: TwinName, folder: Path | None) -> BestLinear:
    stored, key = _table().get(str(name)), class_key(name)
    # The table is of one arm, version of MuJoCo and machine type; elsewhere the truth is measured anew.
    if stored is not None and stored["key"] == key:
        return BestLinear.from_table(stored)
    if folder is None:
        return measured_best_linear(name)
    path = folder / f"best-linear-{key}.json"
    # A file that is missing or damaged is made by measuring.
    with suppress(OSError, ValueError, KeyError, TypeError):
        return BestLinear.from_table(json.loads(path.read_text(encoding="utf-8")))
    best = measured_best_linear(name)
    folder.mkdir(parents=True, exist_ok=True)
    write_whole(path, json.dumps(best.to_table()))
    return best


def class_key(name: TwinName) -> str:
    """Hash of what a best linear truth is made from: excitation, laboratory, arm, version of MuJoCo, machine type."""
    experiment = name.experiment(0)
    made_from = f"{experiment!r}|{arm_hash(experiment_arm(experiment))}|{mujoco.__version__}"
    return sha256(made_from.encode()).hexdigest()


def measured_best_linear(name: TwinName, *, realisations: int = REALISATIONS, threads: int | None = None) -> BestLinear:
    """Measure the best linear truth by the robust method [Pintelon2012, sec. 4.3].

    Args:
        name: The problem.
        realisations: Waveforms.
        threads: Threads for the physics; the bits do not depend on it.
    """
    setting = name.setting(SEED)
    if name.excitation == "multisine":
        excitation = name.multisines(SEED, realisations=realisations)
    else:
        command = joint_command(name.experiment(SEED))
        # The best linear approximation is about the operating point, which the mean belongs to.
        command = command - command.mean()
        setting, excitation, _ = multisine_like(setting, [command], seed=SEED, realisations=realisations)
    truth = best_linear(setting, excitation, threads=threads)
    servo, (low, high) = truth.servo, truth.bandwidth.ci95
    bandwidth_ci95 = (float(low[0, 0]), float(high[0, 0]))
    # That of the mean over periods and waveforms, as that of one period.
    noise_variance = servo.noise_variance[:, 0, 0] * servo.realisations * excitation.periods
    return BestLinear(
        frequencies=servo.response.frequencies,
        response=servo.response.response[:, 0, 0],
        variance=servo.total_variance[:, 0, 0],
        distortion_variance=servo.distortion_variance[:, 0, 0],
        noise_variance=noise_variance,
        realisations=servo.realisations,
        bandwidth_hz=float(truth.bandwidth.hz[0, 0]),
        bandwidth_ci95=bandwidth_ci95,
        command_rms=float(truth.command_rms[0]),
        slewing=truth.slewing,
    )


def scattered_model(name: TwinName, truth: StateSpace, best: BestLinear, seed: int) -> StateSpace:
    """Draw an estimate as good as any: the small-signal truth and a sum of Laguerre functions [Ljung1999, sec. 4.4].

    The sum is the least-squares fit to the difference of a response that is drawn line by line: the best linear truth,
    with nonlinear distortion that belongs to the waveform and noise that belongs to the record, as large as a response
    without a model has them at this length. Smoothing by the fit is made up for: the scatter has the power of what was
    drawn, though in fewer directions.
    """
    network, path = _laguerre(truth.dt), truth.input_path()
    columns = network.frequency_response(best.frequencies)[:, :, 0]
    # Real and imaginary parts are fitted side by side, so that the weights are real.
    basis = np.vstack([columns.real, columns.imag])
    periods = name.samples * truth.dt * (best.frequencies[1] - best.frequencies[0])

    def normal_errors(seed: int, variance: FloatArray) -> ComplexArray:
        real, imaginary = np.random.default_rng(seed).standard_normal((2, len(variance)))
        return np.asarray(np.sqrt(0.5 * variance) * (real + 1j * imaginary))

    errors = normal_errors(name.waveform_seed(seed), best.distortion_variance)
    errors = errors + normal_errors(seed, best.noise_variance / periods)
    missing = best.response - path.frequency_response(best.frequencies)[:, 0, 0]
    inverse = np.linalg.pinv(basis)
    # A projection onto few directions keeps of independent errors the share of their power in these.
    power = np.tile(best.distortion_variance + best.noise_variance / periods, 2)
    factor = np.sqrt(power.sum() / (np.diagonal(basis @ inverse) @ power))
    weights = inverse @ np.concatenate([missing.real, missing.imag])
    weights = weights + factor * (inverse @ np.concatenate([errors.real, errors.imag]))
    A = block_diag(path.A, network.A)
    B, C = np.vstack([path.B, network.B]), np.hstack([path.C, weights[None, :]])
    return StateSpace(A, B, C, path.D, None, truth.dt)


@lru_cache(maxsize=1)
def _table() -> dict[str, Any]:
    return dict(json.loads(TABLE.read_text(encoding="utf-8")))


def _laguerre(dt: float) -> StateSpace:
    """Laguerre functions of one input, an output each."""
    step = np.arange(FUNCTIONS)
    lag = step[:, None] - step[None, :]
    below = (1.0 - POLE**2) * (-POLE) ** np.maximum(lag - 1, 0)
    A = np.where(lag > 0, below, np.where(lag == 0, POLE, 0.0))
    B = np.sqrt(1.0 - POLE**2) * (-POLE) ** step
    return StateSpace(A, B[:, None], np.eye(FUNCTIONS), np.zeros((FUNCTIONS, 1)), None, dt)


def main() -> None:
    """Measure all classes of the table and write it."""
    lines = []
    for excitation_class in TABLE_CLASSES:
        name = twin_name(excitation_class)
        measured = measured_best_linear(name, realisations=TABLE_REALISATIONS).to_table()
        # A line for each class, so that a change of the table shows which classes it touches.
        lines.append(f"{json.dumps(excitation_class)}: {json.dumps({'key': class_key(name), **measured})}")
    write_whole(TABLE, "{\n" + ",\n".join(lines) + "\n}\n")


if __name__ == "__main__":
    main()
