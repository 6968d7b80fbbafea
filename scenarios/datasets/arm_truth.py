"""What is true of an arm under its conditions: the file of its small-signal truth, and the way back from it."""

import json
from collections.abc import Mapping, Sequence
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
from scenarios.datasets.layout import LICENSE
from scenarios.datasets.plan import DataSetPlan, PlannedExperiment
from scenarios.datasets.spec import DataSetSpec
from scenarios.experiments.logged_arm import experiment_arm
from scenarios.files.errors import ScenarioError
from scenarios.files.netcdf import Attribute, Contents, Variable, read_netcdf
from sysid import StateSpace

FORMAT = "hmtb arm truth 1"
"""Marks the files of this version."""

MATRICES = {
    "A": ("next_state", "state"),
    "B": ("next_state", "input"),
    "C": ("output", "state"),
    "D": ("output", "input"),
}
"""Matrices of a model x(t+1) = A x + B u + K e, y = C x + D u + e, and the dimensions that they run along."""

NOISE = {"K": ("next_state", "output"), "innovation_covariance": ("output", "other_output")}
"""Those of its noise."""


@dataclass(frozen=True, eq=False)
class StoredArm:
    """What the file of an arm tells.

    Attributes:
        truth: The small-signal truth of the whole arm.
        rest: Angles at which the commanded arm rests (7,), rad: a little off the command where it droops.
        joints: The truth about single joints; none where the arm is unstable.
        model_sha256: Of the compiled model.
        attributes: All of the file.
    """

    truth: Truth
    rest: np.ndarray
    joints: Mapping[str, JointTruth]
    model_sha256: str
    attributes: Mapping[str, Attribute]

    def __post_init__(self) -> None:
        object.__setattr__(self, "joints", MappingProxyType(dict(self.joints)))


