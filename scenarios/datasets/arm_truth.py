"""The small-signal truth of an arm under its conditions, written to a file of a data set and read back."""

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from hashlib import sha256
from itertools import chain
from pathlib import Path
from types import MappingProxyType

import mujoco
import numpy as np

from hmtb_twin import VARIANTS, Arm, Plant, Specimen, Truth, TwinError, linearize
from hmtb_twin.arm_files.known_arms import arm_named
from hmtb_twin.files.netcdf import Attribute, Contents, Variable, read_netcdf
from hmtb_twin.parameters.values import SAMPLE_RATE
from hmtb_twin.run.experiment_row import experiment_arm
from hmtb_twin.truth.innovations import Disturbances
from hmtb_twin.truth.truth import JointTruth
from scenarios.datasets.plan import LICENSE, DataSetPlan, PlannedExperiment, arm_file
from scenarios.datasets.variables import netcdf_variables, provenance_attributes, provenance_of
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


def arm_joints(plan: DataSetPlan, variant: str) -> tuple[str, ...]:
    """Return the joints described one by one: those of any record, and where files have all channels, the studied.

    Args:
        plan: The plan.
        variant: The arm.
    """
    arm = arm_named(variant)
    # Twins have the same records, so those of one are enough.
    of_arm = (planned for planned in plan.of_twin() if _same_machine(planned.experiment.variant, variant))
    used = set(chain.from_iterable(planned.joints for planned in of_arm))
    if plan.spec.channels == "all":
        used |= set(arm.compared)
    return tuple(joint for joint in arm.joints if joint in used)


def _same_machine(one: str, other: str) -> bool:
    """Whether two arms are one machine: the variants of the test bed are described alike, whichever is excited."""
    return one == other or (one in VARIANTS and other in VARIANTS)


def arm_files(plan: DataSetPlan, planned: PlannedExperiment) -> dict[str, Contents]:
    """Compute the truth of the arm of an experiment: matrices, noise, poles, zeros, gains, bandwidths and delays.

    Args:
        plan: The plan.
        planned: An experiment on the arm, the first by convention: the hash is of the model that this one is run on.

    Returns:
        Contents of the file, by path. Where the arm cannot be linearised at its pose, because a joint would stand at a
        stop or a drive is too weak, they hold the reason and no matrices; where it is unstable, no single joints.
    """
    arm, pose = experiment_arm(planned.experiment), planned.experiment.pose
    attributes = _arm_attributes(plan.spec.label, planned, arm) | _assumed_attributes(arm)
    try:
        truth = arm_truth(arm, pose, plan.spec.truth.amplitudes)
    except TwinError as error:
        return {arm_file(planned.arm): Contents({}, {**attributes, "stable": 0, "reason": str(error)})}
    # Gains and bandwidths describe a response that settles: no joint has one on an arm that runs away.
    joints = arm_joints(plan, planned.experiment.variant) if truth.spectral_radius < 1.0 else ()
    attributes |= _stability_attributes(truth, joints) | provenance_attributes(truth.provenance)
    variables = _arm_variables(truth, arm.rest(truth.angles).qpos[: len(truth.angles)], arm.description.joints)
    for joint in map(truth.joint, joints):
        variables |= _joint_variables(joint)
    return {arm_file(planned.arm): Contents(variables, attributes)}


def _arm_attributes(data_set: str, planned: PlannedExperiment, arm: Arm) -> dict[str, Attribute]:
    """Attributes that identify an arm, its conditions and the model that experiments on it are run on."""
    return {
        "format": FORMAT,
        "data_set": data_set,
        "arm": planned.arm,
        "variant": arm.variant,
        "payload": arm.payload,
        "pose": planned.experiment.pose,
        "plant": json.dumps(vars(arm.plant), sort_keys=True),
        "specimen": json.dumps(dict(arm.specimen.deviations), sort_keys=True),
        "model_sha256": model_sha256(experiment_arm(planned.experiment, worksite=True)),
        "model_sha256_experiment": planned.name,
        "model_sha256_of": "bytes of mj_saveModel, of the version of MuJoCo and the machine type named beside it",
        "license": LICENSE,
    }


def _assumed_attributes(arm: Arm) -> dict[str, Attribute]:
    """What no file of an arm says and a rule supplied, as JSON; nothing of the test bed, whose numbers have a table."""
    rows = [vars(row) for row in arm.description.assumed]
    return {"assumed": json.dumps(rows)} if rows else {}


def _stability_attributes(truth: Truth, joints: Sequence[str]) -> dict[str, Attribute]:
    """Attributes that say whether the arm is stable, and which joints are described one by one."""
    stable = truth.spectral_radius < 1.0
    reason = "" if stable else f"unstable: spectral radius {truth.spectral_radius:.9g}"
    return {"stable": int(stable), "reason": reason, "joints": " ".join(joints)}


