"""Best linear approximations of the records of a data set."""

from collections.abc import Hashable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from pathlib import Path

import numpy as np

from hmtb_twin import JointLog, simulate
from hmtb_twin.control.control_station import ControlStation
from hmtb_twin.control.modes import joint_index
from hmtb_twin.parameters.values import SAMPLE_TIME
from scenarios.datasets.experiment_file import stored_log
from scenarios.datasets.layout import LICENSE
from scenarios.datasets.plan import DataSetPlan, PlannedExperiment
from scenarios.datasets.spec import DataSetSpec
from scenarios.experiments.logged_arm import experiment_arm
from scenarios.experiments.multisines import MultisineExperiment, Multisines, multisine_experiments
from scenarios.files.errors import ScenarioError
from scenarios.files.netcdf import Attribute, Contents, Variable, read_netcdf
from scenarios.truth.best_linear import BestLinearTruth, approximated
from scenarios.truth.bla_of_record import multisine_like
from sysid import FrequencyResponse, IOData

CHANCE = ("seed", "realisations")
"""Parameters of an excitation that only chance is drawn by."""


def excitation_class(entry: PlannedExperiment) -> Hashable:
    """What is played on which joints, how strongly, on which arm: equal for repeats and for twins.

    Args:
        entry: An experiment.
    """
    arm = entry.arm if entry.twin is None else entry.arm.partition("arm-")[2]
    return arm, entry.joints, tuple(entry.experiment.axes), _played(entry.experiment)


def _played(experiment: object) -> Hashable:
    if isinstance(experiment, MultisineExperiment):
        given = experiment.multisines
        return tuple((f.name, str(getattr(given, f.name))) for f in fields(given) if f.name not in CHANCE)
    return tuple(
        (
            one.kind,
            one.repeat_frequency,
            tuple(sorted((key, str(value)) for key, value in one.parameters.items() if key not in CHANCE)),
        )
        for one in getattr(experiment, "excitation", ())
    )


def own_realisations(
    plan: DataSetPlan, folder: Path, entry: PlannedExperiment
) -> tuple[tuple[MultisineExperiment, JointLog], ...]:
    """The realisations of a multisine that a data set has of the class of an experiment, on the same arm.

    Random-phase multisines of one class differ by their phases alone, whatever part of the data set they belong to.

    Args:
        plan: The experiments.
        folder: Where their records stand.
        entry: An experiment.

    Returns:
        Experiments and their logs, realisation by realisation, each phase once; none where something else is played.
        A realisation of which a record is missing does not count.

    Raises:
        ScenarioError: A damaged file.
    """
    if not isinstance(entry.experiment, MultisineExperiment):
        return ()
    lines, wanted = entry.experiment.multisines.lines, excitation_class(entry)
    whole: dict[tuple[int, int], dict[int, tuple[PlannedExperiment, MultisineExperiment]]] = {}
    size = len(plan) // plan.twins
    begin = size * (entry.twin or 0)
    for other in plan[begin : begin + size]:
        one = other.experiment
        # Odd multisines draw their silent lines, too: only those of one seed have the same.
        if not isinstance(one, MultisineExperiment) or excitation_class(other) != wanted:
            continue
        if np.array_equal(one.multisines.lines, lines) and (folder / other.data).is_file():
            whole.setdefault((one.multisines.seed, one.realisation), {}).setdefault(one.record, (other, one))
    return tuple(
        (one, stored_log(folder, other))
        for records in whole.values()
        if len(records) == len(entry.experiment.axes)
        for _, (other, one) in sorted(records.items())
    )


FORMAT = "hmtb best linear approximation 1"
"""Marks the files of this version."""


