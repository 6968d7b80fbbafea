"""The small-signal truth of an arm under its conditions, written to a file of a data set and read back."""

import json
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, fields
from functools import lru_cache
from hashlib import sha256
from pathlib import Path
from types import MappingProxyType
from typing import Any

import mujoco
import numpy as np

from hmtb_twin import JOINTS, STUDIED_JOINTS, Arm, Plant, Specimen, Truth, TwinError, linearize
from hmtb_twin.parameters.values import SAMPLE_RATE
from hmtb_twin.truth.innovations import Disturbances
from hmtb_twin.truth.truth import JointTruth
from scenarios.datasets.plan import LICENSE, DataSetPlan, PlannedExperiment
from scenarios.datasets.spec import DataSetSpec
from scenarios.experiments.logged_arm import experiment_arm
from scenarios.files.errors import ScenarioError
from scenarios.files.netcdf import Attribute, Contents, Variable, read_netcdf
from sysid import StateSpace

FORMAT = "hmtb arm truth 1"
"""Marks the files of this version."""

MATRICES: Mapping[str, tuple[tuple[str, str], str]] = {
    "A": (("next_state", "state"), "A of x(t+1) = A x + B u + K e"),
    "B": (("next_state", "input"), "B of x(t+1) = A x + B u + K e"),
    "C": (("output", "state"), "C of y = C x + D u + e"),
    "D": (("output", "input"), "D of y = C x + D u + e"),
    "K": (("next_state", "output"), "innovation gain; zero where no process noise acts"),
    "innovation_covariance": (("output", "other_output"), "covariance of the innovations e"),
}
"""Matrices of a model: dimensions and meaning."""


@dataclass(frozen=True, eq=False)
class StoredArm:
    """Contents of the file of an arm.

    Attributes:
        truth: The small-signal truth of the whole arm.
        rest: Angles at which the commanded arm rests (7,), rad: a little off the command where it droops.
        joints: The truth about single joints; none where the arm is unstable.
        model_sha256: Hash of the compiled model.
        attributes: All attributes of the file.
    """

    truth: Truth
    rest: np.ndarray
    joints: Mapping[str, JointTruth]
    model_sha256: str
    attributes: Mapping[str, Attribute]

    def __post_init__(self) -> None:
        object.__setattr__(self, "joints", MappingProxyType(dict(self.joints)))


@lru_cache(maxsize=16)
def arm_truth(arm: Arm, pose: str, amplitudes: tuple[float, ...] = ()) -> Truth:
    """Linearise an arm at a pose; arms that follow each other in a plan are linearised once."""
    return linearize(arm, pose, amplitudes=amplitudes)


def model_sha256(arm: Arm) -> str:
    """Hash the compiled model, as MuJoCo's own binary format (mj_saveModel) has it.

    The bytes follow from version of MuJoCo, machine type and model alone: names, masses, inertias, drives and options.
    """
    content = np.empty(mujoco.mj_sizeModel(arm.model), np.uint8)
    mujoco.mj_saveModel(arm.model, None, content)
    return sha256(content.tobytes()).hexdigest()


def arm_files(plan: DataSetPlan, entry: PlannedExperiment) -> Mapping[str, Contents]:
    """Return the file of the truth about the arm of an experiment, by path in the folder."""
    return {entry.arm_truth: arm_contents(plan.spec, entry, arm_joints(plan))}