def _arm_variables(truth: Truth, rest_angles: np.ndarray, joints: tuple[str, ...]) -> dict[str, Variable]:
    """The truth about the whole arm; where trials were asked for, with the error of the linear model in each."""
    labels = {"input": joints, "output": joints, "other_output": joints, "part": ("real", "imaginary")}
    values = {
        "drive_noise": truth.disturbances.drives,
        "resolver_covariance": truth.disturbances.resolvers,
        "operating_angles": truth.angles,
        "rest_angles": rest_angles,
    }
    variables = netcdf_variables("arm", {**labels, **_matrices(truth.model), **values})
    if trials := truth.small_signal_error:
        trial_values = {"trial_amplitude": list(trials), "small_signal_error": list(trials.values())}
        variables |= netcdf_variables("arm", trial_values)
    return variables


def _joint_variables(joint: JointTruth) -> dict[str, Variable]:
    """The truth about a single joint, under names that begin with its own."""
    values = {
        **_matrices(joint.model),
        "bandwidth": joint.bandwidth_hz,
        "dc_gain": joint.dc_gain,
        "delay": joint.delay_samples,
        "poles": _pairs(joint.poles),
        "pole_shares": joint.shares,
        "zeros": _pairs(joint.zeros),
    }
    return netcdf_variables("arm", values, f"{joint.name}_")


def _matrices(model: StateSpace) -> dict[str, object]:
    return {name: getattr(model, name) for name in MATRICES}


def _pairs(values: np.ndarray) -> np.ndarray:
    """Complex numbers as real and imaginary part (n, 2), which NetCDF holds; n may be 0."""
    return np.stack([np.real(values), np.imag(values)], axis=-1).astype(float).reshape(-1, 2)


def _complex_or_real(pairs: np.ndarray) -> np.ndarray:
    """Numbers from their real and imaginary parts (n, 2); real where all are, as they were before `_pairs`."""
    if pairs[:, 1].any():
        return pairs[:, 0] + 1j * pairs[:, 1]
    return pairs[:, 0]


def read_arm(path: Path) -> StoredArm:
    """Read the truth of an arm back, with equal matrices.

    Args:
        path: A file under `truth/arms`.

    Raises:
        ScenarioError: No such file, or not one of an arm; or the arm has no linear truth, with the reason.
    """
    contents = read_netcdf(path)
    attributes = contents.attributes
    values = {name: variable.values for name, variable in contents.variables.items()}
    if attributes.get("format") != FORMAT:
        raise ScenarioError(f"{path} is not the truth of an arm: expected the format {FORMAT!r}")
    # So it is written where the arm cannot be linearised.
    if "A" not in values:
        raise ScenarioError(f"{path}: the arm has no linear truth: {attributes['reason']}")
    try:
        truth = _stored_truth(values, attributes)
        joints = {name: _stored_joint(values, name) for name in str(attributes["joints"]).split()}
        return StoredArm(truth, values["rest_angles"], MappingProxyType(joints), attributes)
    except (KeyError, TypeError, ValueError) as error:
        raise ScenarioError(f"{path}: damaged, or of another version: {error}") from error


def _stored_truth(values: Mapping[str, np.ndarray], attributes: Mapping[str, Attribute]) -> Truth:
    amplitudes, errors = values.get("trial_amplitude", ()), values.get("small_signal_error", ())
    trials = zip(amplitudes, errors, strict=True)
    return Truth(
        model=_stored_model(values, "", tuple(map(str, values["input"]))),
        disturbances=Disturbances(values["drive_noise"], values["resolver_covariance"]),
        variant=str(attributes["variant"]),
        payload=str(attributes["payload"]),
        pose=str(attributes["pose"]),
        plant=Plant(**json.loads(str(attributes["plant"]))),
        specimen=Specimen(**json.loads(str(attributes["specimen"]))),
        angles=values["operating_angles"],
        small_signal_error={float(amplitude): float(error) for amplitude, error in trials},
        provenance=provenance_of(attributes),
    )


def _stored_joint(values: Mapping[str, np.ndarray], name: str) -> JointTruth:
    return JointTruth(
        name=name,
        model=_stored_model(values, f"{name}_", (name,)),
        bandwidth_hz=float(values[f"{name}_bandwidth"]),
        dc_gain=float(values[f"{name}_dc_gain"]),
        poles=_complex_or_real(values[f"{name}_poles"]),
        shares=values[f"{name}_pole_shares"],
        zeros=_complex_or_real(values[f"{name}_zeros"]),
        delay_samples=int(values[f"{name}_delay"]),
    )


def _stored_model(values: Mapping[str, np.ndarray], prefix: str, joints: Sequence[str]) -> StateSpace:
    units = ("rad",) * len(joints)
    return StateSpace(
        **{name: values[f"{prefix}{name}"] for name in MATRICES},
        dt=1.0 / SAMPLE_RATE,
        input_names=tuple(f"{name} commanded" for name in joints),
        output_names=tuple(f"{name} measured" for name in joints),
        input_units=units,
        output_units=units,
    )
