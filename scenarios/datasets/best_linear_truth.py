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
from scenarios.datasets.variables import netcdf_variables, provenance_attributes
from scenarios.experiments.multisines import MultisineExperiment, Multisines, multisine_experiments
from scenarios.files.errors import ScenarioError
from scenarios.truth.best_linear import BestLinearTruth, approximated
from scenarios.truth.bla_of_test import joint_command, multisine_like


def excitation_class(planned: PlannedExperiment) -> Hashable:
    """Return a key of what is played on which joints, how strongly, on which arm: equal for repeats and for twins."""
    # The name of an arm begins with its twin: twin-3-arm-0.
    arm = planned.arm if planned.twin is None else planned.arm.partition("arm-")[2]
    experiment = planned.experiment
    signals: list[Mapping[str, object]]
    if isinstance(experiment, MultisineExperiment):
        signals = [vars(experiment.multisines)]
    else:
        signals = [
            {"kind": signal.kind, "repeat_frequency": signal.repeat_frequency, **signal.parameters}
            for signal in getattr(experiment, "excitation", ())
        ]
    return arm, planned.joints, tuple(experiment.axes), tuple(map(_without_randomness, signals))


def _without_randomness(signal: Mapping[str, object]) -> tuple[tuple[str, str], ...]:
    """Settings of a signal, sorted, without those that draw its random values, and how many draws there are."""
    kept = {name: value for name, value in signal.items() if name not in ("seed", "realisations")}
    return tuple(sorted((name, str(value)) for name, value in kept.items()))


def best_linear_pieces(plan: DataSetPlan) -> list[str]:
    """Return the first experiments of each class in the blocks that the spec names, on the first twin."""
    blocks = plan.spec.truth.best_linear
    if not blocks:
        return []
    first_of_class: dict[Hashable, str] = {}
    for planned in plan.of_twin():
        if planned.block in blocks:
            first_of_class.setdefault(excitation_class(planned), planned.name)
    return list(first_of_class.values())


def best_linear_files(plan: DataSetPlan, folder: Path, piece: str) -> Mapping[str, Contents]:
    """Measure the approximation for arm, joints and amplitude of an experiment; a piece of a stage of the build."""
    planned = next(planned for planned in plan if planned.name == piece)
    recorded = recorded_realisations(plan, folder, planned)
    return {planned.best_linear: best_linear_contents(plan.spec, planned, recorded=recorded)}


def recorded_realisations(
    plan: DataSetPlan, folder: Path, planned: PlannedExperiment
) -> tuple[tuple[MultisineExperiment, JointLog], ...]:
    """Return the realisations of a multisine that a data set has of the class of an experiment, on the same arm.

    Random-phase multisines of one class differ by their phases alone, whatever part of the data set they belong to.

    Returns:
        Experiments and their logs, realisation by realisation, each phase once; none where something else is played.
        A realisation of which a record is missing does not count.

    Raises:
        ScenarioError: A damaged file.
    """
    if not isinstance(planned.experiment, MultisineExperiment):
        return ()
    lines, own_class = planned.experiment.multisines.lines, excitation_class(planned)
    # Experiments by number of the record, by seed and number of the realisation.
    realisations: dict[tuple[int, int], dict[int, tuple[PlannedExperiment, MultisineExperiment]]] = {}
    for candidate in plan.of_twin(planned.twin):
        multisine = candidate.experiment
        if not isinstance(multisine, MultisineExperiment) or excitation_class(candidate) != own_class:
            continue
        # Odd multisines draw their silent lines, too: only those of one seed have the same.
        if np.array_equal(multisine.multisines.lines, lines) and (folder / candidate.data).is_file():
            records = realisations.setdefault((multisine.multisines.seed, multisine.realisation), {})
            records.setdefault(multisine.record, (candidate, multisine))
    recorded: list[tuple[MultisineExperiment, JointLog]] = []
    for records in realisations.values():
        # As many records as axes determine the response from all of them.
        if len(records) == len(planned.experiment.axes):
            for _, (candidate, multisine) in sorted(records.items()):
                recorded.append((multisine, stored_log(folder, candidate)))
    return tuple(recorded)