def arm_joints(plan: DataSetPlan) -> tuple[str, ...]:
    """Joints whose own truth stands in the files of a data set's arms, in the sequence of the arm.

    Args:
        plan: The plan; those that the thesis studied, and those that any of its experiments looks at.
    """
    one_arm = plan[: len(plan) // plan.twins]
    used = {joint for entry in one_arm for joint in entry.joints}
    used |= set(STUDIED_JOINTS) if plan.spec.channels == "all" else set()
    return tuple(joint for joint in JOINTS if joint in used)


@lru_cache(maxsize=16)
def arm_truth(arm: Arm, pose: str, amplitudes: tuple[float, ...] = ()) -> Truth:
    """Linearise an arm at a pose; arms that follow each other in a plan are linearised once."""
    return linearize(arm, pose, amplitudes=amplitudes)


def model_sha256(arm: Arm) -> str:
    """Hash of the compiled model, as MuJoCo's own binary format (mj_saveModel) has it.

    The bytes follow from version of MuJoCo, machine type and model alone: names, masses, inertias, drives and options.
    """
    content = np.empty(mujoco.mj_sizeModel(arm.model), np.uint8)
    mujoco.mj_saveModel(arm.model, None, content)
    return sha256(content.tobytes()).hexdigest()


def arm_contents(spec: DataSetSpec, entry: PlannedExperiment, joints: Sequence[str]) -> Contents:
    """What is true of the arm of an experiment: matrices, noise, poles, zeros, gains, bandwidths and delays.

    Args:
        spec: The data set.
        entry: An experiment on it, the first by convention: the hash is of the model that this one is run on.
        joints: Joints to tell of one by one; see `arm_joints`.

    Returns:
        Content of the file. Where the arm cannot be linearised at its pose, because a joint would stand at a stop or a
        drive is too weak, it says why and holds no matrices; where it is unstable, it holds no single joints.
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
    told = {f"provenance_{key}": value for key, value in truth.provenance.items()}
    stable = truth.spectral_radius < 1.0
    why = "" if stable else f"unstable: spectral radius {truth.spectral_radius:.9g}"
    attributes |= {"stable": int(stable), "reason": why, "joints": " ".join(joints) if stable else "", **told}
    variables = _whole(truth, arm.rest(truth.angles).qpos[: len(JOINTS)])
    for joint in joints if stable else ():
        variables |= _single(truth.joint(joint))
    return Contents(variables, attributes)


def _whole(truth: Truth, rest: np.ndarray) -> dict[str, Variable]:
    angle = {"units": "rad", "role": "truth"}
    names = {
        dim: Variable((dim,), np.array(texts), {"role": "truth", "long_name": meaning})
        for dim, texts, meaning in (
            ("input", JOINTS, "joints that are commanded"),
            ("output", JOINTS, "joints that are measured"),
            ("other_output", JOINTS, "joints that are measured"),
            ("part", ("real", "imaginary"), "parts of a complex number"),
        )
    }
    disturbances = truth.disturbances
    variables = {
        **names,
        **_model(truth.model, ""),
        "drive_noise": Variable(
            ("next_state", "input"),
            disturbances.drives,
            {"role": "truth", "long_name": "what one standard deviation of each drive's noise adds to the state"},
        ),
        "resolver_covariance": Variable(
            ("output", "other_output"),
            disturbances.resolvers,
            {"units": "rad2", "role": "truth", "long_name": "covariance of resolver noise and rounding"},
        ),
        "operating_angles": Variable(("input",), truth.angles, {**angle, "long_name": "commanded operating point"}),
        "rest_angles": Variable(("output",), rest, {**angle, "long_name": "where the commanded arm rests"}),
    }
    if truth.small_signal_error:
        amplitudes, errors = (np.array(list(part)) for part in zip(*truth.small_signal_error.items(), strict=True))
        relative = {"units": "1", "role": "truth", "long_name": "relative error of the linear model"}
        tried = {**angle, "long_name": "amplitude at which the linear model was tried against simulation"}
        variables["trial_amplitude"] = Variable(("trial_amplitude",), amplitudes, tried)
        variables["small_signal_error"] = Variable(("trial_amplitude",), errors, relative)
    return variables


def _single(joint: JointTruth) -> dict[str, Variable]:
    """The truth about a joint; names of variables and dimensions begin with that of the joint."""
    facts = {
        "bandwidth": (joint.bandwidth_hz, "Hz", "half-power bandwidth relative to the gain at 0 Hz"),
        "dc_gain": (joint.dc_gain, "1", "gain at 0 Hz, measured over commanded angle"),
        "delay": (joint.delay_samples, "1", "samples from a command to the first measurement that shows it"),
    }
    scalars = {
        f"{joint.name}_{key}": Variable((), np.array(value), {"units": unit, "role": "truth", "long_name": text})
        for key, (value, unit, text) in facts.items()
    }
    plane = {"units": "1", "role": "truth"}
    shares = {"units": "1", "role": "truth", "long_name": "part of the gain at 0 Hz that each pole carries"}
    return {
        **_model(joint.model, f"{joint.name}_"),
        **scalars,
        f"{joint.name}_poles": Variable(
            (f"{joint.name}_pole", "part"), _pairs(joint.poles), {**plane, "long_name": "poles in z"}
        ),
        f"{joint.name}_pole_shares": Variable((f"{joint.name}_pole",), joint.shares, shares),
        f"{joint.name}_zeros": Variable(
            (f"{joint.name}_zero", "part"), _pairs(joint.zeros), {**plane, "long_name": "zeros in z"}
        ),
    }


def _model(model: StateSpace, mark: str) -> dict[str, Variable]:
    """Matrices of a model; those of a joint along dimensions of its own."""
    dims = {**MATRICES, **NOISE}
    texts = {
        "A": "A of x(t+1) = A x + B u + K e",
        "B": "B of x(t+1) = A x + B u + K e",
        "C": "C of y = C x + D u + e",
        "D": "D of y = C x + D u + e",
        "K": "innovation gain; zero where no process noise acts",
        "innovation_covariance": "covariance of the innovations e",
    }
    units = {"innovation_covariance": "rad2"}
    return {
        f"{mark}{name}": Variable(
            tuple(f"{mark}{dim}" for dim in dims[name]),
            np.asarray(getattr(model, name)),
            {
                "role": "truth",
                "long_name": texts[name],
                **({"units": units[name]} if name in units else {}),
            },
        )
        for name in dims
    }


def _pairs(values: np.ndarray) -> np.ndarray:
    return np.stack([np.real(values), np.imag(values)], axis=-1).astype(float).reshape(-1, 2)


def read_arm(path: Path) -> StoredArm:
    """Read the truth of an arm back.

    Args:
        path: A file under `truth/arms`.

    Returns:
        What `arm_contents` was given: equal matrices, `sysid.StateSpace` per arm and joint.

    Raises:
        ScenarioError: No such file, or none of an arm; or the arm has no linear truth, with the reason.
    """
    contents = read_netcdf(path)
    told, v = contents.attributes, contents.variables
    if told.get("format") != FORMAT:
        raise ScenarioError(f"{path} is not the truth of an arm: expected the format {FORMAT!r}")
    if "A" not in v:
        raise ScenarioError(f"{path}: the arm has no linear truth: {told['reason']}")
    try:
        amplitudes = v["trial_amplitude"].values if "trial_amplitude" in v else np.empty(0)
        errors = v["small_signal_error"].values if "trial_amplitude" in v else np.empty(0)
        truth = Truth(
            model=_stored(contents, "", JOINTS),
            disturbances=Disturbances(v["drive_noise"].values, v["resolver_covariance"].values),
            variant=str(told["variant"]),
            payload=str(told["payload"]),
            plant=Plant(**_table(Plant, told["plant"])),
            specimen=Specimen(**_table(Specimen, told["specimen"])),
            pose=str(told["pose"]),
            angles=v["operating_angles"].values,
            small_signal_error=dict(zip(amplitudes.tolist(), errors.tolist(), strict=True)),
            provenance={
                key.removeprefix("provenance_"): str(value)
                for key, value in told.items()
                if key.startswith("provenance_")
            },
        )
        names = str(told["joints"]).split()
        joints = {name: _stored_joint(contents, name) for name in names}
        return StoredArm(truth, v["rest_angles"].values, joints, str(told["model_sha256"]), told)
    except (KeyError, TypeError, ValueError) as error:
        raise ScenarioError(f"{path}: damaged, or of another version: {error}") from error


def _table(kind: type, text: Attribute) -> dict[str, Any]:
    table = json.loads(str(text))
    known = {entry.name for entry in fields(kind)}
    if not isinstance(table, dict) or not table.keys() <= known:
        raise ValueError(f"{text!r} given, expected fields of {kind.__name__}")
    return table


def _stored_joint(contents: Contents, name: str) -> JointTruth:
    v = contents.variables
    return JointTruth(
        name=name,
        model=_stored(contents, f"{name}_", (name,)),
        bandwidth_hz=float(v[f"{name}_bandwidth"].values),
        dc_gain=float(v[f"{name}_dc_gain"].values),
        poles=_complex(v[f"{name}_poles"].values),
        shares=v[f"{name}_pole_shares"].values,
        zeros=_complex(v[f"{name}_zeros"].values),
        delay_samples=int(v[f"{name}_delay"].values),
    )


def _complex(pairs: np.ndarray) -> np.ndarray:
    values = pairs[:, 0] + 1j * pairs[:, 1]
    return values if np.iscomplexobj(values) and values.imag.any() else values.real


def _stored(contents: Contents, mark: str, names: Sequence[str]) -> StateSpace:
    matrices = {name: contents.variables[f"{mark}{name}"].values for name in (*MATRICES, *NOISE)}
    return StateSpace(
        **matrices,
        dt=1.0 / SAMPLE_RATE,
        input_names=tuple(f"{name} commanded" for name in names),
        output_names=tuple(f"{name} measured" for name in names),
        input_units=("rad",) * len(names),
        output_units=("rad",) * len(names),
    )


def arm_files(plan: DataSetPlan, entry: PlannedExperiment) -> Mapping[str, Contents]:
    """The file of the truth about the arm of an experiment, by place in the folder."""
    return {entry.arm_truth: arm_contents(plan.spec, entry, arm_joints(plan))}