@dataclass(frozen=True)
class BestLinearStage:
    """Measures the best linear approximations that a spec asks for, a file for each class of excitation.

    Attributes:
        name: What it makes.
    """

    name: str = field(default="best-linear", init=False)

    def pieces(self, plan: DataSetPlan) -> Iterable[str]:
        """Names of the first experiments of each class in the blocks that the spec names, on the first twin."""
        first: dict[Hashable, str] = {}
        blocks = set(plan.spec.truth.best_linear)
        for entry in plan[: len(plan) // plan.twins] if blocks else ():
            if entry.block in blocks:
                first.setdefault(excitation_class(entry), entry.name)
        return list(first.values())

    def make(self, plan: DataSetPlan, folder: Path, piece: str) -> Mapping[str, Contents]:
        """Measure one.

        Args:
            plan: The experiments.
            folder: Where the data set stands.
            piece: An experiment, whose arm, joints and amplitude are taken.

        Raises:
            ScenarioError: It has no best linear approximation, for instance because it is no test of single joints.
        """
        entry = next(entry for entry in plan if entry.name == piece)
        own = own_realisations(plan, folder, entry)
        return {entry.best_linear: best_linear_contents(plan.spec, entry, own=own)}


def best_linear_contents(
    spec: DataSetSpec,
    entry: PlannedExperiment,
    *,
    own: Sequence[tuple[MultisineExperiment, JointLog]] = (),
    threads: int | None = None,
) -> Contents:
    """Measure the best linear approximation under a multisine like the command of an experiment.

    A multisine is repeated with new phases; any other excitation of one joint by a multisine whose command has the same
    root mean square, and the band that holds 95 % of its power.

    Args:
        spec: The data set.
        entry: The experiment.
        own: Records of whole realisations that are there, which count; see `own_realisations`. What is missing of the
            number that the spec asks for is simulated, two at least.
        threads: Threads for the physics; the bits do not depend on it.

    Raises:
        ScenarioError: Several joints excited otherwise than by multisines, work in contact or an emergency shutdown.
    """
    count = len(own) // len(entry.experiment.axes)
    left = max(spec.truth.realisations - count, 0)
    experiments, logs, seconds = [one for one, _ in own], [log for _, log in own], 0.0
    told = {"setting": entry.name, "realisations of the data set": str(count), "realisations simulated": "0"}
    if left:
        setting, multisines = matched(spec, entry, realisations=max(left, 2))
        more = multisine_experiments(setting, multisines)
        result = simulate(more, threads=threads)
        for name, reason in result.failed.items():
            raise ScenarioError(f"{name}: {reason}")
        experiments, logs, seconds = [*experiments, *more], [*logs, *result], result.physics_seconds
        told |= {"seed": str(setting.seed), "realisations simulated": str(multisines.realisations)}
    found = approximated(experiments, logs, measured=entry.joints, physics_seconds=seconds, told=told)
    return _contents(spec, entry, found)


def matched(
    spec: DataSetSpec, entry: PlannedExperiment, *, realisations: int = 8
) -> tuple[MultisineExperiment, Multisines]:
    """The multisine like the command of an experiment, and the setting that it is played in; see above.

    Args:
        spec: The data set.
        entry: The experiment.
        realisations: Of the multisine.

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
    arm = experiment_arm(experiment)
    # The command is known without the physics.
    station = ControlStation(experiment, arm, np.random.default_rng(experiment.seed).spawn(2)[0])
    command = station.commands[:, joint_index(experiment.axes[0])]
    command = command - command.mean()
    record = IOData(command, command, SAMPLE_TIME)
    setting, multisines, _ = multisine_like(experiment, arm, [record], seed=seed, realisations=realisations)
    return setting, multisines


def _contents(spec: DataSetSpec, entry: PlannedExperiment, found: BestLinearTruth) -> Contents:
    response, band = found.servo.response, found.bandwidth
    along = ("frequency", "output", "input")
    complex_, truth = {"units": "1", "role": "truth"}, {"role": "truth"}
    parts = np.array(("real", "imaginary"))
    assert response.covariance is not None  # noqa: S101 - several realisations have one
    variables = {
        "input": Variable(
            ("input",), np.array(found.experiment.axes), {**truth, "long_name": "joints that are commanded"}
        ),
        "output": Variable(("output",), np.array(found.measured), {**truth, "long_name": "joints that are measured"}),
        "part": Variable(("part",), parts, {**truth, "long_name": "parts of a complex number"}),
        "other_part": Variable(("other_part",), parts, {**truth, "long_name": "parts of a complex number"}),
        "end": Variable(("end",), np.array(("lower", "upper")), {**truth, "long_name": "ends of an interval"}),
        "frequency": Variable(
            ("frequency",), response.frequencies, {"units": "Hz", **truth, "long_name": "frequencies that are excited"}
        ),
        "response": Variable(
            (*along, "part"),
            np.stack([response.response.real, response.response.imag], axis=-1),
            {**complex_, "long_name": "measured over commanded angle: real and imaginary part"},
        ),
        "covariance": Variable(
            (*along, "part", "other_part"),
            response.covariance,
            {**complex_, "long_name": "of real and imaginary part: noise and nonlinear distortion together"},
        ),
        **{
            f"{name}_variance": Variable(
                along, getattr(found.servo, f"{name}_variance"), {**complex_, "long_name": f"of the response: {text}"}
            )
            for name, text in (
                ("noise", "the mean, by noise"),
                ("total", "the mean, by noise and distortion"),
                ("distortion", "one realisation, by nonlinear distortion"),
            )
        },
        "bandwidth": Variable(along[1:], band.hz, {"units": "Hz", "long_name": "half-power bandwidth", **truth}),
        "bandwidth_ci95": Variable(
            ("end", *along[1:]), np.stack(band.ci95), {"units": "Hz", "long_name": "95 % interval", **truth}
        ),
        "distortion": Variable(
            ("output",),
            found.distortion_percent,
            {"units": "%", "long_name": "nonlinear distortion, root mean square over that of the linear part", **truth},
        ),
        "command_rms": Variable(
            ("input",),
            found.command_rms,
            {"units": "rad", **truth, "long_name": "root mean square of the command about its mean"},
        ),
    }
    attributes: dict[str, Attribute] = {
        "format": FORMAT,
        "data_set": spec.label,
        "experiment": entry.name,
        "arm": entry.arm,
        "realisations": found.servo.realisations,
        "degrees_of_freedom": float(response.degrees_of_freedom or np.nan),
        "slewing": found.slewing,
        "limited": found.limited,
        "license": LICENSE,
        **{f"provenance_{key}": value for key, value in found.provenance.items()},
    }
    return Contents(variables, attributes)


def read_best_linear(path: Path) -> FrequencyResponse:
    """Read a best linear approximation back, with its covariance.

    Raises:
        ScenarioError: No such file, or none of a best linear approximation.
    """
    contents = read_netcdf(path)
    if contents.attributes.get("format") != FORMAT:
        raise ScenarioError(f"{path} is no best linear approximation: expected the format {FORMAT!r}")
    v = {name: variable.values for name, variable in contents.variables.items()}
    return FrequencyResponse(
        v["frequency"],
        v["response"][..., 0] + 1j * v["response"][..., 1],
        SAMPLE_TIME,
        "best linear approximation",
        covariance=v["covariance"],
        degrees_of_freedom=float(np.asarray(contents.attributes["degrees_of_freedom"])),
        input_names=tuple(map(str, v["input"])),
        output_names=tuple(map(str, v["output"])),
    )
