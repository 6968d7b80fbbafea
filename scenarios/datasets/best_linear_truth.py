"""Best linear approximations of the records of a data set."""

from collections.abc import Hashable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from hmtb_twin import JointLog, simulate
from hmtb_twin.files.netcdf import Attribute, Contents
from scenarios.datasets.experiment_file import stored_log
from scenarios.datasets.plan import LICENSE, DataSetPlan, PlannedExperiment
from scenarios.datasets.spec import DataSetSpec
from scenarios.datasets.variables import described
from scenarios.experiments.multisines import MultisineExperiment, Multisines, multisine_experiments
from scenarios.files.errors import ScenarioError
from scenarios.truth.best_linear import approximated
from scenarios.truth.bla_of_test import joint_command, multisine_like


def excitation_class(entry: PlannedExperiment) -> Hashable:
    """Return a key of what is played on which joints, how strongly, on which arm: equal for repeats and for twins."""
    arm = entry.arm if entry.twin is None else entry.arm.partition("arm-")[2]
    experiment, random = entry.experiment, ("seed", "realisations")
    played: list[Mapping[str, object]] = [
        {"kind": one.kind, "repeat_frequency": one.repeat_frequency, **one.parameters}
        for one in getattr(experiment, "excitation", ())
    ]
    if isinstance(experiment, MultisineExperiment):
        played = [vars(experiment.multisines)]
    texts = [sorted((key, str(value)) for key, value in one.items() if key not in random) for one in played]
    return arm, entry.joints, tuple(experiment.axes), tuple(map(tuple, texts))


def best_linear_pieces(plan: DataSetPlan) -> list[str]:
    """Return the first experiments of each class in the blocks that the spec names, on the first twin."""
    first: dict[Hashable, str] = {}
    for entry in plan.of_twin() if plan.spec.truth.best_linear else ():
        if entry.block in plan.spec.truth.best_linear:
            first.setdefault(excitation_class(entry), entry.name)
    return list(first.values())


def best_linear_files(plan: DataSetPlan, folder: Path, piece: str) -> Mapping[str, Contents]:
    """Measure the approximation for arm, joints and amplitude of an experiment; a piece of a stage of the build."""
    entry = next(entry for entry in plan if entry.name == piece)
    recorded = recorded_realisations(plan, folder, entry)
    return {entry.best_linear: best_linear_contents(plan.spec, entry, recorded=recorded)}


def recorded_realisations(
    plan: DataSetPlan, folder: Path, entry: PlannedExperiment
) -> tuple[tuple[MultisineExperiment, JointLog], ...]:
    """Return the realisations of a multisine that a data set has of the class of an experiment, on the same arm.

    Random-phase multisines of one class differ by their phases alone, whatever part of the data set they belong to.

    Returns:
        Experiments and their logs, realisation by realisation, each phase once; none where something else is played.
        A realisation of which a record is missing does not count.

    Raises:
        ScenarioError: A damaged file.
    """
    if not isinstance(entry.experiment, MultisineExperiment):
        return ()
    lines, own_class = entry.experiment.multisines.lines, excitation_class(entry)
    realisations: dict[tuple[int, int], dict[int, tuple[PlannedExperiment, MultisineExperiment]]] = {}
    for other in plan.of_twin(entry.twin):
        one = other.experiment
        # Odd multisines draw their silent lines, too: only those of one seed have the same.
        if not isinstance(one, MultisineExperiment) or excitation_class(other) != own_class:
            continue
        if np.array_equal(one.multisines.lines, lines) and (folder / other.data).is_file():
            realisations.setdefault((one.multisines.seed, one.realisation), {}).setdefault(one.record, (other, one))
    return tuple(
        (one, stored_log(folder, other))
        for records in realisations.values()
        if len(records) == len(entry.experiment.axes)
        for _, (other, one) in sorted(records.items())
    )


