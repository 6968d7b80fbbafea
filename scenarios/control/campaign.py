"""Identification of the ground arm and of its reference: one record of six joints at once, and a model from it."""

import warnings
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

import sysid
from hmtb_twin import JOINTS, NOMINAL_PLANT, NOMINAL_SPECIMEN, SAMPLE_TIME, VARIANTS, Plant, Specimen, simulate
from scenarios.experiments.multisines import MultisineExperiment, Multisines
from scenarios.files.data_file import read_parts
from scenarios.files.errors import ScenarioError, unknown
from sysid import IOData, Polynomials, StateSpace, SysidWarning
from sysid.models.predict import as_model

CONTROLLED = tuple(name for name in JOINTS if name != "shoulder_roll")
"""Joints under control: all but the first, which a pin holds."""

EXCITATION = Multisines(rms=0.05, f_min=0.025, f_max=3.0, period=40.0, realisations=2, periods=5, settling=1)
"""Four minutes on all joints at once, large enough that joints slide instead of sticking.

Most commands slew at their velocity limits, and the record holds the limited ones."""

FREQUENCY_TEST = replace(EXCITATION, rms=0.01, periods=2)
"""Two minutes on all joints at once."""

ORDERS = {"nominal": 18, "flight": 12}
"""Order of the model of an arm; of other variants as of the nominal one."""

REFERENCE = "flight"
"""The variant that the ground arm is made to answer like."""


@dataclass(frozen=True, eq=False)
class IdentifiedPair:
    """The models from which a controller is designed, inputs and outputs in the order of `CONTROLLED`.

    Attributes:
        ground: Model of the arm to be controlled, in innovations form.
        reference: Model whose answers are wanted.
        record: The record behind `ground`, angles in rad about their means.
        source: Where the reference is from: a variant or a file.
    """

    ground: StateSpace
    reference: StateSpace
    record: IOData
    source: str = REFERENCE


def identification_experiment(
    variant: str = "nominal",
    seed: int = 0,
    *,
    payload: str = "rpcm",
    plant: Plant = NOMINAL_PLANT,
    specimen: Specimen = NOMINAL_SPECIMEN,
) -> MultisineExperiment:
    """Return the experiment whose record identifies an arm in free space; the seed draws phases and noise."""
    return MultisineExperiment(
        name=f"identification-{variant}-{seed}",
        axes=CONTROLLED,
        multisines=replace(EXCITATION, seed=seed),
        variant=variant,
        payload=payload,
        plant=plant,
        specimen=specimen,
        seed=seed,
    )


def frequency_test(payload: str = "rpcm", plant: Plant = NOMINAL_PLANT, seed: int = 0) -> MultisineExperiment:
    """Return the experiment that shows the response of a controlled arm, slow enough to stay within its limits."""
    experiment = identification_experiment(seed=seed, payload=payload, plant=plant)
    return replace(experiment, name="multisine", multisines=replace(FREQUENCY_TEST, seed=seed))


def identified_model(record: IOData, order: int) -> StateSpace:
    """Return the subspace model of a record of all controlled joints, without direct term.

    Raises:
        SysidError: The record is too short, or does not excite all joints independently.
    """
    with warnings.catch_warnings():
        # On chance and conditioning: what the model is worth shows in the design's sensitivity and in the runs.
        warnings.simplefilter("ignore", SysidWarning)
        return sysid.n4sid(record, order, direct=False, stable=True).model


def identify_pair(
    seed: int = 0,
    *,
    ground: MultisineExperiment | Path | None = None,
    reference: str | Path = REFERENCE,
    threads: int | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> IdentifiedPair:
    """Identify the ground arm and its reference, each from four simulated minutes unless files stand for them.

    Args:
        seed: Draws excitation and noise.
        ground: Experiment on the ground arm, or a file of a record in which all controlled joints move; by default the
            experiment on the nominal arm.
        reference: A variant, or a model file (`.json`) with the controlled joints in their order.
        threads: Threads for the physics.
        progress: Called with the completed ticks and the total.

    Raises:
        ScenarioError: No such variant, or a file of other channels.
        SysidError: A record that identifies no model.
    """
    known = read_model(Path(reference)) if str(reference).endswith(".json") else None
    if known is None and reference not in VARIANTS:
        raise ScenarioError(unknown("reference", reference, VARIANTS) + "; or a model file that ends in .json")
    own = identification_experiment(seed=seed) if ground is None else ground
    record = _read(own) if isinstance(own, Path) else None
    experiments = [] if isinstance(own, Path) else [own]
    if known is None:
        payload = "rpcm" if isinstance(own, Path) else own.payload
        # Another seed: two arms have other noise, and a record of each has its own phases.
        experiments.append(identification_experiment(str(reference), seed + 1, payload=payload))
    records = [log.iodata(CONTROLLED).detrend(0) for log in simulate(experiments, threads=threads, progress=progress)]
    record = record or records[0]
    known = known or _unit_gain(identified_model(records[-1], ORDERS.get(str(reference), ORDERS["nominal"])))
    return IdentifiedPair(identified_model(record, ORDERS["nominal"]), known, record, str(reference))


def _unit_gain(model: StateSpace) -> StateSpace:
    """Return a model whose angles come to rest where they are commanded.

    That position servos without load do so is known beforehand; dry friction hides a few thousandths of it in a record,
    1 mrad on moves of 0.5 rad.
    """
    return replace(model, B=model.B @ np.linalg.inv(model.dc_gain()))


def read_model(path: Path) -> StateSpace:
    """Read a reference model from a file.

    Raises:
        ScenarioError: It is not of the controlled joints at 50 Hz.
        SysidError: It cannot be read.
    """
    content = sysid.read_model(path)
    if isinstance(content, Polynomials):
        content = sysid.models.innovations_form(content, SAMPLE_TIME)
    model = as_model(content)
    m = len(CONTROLLED)
    if (model.nu, model.ny) != (m, m) or abs(model.dt - SAMPLE_TIME) > 1e-6:
        raise ScenarioError(
            f"{path.name}: a model of {model.nu} inputs and {model.ny} outputs at {model.dt:g} s given, expected "
            f"{m} joints ({', '.join(CONTROLLED)}) at {SAMPLE_TIME:g} s"
        )
    return model


def _read(path: Path) -> IOData:
    parts = read_parts(path, joint=CONTROLLED)
    if len(parts) != 1:
        raise ScenarioError(f"{path.name}: {len(parts)} stretches between gaps given, expected a record without gaps")
    return parts[0].detrend(0)