def best_linear_contents(
    spec: DataSetSpec,
    planned: PlannedExperiment,
    *,
    recorded: Sequence[tuple[MultisineExperiment, JointLog]] = (),
    threads: int | None = None,
) -> Contents:
    """Measure the best linear approximation under a multisine like the command of an experiment.

    A multisine is repeated with new phases; any other excitation of one joint by a multisine whose command has the same
    root mean square, and the band that holds 95 % of its power.

    Args:
        spec: The data set.
        planned: The experiment.
        recorded: Records of whole realisations, which count; see `recorded_realisations`. The rest of the number that
            the spec asks for is simulated, at least two.
        threads: Threads for the physics; the bits do not depend on it.

    Raises:
        ScenarioError: Several joints excited otherwise than by multisines, work in contact or an emergency shutdown.
    """
    # Each realisation has as many records as axes.
    count = len(recorded) // len(planned.experiment.axes)
    missing = max(spec.truth.realisations - count, 0)
    experiments, logs = [experiment for experiment, _ in recorded], [log for _, log in recorded]
    physics_seconds = 0.0
    origin = {"setting": planned.name, "realisations of the data set": str(count), "realisations simulated": "0"}
    if missing:
        # The spread of a single realisation has no estimate.
        setting, multisines = matching_multisines(spec, planned, realisations=max(missing, 2))
        further_experiments = multisine_experiments(setting, multisines)
        result = simulate(further_experiments, threads=threads)
        for name, reason in result.failed.items():
            raise ScenarioError(f"{name}: {reason}")
        experiments, logs = [*experiments, *further_experiments], [*logs, *result]
        physics_seconds = result.physics_seconds
        origin |= {"seed": str(setting.seed), "realisations simulated": str(multisines.realisations)}
    best = approximated(experiments, logs, measured=planned.joints, physics_seconds=physics_seconds, origin=origin)
    variables = netcdf_variables("best_linear", _variables(best))
    return Contents(variables, _attributes(spec, planned, best))


def _variables(best: BestLinearTruth) -> dict[str, object]:
    """Values of the file of a best linear approximation, by the names of its variables."""
    response, band = best.servo.response, best.bandwidth
    return {
        "input": best.experiment.axes,
        "output": best.measured,
        "part": ("real", "imaginary"),
        "other_part": ("real", "imaginary"),
        "end": ("lower", "upper"),
        "frequency": response.frequencies,
        "response": np.stack([response.response.real, response.response.imag], axis=-1),
        "covariance": response.covariance,
        "noise_variance": best.servo.noise_variance,
        "total_variance": best.servo.total_variance,
        "distortion_variance": best.servo.distortion_variance,
        "bandwidth": band.hz,
        "bandwidth_ci95": np.stack(band.ci95),
        "distortion": best.distortion_percent,
        "command_rms": best.command_rms,
    }


def _attributes(spec: DataSetSpec, planned: PlannedExperiment, best: BestLinearTruth) -> dict[str, Attribute]:
    return {
        "format": "hmtb best linear approximation 1",
        "data_set": spec.label,
        "experiment": planned.name,
        "arm": planned.arm,
        "realisations": best.servo.realisations,
        "degrees_of_freedom": float(best.servo.response.degrees_of_freedom or np.nan),
        "slewing": best.slewing,
        "limited": best.limited,
        "license": LICENSE,
        **provenance_attributes(best.provenance),
    }


def matching_multisines(
    spec: DataSetSpec, planned: PlannedExperiment, *, realisations: int = 8
) -> tuple[MultisineExperiment, Multisines]:
    """Return the setting and the multisine like the command of an experiment; see `best_linear_contents`.

    Raises:
        ScenarioError: Several joints excited otherwise than by multisines.
    """
    # A seed of its own, so that none of its phases is that of a record of the data set.
    seed = int(np.random.SeedSequence([spec.seed, *f"best linear {planned.name}".encode()]).generate_state(1)[0])
    experiment = planned.experiment
    if isinstance(experiment, MultisineExperiment):
        multisines = replace(experiment.multisines, realisations=realisations, seed=seed)
        return replace(experiment, seed=seed), multisines
    if len(experiment.axes) != 1:
        raise ScenarioError(
            f"{planned.name} excites {', '.join(experiment.axes)} at once; expected a joint alone, or multisines, for "
            "a best linear approximation"
        )
    command = joint_command(experiment)
    # The multisine has no mean: it plays about the operating point.
    command = command - command.mean()
    setting, multisines, _ = multisine_like(experiment, [command], seed=seed, realisations=realisations)
    return setting, multisines