def best_linear_contents(
    spec: DataSetSpec,
    entry: PlannedExperiment,
    *,
    recorded: Sequence[tuple[MultisineExperiment, JointLog]] = (),
    threads: int | None = None,
) -> Contents:
    """Measure the best linear approximation under a multisine like the command of an experiment.

    A multisine is repeated with new phases; any other excitation of one joint by a multisine whose command has the same
    root mean square, and the band that holds 95 % of its power.

    Args:
        spec: The data set.
        entry: The experiment.
        recorded: Records of whole realisations, which count; see `recorded_realisations`. The rest of the number that
            the spec asks for is simulated, at least two.
        threads: Threads for the physics; the bits do not depend on it.

    Raises:
        ScenarioError: Several joints excited otherwise than by multisines, work in contact or an emergency shutdown.
    """
    count = len(recorded) // len(entry.experiment.axes)
    missing = max(spec.truth.realisations - count, 0)
    experiments, logs, seconds = [one for one, _ in recorded], [log for _, log in recorded], 0.0
    facts = {"setting": entry.name, "realisations of the data set": str(count), "realisations simulated": "0"}
    if missing:
        setting, multisines = matching_multisines(spec, entry, realisations=max(missing, 2))
        more = multisine_experiments(setting, multisines)
        result = simulate(more, threads=threads)
        for name, reason in result.failed.items():
            raise ScenarioError(f"{name}: {reason}")
        experiments, logs, seconds = [*experiments, *more], [*logs, *result], result.physics_seconds
        facts |= {"seed": str(setting.seed), "realisations simulated": str(multisines.realisations)}
    best = approximated(experiments, logs, measured=entry.joints, physics_seconds=seconds, origin=facts)
    response, band = best.servo.response, best.bandwidth
    values = {
        "input": best.experiment.axes,
        "output": best.measured,
        "part": ("real", "imaginary"),
        "other_part": ("real", "imaginary"),
        "end": ("lower", "upper"),
        "frequency": response.frequencies,
        "response": np.stack([response.response.real, response.response.imag], axis=-1),
        "covariance": response.covariance,
        **{name: getattr(best.servo, name) for name in ("noise_variance", "total_variance", "distortion_variance")},
        "bandwidth": band.hz,
        "bandwidth_ci95": np.stack(band.ci95),
        "distortion": best.distortion_percent,
        "command_rms": best.command_rms,
    }
    attributes: dict[str, Attribute] = {
        "format": "hmtb best linear approximation 1",
        "data_set": spec.label,
        "experiment": entry.name,
        "arm": entry.arm,
        "realisations": best.servo.realisations,
        "degrees_of_freedom": float(response.degrees_of_freedom or np.nan),
        "slewing": best.slewing,
        "limited": best.limited,
        "license": LICENSE,
        **{f"provenance_{key}": value for key, value in best.provenance.items()},
    }
    return Contents(described("best_linear", values), attributes)


def matching_multisines(
    spec: DataSetSpec, entry: PlannedExperiment, *, realisations: int = 8
) -> tuple[MultisineExperiment, Multisines]:
    """Return the setting and the multisine like the command of an experiment; see `best_linear_contents`.

    Raises:
        ScenarioError: Several joints excited otherwise than by multisines.
    """
    seed = int(np.random.SeedSequence([spec.seed, *f"best linear {entry.name}".encode()]).generate_state(1)[0])
    experiment = entry.experiment
    if isinstance(experiment, MultisineExperiment):
        multisines = replace(experiment.multisines, realisations=realisations, seed=seed)
        return replace(experiment, seed=seed), multisines
    if len(experiment.axes) != 1:
        raise ScenarioError(
            f"{entry.name} excites {', '.join(experiment.axes)} at once; expected a joint alone, or multisines, for a "
            "best linear approximation"
        )
    command = joint_command(experiment)
    command = command - command.mean()
    setting, multisines, _ = multisine_like(experiment, [command], seed=seed, realisations=realisations)
    return setting, multisines
