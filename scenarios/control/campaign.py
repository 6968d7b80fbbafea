"""Identification of the ground arm and of its reference: one record of six joints at once, and a model from it."""

import warnings
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

import sysid
from hmtb_twin import SAMPLE_RATE, SAMPLE_TIME, VARIANTS, simulate
from scenarios.experiments.multisines import MultisineExperiment, Multisines
from scenarios.experiments.scenario import known_arm
from scenarios.files.data_file import read_parts
from scenarios.files.errors import ScenarioError
from sysid import IOData, Polynomials, StateSpace, SysidWarning
from sysid.models.model_forms import as_model

CONTROLLED = VARIANTS["nominal"].free
"""Joints of the test bed under control: all but the first, which a pin holds."""

EXCITATION = Multisines(rms=0.05, f_min=0.025, f_max=3.0, period=40.0, realisations=2, periods=5, settling=1)
"""Four minutes on all joints at once, large enough that joints slide instead of sticking.

Most commands slew at their velocity limits, and the record holds the limited ones."""

FREQUENCY_TEST = replace(EXCITATION, rms=0.01, periods=2)
"""Two minutes, slow enough for the commands of a controlled arm to stay within the velocity limits."""

ORDERS = {"nominal": 18, "flight": 12}
"""Order of the model of an arm; of other variants as of the nominal one."""

POOR = 80.0
"""Fit of a joint below which a model is no base of a design, percent: servos at ordinary loads reach 95 to 99."""

ORDER_PER_JOINT = 3
"""Order of the model of another machine over its joints, as of the nominal arm."""


def controlled(arm: str) -> tuple[str, ...]:
    """Return the joints of an arm that are under control: all that follow commands.

    Raises:
        ScenarioError: There is no such arm.
    """
    return CONTROLLED if arm in VARIANTS else known_arm(arm).free


def channels(arm: str) -> list[int]:
    """Return the columns of the controlled joints of an arm in its logs."""
    return [known_arm(arm).joint_index(name) for name in controlled(arm)]


@dataclass(frozen=True, eq=False)
class IdentifiedPair:
    """The models from which a controller is designed, inputs and outputs in the order of the controlled joints.

    Attributes:
        ground: Model of the arm to be controlled, in innovations form.
        reference: Model whose answers are wanted.
        record: The record behind `ground`, angles in rad about their means.
        fits: Of each model that was identified, `ground` and `reference`, how much of every joint its simulation
            explains in its own record (m,), percent.
        joints: The controlled joints.
    """

    ground: StateSpace
    reference: StateSpace
    record: IOData
    fits: Mapping[str, np.ndarray] = field(default_factory=dict)
    joints: tuple[str, ...] = CONTROLLED

    def warnings(self) -> list[str]:
        """Return a line for each identified model that leaves too much of a joint for a design to rest on it."""
        lines = []
        for name, fit in self.fits.items():
            poor = [f"{joint} to {value:.0f} %" for joint, value in zip(self.joints, fit, strict=True) if value < POOR]
            if poor:
                lines.append(
                    f"the model of the {name} arm explains its own record poorly, {', '.join(poor)}: the arm is not "
                    "linear there, as drives at their limits are not; do not rely on a design from this model, but "
                    "take a lighter payload, or a model file as the reference"
                )
        return lines


def identification_experiment(variant: str = "nominal", seed: int = 0) -> MultisineExperiment:
    """Return the experiment whose record identifies an arm in free space; the seed draws phases and noise.

    Raises:
        ScenarioError: There is no such arm, or its position loop has another rate.
    """
    arm = known_arm(variant)
    if arm.sample_rate != SAMPLE_RATE:
        raise ScenarioError(
            f"the position loop of {variant} runs at {arm.sample_rate} Hz, expected {SAMPLE_RATE} Hz: the controller "
            "works at that rate"
        )
    return MultisineExperiment(
        # An arm may be a path, of which no file can be named.
        name=f"identification-{variant if variant in VARIANTS else 'arm'}-{seed}",
        axes=controlled(variant),
        multisines=replace(EXCITATION, seed=seed),
        variant=variant,
        payload=arm.tuned_payload,
        pose=arm.operating_pose,
        seed=seed,
    )


def frequency_test(seed: int = 0) -> MultisineExperiment:
    """Return the experiment that shows the response of a controlled arm; see `FREQUENCY_TEST`."""
    multisines = replace(FREQUENCY_TEST, seed=seed)
    return replace(identification_experiment(seed=seed), name="multisine", multisines=multisines)


