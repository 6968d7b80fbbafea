"""The small-signal truth of an arm under its conditions, written to a file of a data set and read back."""

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from hashlib import sha256
from pathlib import Path
from types import MappingProxyType

import mujoco
import numpy as np

from hmtb_twin import JOINTS, STUDIED_JOINTS, Arm, Plant, Specimen, Truth, TwinError, linearize
from hmtb_twin.files.netcdf import Attribute, Contents, read_netcdf
from hmtb_twin.parameters.values import SAMPLE_RATE
from hmtb_twin.run.experiment_row import experiment_arm
from hmtb_twin.truth.innovations import Disturbances
from hmtb_twin.truth.truth import JointTruth
from scenarios.datasets.plan import LICENSE, DataSetPlan, PlannedExperiment, arm_file
from scenarios.datasets.variables import described, provenance_of
from scenarios.files.errors import ScenarioError
from sysid import StateSpace

FORMAT = "hmtb arm truth 1"
"""Marks the files of this version."""

MATRICES = ("A", "B", "C", "D", "K", "innovation_covariance")
"""Matrices of a model."""


@dataclass(frozen=True, eq=False)
class StoredArm:
    """Contents of the file of an arm.

    Attributes:
        truth: The small-signal truth of the whole arm.
        rest: Angles at which the commanded arm rests (7,), rad: a little off the command where it droops.
        joints: The truth about single joints; none where the arm is unstable.
        attributes: All attributes of the file.
    """

    truth: Truth
    rest: np.ndarray
    joints: Mapping[str, JointTruth]
    attributes: Mapping[str, Attribute]


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


def arm_joints(plan: DataSetPlan) -> tuple[str, ...]:
    """Return the joints described one by one: those of any record, and where files have all channels, the studied."""
    used = {joint for entry in plan.of_twin() for joint in entry.joints}
    used |= set(STUDIED_JOINTS) if plan.spec.channels == "all" else set()
    return tuple(joint for joint in JOINTS if joint in used)


def arm_files(plan: DataSetPlan, entry: PlannedExperiment) -> dict[str, Contents]:
    """Compute the truth of the arm of an experiment: matrices, noise, poles, zeros, gains, bandwidths and delays.

    Args:
        plan: The plan.
        entry: An experiment on the arm, the first by convention: the hash is of the model that this one is run on.

    Returns:
        Contents of the file, by path. Where the arm cannot be linearised at its pose, because a joint would stand at a
        stop or a drive is too weak, they hold the reason and no matrices; where it is unstable, no single joints.
    """
    spec, joints = plan.spec, arm_joints(plan)
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
        return {arm_file(entry.arm): Contents({}, {**attributes, "stable": 0, "reason": str(error)})}
    stable = truth.spectral_radius < 1.0
    attributes |= {
        "stable": int(stable),
        "reason": "" if stable else f"unstable: spectral radius {truth.spectral_radius:.9g}",
        "joints": " ".join(joints) if stable else "",
        **{f"provenance_{key}": value for key, value in truth.provenance.items()},
    }
    variables = described(
        "arm",
        {
            **{dim: JOINTS for dim in ("input", "output", "other_output")},
            "part": ("real", "imaginary"),
            **_matrices(truth.model),
            "drive_noise": truth.disturbances.drives,
            "resolver_covariance": truth.disturbances.resolvers,
            "operating_angles": truth.angles,
            "rest_angles": arm.rest(truth.angles).qpos[: len(JOINTS)],
        },
    )
    if trials := truth.small_signal_error:
        values = {"trial_amplitude": list(trials), "small_signal_error": list(trials.values())}
        variables |= described("arm", values)
    for joint in map(truth.joint, joints if stable else ()):
        facts = {
            **_matrices(joint.model),
            "bandwidth": joint.bandwidth_hz,
            "dc_gain": joint.dc_gain,
            "delay": joint.delay_samples,
            "poles": _pairs(joint.poles),
            "pole_shares": joint.shares,
            "zeros": _pairs(joint.zeros),
        }
        variables |= described("arm", facts, f"{joint.name}_")
    return {arm_file(entry.arm): Contents(variables, attributes)}


def _matrices(model: StateSpace) -> dict[str, object]:
    return {name: getattr(model, name) for name in MATRICES}


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
        trials = zip(v.get("trial_amplitude", ()), v.get("small_signal_error", ()), strict=True)
        truth = Truth(
            model=_stored_model(v, "", JOINTS),
            disturbances=Disturbances(v["drive_noise"], v["resolver_covariance"]),
            plant=Plant(**json.loads(str(attributes["plant"]))),
            specimen=Specimen(**json.loads(str(attributes["specimen"]))),
            angles=v["operating_angles"],
            small_signal_error={float(amplitude): float(error) for amplitude, error in trials},
            provenance=provenance_of(attributes),
            **{key: str(attributes[key]) for key in ("variant", "payload", "pose")},
        )
        joints = {name: _stored_joint(v, name) for name in str(attributes["joints"]).split()}
        return StoredArm(truth, v["rest_angles"], MappingProxyType(joints), attributes)
    except (KeyError, TypeError, ValueError) as error:
        raise ScenarioError(f"{path}: damaged, or of another version: {error}") from error


def _stored_joint(v: Mapping[str, np.ndarray], name: str) -> JointTruth:
    pairs = {key: v[f"{name}_{key}"] for key in ("poles", "zeros")}
    roots = {key: one[:, 0] + 1j * one[:, 1] if one[:, 1].any() else one[:, 0] for key, one in pairs.items()}
    return JointTruth(
        name=name,
        model=_stored_model(v, f"{name}_", (name,)),
        bandwidth_hz=float(v[f"{name}_bandwidth"]),
        dc_gain=float(v[f"{name}_dc_gain"]),
        shares=v[f"{name}_pole_shares"],
        delay_samples=int(v[f"{name}_delay"]),
        **roots,
    )


def _stored_model(v: Mapping[str, np.ndarray], prefix: str, joints: Sequence[str]) -> StateSpace:
    return StateSpace(
        **{name: v[f"{prefix}{name}"] for name in MATRICES},
        dt=1.0 / SAMPLE_RATE,
        input_names=tuple(f"{name} commanded" for name in joints),
        output_names=tuple(f"{name} measured" for name in joints),
        input_units=("rad",) * len(joints),
        output_units=("rad",) * len(joints),
    )