def arm_joints(plan: DataSetPlan) -> tuple[str, ...]:
    """Return the joints described one by one: those of any record, and where files have all channels, the studied."""
    used = {joint for entry in plan[: len(plan) // plan.twins] for joint in entry.joints}
    used |= set(STUDIED_JOINTS) if plan.spec.channels == "all" else set()
    return tuple(joint for joint in JOINTS if joint in used)


def arm_contents(spec: DataSetSpec, entry: PlannedExperiment, joints: Sequence[str]) -> Contents:
    """Compute the truth of the arm of an experiment: matrices, noise, poles, zeros, gains, bandwidths and delays.

    Args:
        spec: The data set.
        entry: An experiment on it, the first by convention: the hash is of the model that this one is run on.
        joints: Joints that are described one by one; see `arm_joints`.

    Returns:
        Contents of the file. Where the arm cannot be linearised at its pose, because a joint would stand at a stop or a
        drive is too weak, they hold the reason and no matrices; where it is unstable, no single joints.
    """
    arm, pose = experiment_arm(entry.experiment), entry.experiment.pose
    attributes: dict[str, Attribute] = {
        "format": FORMAT,
        "data_set": spec.label,
        "arm": entry.arm,
        "variant": arm.variant,
        "payload": arm.payload,
        "pose": pose,
        "plant": json.dumps(vars(arm.plant), sort_keys=True),
        "specimen": json.dumps(dict(arm.specimen.deviations), sort_keys=True),
        "model_sha256": model_sha256(experiment_arm(entry.experiment, worksite=True)),
        "model_sha256_experiment": entry.name,
        "model_sha256_of": "bytes of mj_saveModel, of the version of MuJoCo and the machine type named beside it",
        "license": LICENSE,
    }
    try:
        truth = arm_truth(arm, pose, spec.truth.amplitudes)
    except TwinError as error:
        return Contents({}, {**attributes, "stable": 0, "reason": str(error)})
    stable = truth.spectral_radius < 1.0
    attributes |= {
        "stable": int(stable),
        "reason": "" if stable else f"unstable: spectral radius {truth.spectral_radius:.9g}",
        "joints": " ".join(joints) if stable else "",
        **{f"provenance_{key}": value for key, value in truth.provenance.items()},
    }
    variables = _arm_variables(truth, arm.rest(truth.angles).qpos[: len(JOINTS)])
    for joint in joints if stable else ():
        variables |= _joint_variables(truth.joint(joint))
    return Contents(variables, attributes)


def truth_variable(dims: Iterable[str], values: object, meaning: str, units: str = "") -> Variable:
    """Return a variable of a file of truth.

    Args:
        dims: Its dimensions.
        values: Its values.
        meaning: What they are.
        units: Their unit, as UDUNITS reads it; empty for none.
    """
    attributes = {**({"units": units} if units else {}), "role": "truth", "long_name": meaning}
    return Variable(tuple(dims), np.asarray(values), attributes)


def _arm_variables(truth: Truth, rest: np.ndarray) -> dict[str, Variable]:
    names = (
        ("input", JOINTS, "joints that are commanded"),
        ("output", JOINTS, "joints that are measured"),
        ("other_output", JOINTS, "joints that are measured"),
        ("part", ("real", "imaginary"), "parts of a complex number"),
    )
    drives, resolvers = truth.disturbances.drives, truth.disturbances.resolvers
    variables = {
        **{dim: truth_variable((dim,), texts, meaning) for dim, texts, meaning in names},
        **_model_variables(truth.model, ""),
        "drive_noise": truth_variable(
            ("next_state", "input"), drives, "what one standard deviation of each drive's noise adds to the state"
        ),
        "resolver_covariance": truth_variable(
            ("output", "other_output"), resolvers, "covariance of resolver noise and rounding", "rad2"
        ),
        "operating_angles": truth_variable(("input",), truth.angles, "commanded operating point", "rad"),
        "rest_angles": truth_variable(("output",), rest, "where the commanded arm rests", "rad"),
    }
    if truth.small_signal_error:
        dim, (amplitudes, errors) = "trial_amplitude", zip(*truth.small_signal_error.items(), strict=True)
        meaning = "amplitude at which the linear model was tried against simulation"
        variables[dim] = truth_variable((dim,), amplitudes, meaning, "rad")
        variables["small_signal_error"] = truth_variable((dim,), errors, "relative error of the linear model", "1")
    return variables


def _joint_variables(joint: JointTruth) -> dict[str, Variable]:
    """The truth about a joint; names of its variables and dimensions begin with that of the joint."""
    pole, zero = f"{joint.name}_pole", f"{joint.name}_zero"
    facts = {
        "bandwidth": ((), joint.bandwidth_hz, "half-power bandwidth relative to the gain at 0 Hz", "Hz"),
        "dc_gain": ((), joint.dc_gain, "gain at 0 Hz, measured over commanded angle", "1"),
        "delay": ((), joint.delay_samples, "samples from a command to the first measurement that shows it", "1"),
        "poles": ((pole, "part"), _pairs(joint.poles), "poles in z", "1"),
        "pole_shares": ((pole,), joint.shares, "part of the gain at 0 Hz that each pole carries", "1"),
        "zeros": ((zero, "part"), _pairs(joint.zeros), "zeros in z", "1"),
    }
    return {
        **_model_variables(joint.model, f"{joint.name}_"),
        **{f"{joint.name}_{name}": truth_variable(*fact) for name, fact in facts.items()},
    }


def _model_variables(model: StateSpace, prefix: str) -> dict[str, Variable]:
    return {
        f"{prefix}{name}": truth_variable(
            [f"{prefix}{dim}" for dim in dims],
            getattr(model, name),
            meaning,
            "rad2" if name == "innovation_covariance" else "",
        )
        for name, (dims, meaning) in MATRICES.items()
    }


def _pairs(values: np.ndarray) -> np.ndarray:
    return np.stack([np.real(values), np.imag(values)], axis=-1).astype(float).reshape(-1, 2)


def read_arm(path: Path) -> StoredArm:
    """Read the truth of an arm back, with equal matrices.

    Args:
        path: A file under `truth/arms`.

    Raises:
        ScenarioError: No such file, or not one of an arm; or the arm has no linear truth, with the reason.
    """
    contents = read_netcdf(path)
    attributes, v = contents.attributes, {name: variable.values for name, variable in contents.variables.items()}
    if attributes.get("format") != FORMAT:
        raise ScenarioError(f"{path} is not the truth of an arm: expected the format {FORMAT!r}")
    if "A" not in v:
        raise ScenarioError(f"{path}: the arm has no linear truth: {attributes['reason']}")
    try:
        trials = (
            zip(v["trial_amplitude"].tolist(), v["small_signal_error"].tolist(), strict=True)
            if ("trial_amplitude" in v)
            else ()
        )
        texts = {key: str(attributes[key]) for key in ("variant", "payload", "pose")}
        truth = Truth(
            model=_stored_model(v, "", JOINTS),
            disturbances=Disturbances(v["drive_noise"], v["resolver_covariance"]),
            plant=Plant(**_table(Plant, attributes["plant"])),
            specimen=Specimen(**_table(Specimen, attributes["specimen"])),
            angles=v["operating_angles"],
            small_signal_error=dict(trials),
            provenance={
                key.removeprefix("provenance_"): str(value)
                for key, value in attributes.items()
                if key.startswith("provenance_")
            },
            **texts,
        )
        joints = {name: _stored_joint(v, name) for name in str(attributes["joints"]).split()}
        return StoredArm(truth, v["rest_angles"], joints, str(attributes["model_sha256"]), attributes)
    except (KeyError, TypeError, ValueError) as error:
        raise ScenarioError(f"{path}: damaged, or of another version: {error}") from error


def _table(kind: type, text: Attribute) -> dict[str, Any]:
    table = json.loads(str(text))
    known = {entry.name for entry in fields(kind)}
    if not isinstance(table, dict) or not table.keys() <= known:
        raise ValueError(f"{text!r} given, expected fields of {kind.__name__}")
    return table


def _stored_joint(v: Mapping[str, np.ndarray], name: str) -> JointTruth:
    return JointTruth(
        name=name,
        model=_stored_model(v, f"{name}_", (name,)),
        bandwidth_hz=float(v[f"{name}_bandwidth"]),
        dc_gain=float(v[f"{name}_dc_gain"]),
        poles=_complex(v[f"{name}_poles"]),
        shares=v[f"{name}_pole_shares"],
        zeros=_complex(v[f"{name}_zeros"]),
        delay_samples=int(v[f"{name}_delay"]),
    )


def _complex(pairs: np.ndarray) -> np.ndarray:
    return pairs[:, 0] + 1j * pairs[:, 1] if pairs[:, 1].any() else pairs[:, 0]


def _stored_model(v: Mapping[str, np.ndarray], prefix: str, joints: Sequence[str]) -> StateSpace:
    return StateSpace(
        **{name: v[f"{prefix}{name}"] for name in MATRICES},
        dt=1.0 / SAMPLE_RATE,
        input_names=tuple(f"{name} commanded" for name in joints),
        output_names=tuple(f"{name} measured" for name in joints),
        input_units=("rad",) * len(joints),
        output_units=("rad",) * len(joints),
    )