def identify_pair(
    seed: int = 0,
    *,
    ground: MultisineExperiment | None = None,
    record: Path | None = None,
    reference: str | Path = "flight",
    threads: int | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> IdentifiedPair:
    """Identify the ground arm and its reference, each from four simulated minutes unless files stand for them.

    Args:
        seed: Draws excitation and noise.
        ground: Experiment on the ground arm, by default on the nominal one.
        record: File of a record that stands for this experiment: of the same arm, all controlled joints moving.
        reference: An arm with joints of the same names, as a variant of the test bed, or a model file (`.json`) with
            the controlled joints in their order. The arm has payload, pose and chain of `ground`, nominal plant and
            specimen.
        threads: Threads for the physics.
        progress: Called with the completed ticks and the total.

    Raises:
        ScenarioError: No such arm, an arm of other joints, a file of other channels or with gaps, or a run that failed.
        SysidError: A record that is too short, or does not excite all joints independently.
    """
    ground = ground or identification_experiment(seed=seed)
    joints = controlled(ground.variant)
    reference_model = read_model(Path(reference), joints) if str(reference).endswith(".json") else None
    if reference_model is None:
        check_reference(str(reference), ground.variant)
    experiments: list[MultisineExperiment] = []
    records: list[IOData] = []
    if record is None:
        experiments.append(ground)
    else:
        records.append(_record_without_gaps(record, joints))
    if reference_model is None:
        # Another seed: two arms have other noise, and a record of each has its own phases.
        of_reference = identification_experiment(str(reference), seed + 1)
        experiments.append(replace(of_reference, payload=ground.payload, pose=ground.pose, chain=ground.chain))
    result = simulate(experiments, threads=threads, progress=progress)
    for name, reason in result.failed.items():
        raise ScenarioError(f"{name}: {reason}")
    records += [log.iodata(joints) for log in result]
    records = [one_record.detrend(0) for one_record in records]
    fits = {}
    if reference_model is None:
        model = _identified(records[-1], str(reference))
        fits["reference"] = _fit(model, records[-1])
        # Position servos come to rest where they are commanded; dry friction hides a few thousandths of that gain in a
        # record, 1 mrad on moves of 0.5 rad.
        reference_model = replace(model, B=model.B @ np.linalg.inv(model.dc_gain()))
    ground_model = _identified(records[0], ground.variant)
    fits["ground"] = _fit(ground_model, records[0])
    return IdentifiedPair(ground_model, reference_model, records[0], fits, joints)


def check_reference(reference: str, ground: str) -> None:
    """Raise `ScenarioError` for a reference that is no arm, or none with the joints of the ground arm."""
    try:
        of_reference = controlled(reference)
    except ScenarioError as error:
        reason = str(error).replace("unknown variant", "unknown reference", 1)
        raise ScenarioError(f"{reason}; or a model file that ends in .json") from error
    if of_reference != controlled(ground):
        raise ScenarioError(
            f"reference {reference} with the joints {', '.join(of_reference)} given, expected an arm with those of "
            f"{ground} ({', '.join(controlled(ground))}), or a model file that ends in .json"
        )


def _fit(model: StateSpace, record: IOData) -> np.ndarray:
    """How much of each output a simulation explains (m,), percent."""
    with warnings.catch_warnings():
        # On the data of the fit: what is wanted is whether the arm is linear at all.
        warnings.simplefilter("ignore", SysidWarning)
        (fit,) = sysid.compare(model, record)
    return np.asarray(fit.simulation)


def _record_without_gaps(path: Path, joints: tuple[str, ...]) -> IOData:
    """Read a record of the controlled joints from a file."""
    segments = list(read_parts(path, joint=joints))
    if len(segments) != 1:
        raise ScenarioError(f"{path.name}: {len(segments)} parts between gaps given, expected a record without gaps")
    return segments[0]


def _identified(record: IOData, variant: str) -> StateSpace:
    """Identify the model of an arm: stable, and without direct feedthrough, since the bus delays every answer."""
    with warnings.catch_warnings():
        # On chance and conditioning: what the model is worth shows in the design's sensitivity and in the runs.
        warnings.simplefilter("ignore", SysidWarning)
        order = ORDERS.get(variant, ORDERS["nominal"]) if variant in VARIANTS else ORDER_PER_JOINT * record.nu
        return sysid.n4sid(record, order, direct=False, stable=True).model


def read_model(path: Path, joints: tuple[str, ...] = CONTROLLED) -> StateSpace:
    """Read a reference model of the controlled joints from a file.

    Raises:
        ScenarioError: It is not of the controlled joints at 50 Hz.
        SysidError: It cannot be read.
    """
    content = sysid.read_model(path)
    if isinstance(content, Polynomials):
        content = sysid.models.innovations_form(content, SAMPLE_TIME)
    model = as_model(content)
    m = len(joints)
    # A model in a file may be of any joints: only their number can be checked.
    if (model.nu, model.ny) != (m, m) or abs(model.dt - SAMPLE_TIME) > 1e-6:
        raise ScenarioError(
            f"{path.name}: a model of {model.nu} inputs and {model.ny} outputs at {model.dt:g} s given, expected "
            f"{m} joints ({', '.join(joints)}) at {SAMPLE_TIME:g} s"
        )
    return model
