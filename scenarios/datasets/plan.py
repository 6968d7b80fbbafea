"""The experiments of a data set, each made on demand from the spec: a plan of any size needs little memory."""

from collections import Counter
from collections.abc import Hashable, Iterator, Mapping
from dataclasses import dataclass, fields, replace
from functools import lru_cache
from itertools import product
from typing import Any, NamedTuple

import numpy as np

from hmtb_twin import STUDIED_JOINTS, Experiment, Plant, Specimen
from hmtb_twin.parameters.specimen_draw import TwinDistributions, draw_specimen
from hmtb_twin.parameters.values import JOINTS, OPERATING_POSE, SAMPLE_RATE, SAMPLE_TIME
from scenarios.datasets.spec import DataSetSpec
from scenarios.datasets.spec_tables import PAYLOAD, RecordBlock
from scenarios.experiments.excitation_computer import Excitation
from scenarios.experiments.multisines import MultisineExperiment, multisine_experiments
from scenarios.experiments.registry import load, names, tags
from scenarios.experiments.scenario import Scenario
from scenarios.files.errors import ScenarioError

# The folder of a data set. A copy may lack TRUTH, which only a simulation knows.
DATA, TRUTH = "data", "truth"
SPEC = "spec.toml"  # the spec, all defaults written out, from which the data set can be built again
INDEX = "experiments.json"  # experiments in the order of the plan and pieces of the stages, with their array hashes
BUILD = "build.json"  # software that the data set was built with
SUMS = "SHA256SUMS"  # checksum of every other file
BASELINES = "baselines.csv"  # scores of known methods, a row for each
ATTAINABLE = "truth/attainable.csv"  # best attainable scores, a row for each scored record and output
UNFINISHED = ".unfinished"  # ending of the folder while the data set is being built
JOURNAL = "journal.sqlite"  # finished work of a build, from which it resumes; gone from a data set that is done

PRIVATE = ("seed", "process_noise")
"""Drawn values of an experiment, in the withheld index and not in the public one."""

LICENSE = "CC-BY-4.0"
"""SPDX identifier of the licence of the data."""


@dataclass(frozen=True, eq=False)
class ListedExperiment:
    """An experiment as the index of a data set lists it.

    Attributes:
        name: Its own name, that of its files.
        part: `train`, `validation` or `test`.
        block: Name of the block of records that asks for it.
        arm: Name of the arm under its conditions, that of the file of its truth.
        twin: Number of the randomised twin; None for a variant itself.
        joints: Joints whose commands are the inputs and whose angles the outputs.
    """

    name: str
    part: str
    block: str
    arm: str
    twin: int | None
    joints: tuple[str, ...]


@dataclass(frozen=True)
class PlannedExperiment(ListedExperiment):
    """An experiment of the plan of a data set.

    Attributes:
        experiment: The experiment to run.
    """

    experiment: Experiment

    @property
    def facts(self) -> dict[str, Any]:
        """Entry of the experiment in the index, without its hashes."""
        plant = ("actuator", "friction", "process_noise")
        return {
            **{entry.name: getattr(self, entry.name) for entry in fields(ListedExperiment)},
            "file": self.data,
            **{key: getattr(self.experiment, key) for key in ("seed", "variant", "payload", "pose")},
            **{key: getattr(self.experiment.plant, key) for key in plant},
        }

    @property
    def data(self) -> str:
        """File of what an analyst may see."""
        return f"{DATA}/{self.part}/{self.name}.nc"

    @property
    def signals(self) -> str:
        """File of what only the simulation knows."""
        return f"{TRUTH}/signals/{self.name}.nc"

    @property
    def best_linear(self) -> str:
        """File of the best linear approximation for its conditions."""
        return f"{TRUTH}/best-linear/{self.name}.nc"

    @property
    def attainable(self) -> str:
        """File of all floors of its record, if it is a scored one."""
        return f"{TRUTH}/attainable/{self.name}.json"


def arm_file(arm: str) -> str:
    """Return the path of the small-signal truth of an arm under its conditions."""
    return f"{TRUTH}/arms/{arm}.nc"


class _Template(NamedTuple):
    """An experiment without its twin and its seeds.

    Seeds follow from `key`, which is the same whatever else the spec asks for; marks and digits in `name` depend on
    how many other experiments there are.
    """

    name: str
    key: str
    block: RecordBlock
    experiment: Scenario | MultisineExperiment
    joints: tuple[str, ...]


class DataSetPlan:
    """The experiments of a spec in order: all of one twin, then all of the next.

    Raises:
        ScenarioError: Two experiments of one name, an experiment that the laboratory does not have, a length that is no
            whole number of samples, or a scored record that is hardly longer than its window.
    """

    def __init__(self, spec: DataSetSpec) -> None:
        self.spec = spec
        self.twins = spec.twins.count if spec.twins else 1
        self._templates = tuple(entry for block in spec.records for entry in _templates(block))
        twice = [name for name, count in Counter(entry.name for entry in self._templates).items() if count > 1]
        if twice:
            raise ScenarioError(
                f"data set {spec.name!r}: two experiments are called {', '.join(twice[:3])}; "
                "name the blocks differently"
            )
        arms: dict[Hashable, int] = {}
        self._arms: list[int] = []  # number of the arm of each template
        for template in self._templates:
            one, samples = template.experiment, round(template.experiment.duration * SAMPLE_RATE)
            if samples < 1 or abs(samples - one.duration * SAMPLE_RATE) > 1e-9 * samples:
                raise ScenarioError(
                    f"{template.name}: duration {one.duration:g} s given, expected a positive multiple of "
                    f"{SAMPLE_TIME:g} s"
                )
            if one.payload_changes:
                raise ScenarioError(f"{template.name}: payload_changes given, expected none: a record has one truth")
            if template.block.part != "train" and samples - spec.window < 10:
                raise ScenarioError(
                    f"{template.name} has {samples} samples, its window {spec.window}: expected 10 or more behind it "
                    "to score"
                )
            self._arms.append(arms.setdefault((one.variant, one.payload, one.pose, one.plant), len(arms)))

    def __len__(self) -> int:
        return len(self._templates) * self.twins

    def __getitem__(self, index: int) -> PlannedExperiment:
        if not 0 <= index < len(self):
            raise IndexError(f"experiment {index} of {len(self)}")
        twin, number = divmod(index, len(self._templates))
        template, drawn = self._templates[number], self.spec.twins is not None
        mark = f"twin-{twin:0{len(str(self.twins - 1))}d}-" if drawn else ""
        return PlannedExperiment(
            name=f"{mark}{template.name}",
            part=template.block.part,
            block=template.block.name,
            arm=f"{mark}arm-{self._arms[number]}",
            twin=twin if drawn else None,
            joints=template.joints,
            experiment=self._experiment(template, f"{mark}{template.name}", twin if drawn else None),
        )

    def __iter__(self) -> Iterator[PlannedExperiment]:
        return (self[index] for index in range(len(self)))

    def of_twin(self, twin: int | None = 0) -> Iterator[PlannedExperiment]:
        """Return the experiments of one twin, in order; all where there are no twins."""
        begin = len(self._templates) * (twin or 0)
        return (self[index] for index in range(begin, begin + len(self._templates)))

    def duration(self, index: int) -> float:
        """Return the length of a record by its number in the plan, s."""
        return self._templates[index % len(self._templates)].experiment.duration

    def brings_arm(self, index: int) -> bool:
        """Return whether the truth of the arm is computed with this experiment: the first one on the arm."""
        number = index % len(self._templates)
        return self._arms.index(self._arms[number]) == number

    @property
    def seconds(self) -> float:
        """Length of all records together, s."""
        return self.twins * sum(entry.experiment.duration for entry in self._templates)

    def _experiment(self, template: _Template, name: str, twin: int | None) -> Experiment:
        if self.spec.withheld:
            # Its seed is withheld: nothing random is known of it.
            return replace(template.experiment, name=name)
        key = template.key if twin is None else f"{template.key} | twin {twin}"
        one = template.experiment
        # The records of one multisine measurement share their waveforms' seed, not their noise.
        own = f"{key} | {one.realisation} {one.record}" if isinstance(one, MultisineExperiment) else key
        # Seeds of 62 bits, so that no two are equal among millions.
        (_, waveform), (noise, _) = (
            np.random.SeedSequence([self.spec.seed, *text.encode()]).generate_state(2, np.uint64) >> 2
            for text in (key, own)
        )
        waveform = int(waveform)
        one = replace(one, name=name, seed=int(noise))
        if self.spec.twins is not None and twin is not None:
            specimen, of_plant = _arm_of_twin(self.spec.twins.distributions, self.spec.seed, twin)
            one = replace(one, specimen=specimen, plant=replace(one.plant, **of_plant))  # type: ignore[arg-type]
        if not template.block.draw_waveforms:
            return one
        if isinstance(one, MultisineExperiment):
            return replace(one, multisines=replace(one.multisines, seed=waveform))
        seeded = [
            _with_parameter(entry, "seed", waveform + axis) if "seed" in entry.parameters else entry
            for axis, entry in enumerate(one.excitation)
        ]
        return replace(one, excitation=tuple(seeded))


@lru_cache(maxsize=1)
def _arm_of_twin(distributions: TwinDistributions, seed: int, twin: int) -> tuple[Specimen, Mapping[str, float]]:
    """Specimen and plant of a twin, kept for the next experiment, which is mostly on the same twin."""
    return draw_specimen(distributions, np.random.SeedSequence([seed, twin]))


def _templates(block: RecordBlock) -> Iterator[_Template]:
    """The experiments of a block: what is played, on every combination of its conditions, repeated."""
    # Whatever makes an arm and its surroundings, in the order of their product.
    lists = (
        *(block.variants, block.payloads, block.poses),
        *(block.actuators, block.frictions, block.process_noises),
    )
    for (name, key, experiment), values, repeat in product(_played(block), product(*lists), range(block.repeats)):
        variant, payload, pose, actuator, friction, noise = values
        words = (variant, payload, pose, actuator, friction, f"noise{noise:g}")
        marks = [word for word, known in zip(words, lists, strict=True) if len(known) > 1]
        if block.repeats > 1:
            marks.append(f"r{repeat + 1:0{len(str(block.repeats))}d}")
        # Registered scenarios have a payload and a pose of their own, unless the block names others.
        own = bool(block.scenarios)
        yield _Template(
            name="-".join((name, *marks)),
            key=" | ".join((block.name, key, *map(str, values), f"repeat {repeat}")),
            block=block,
            experiment=replace(
                experiment,
                variant=variant,
                payload=experiment.payload if own and block.payloads == (PAYLOAD,) else payload,
                pose=experiment.pose if own and block.poses == (OPERATING_POSE,) else pose,
                plant=Plant(actuator=actuator, friction=friction, process_noise=noise),
            ),
            joints=block.joints or tuple(axis for axis in experiment.axes if axis in JOINTS) or STUDIED_JOINTS,
        )


def _played(block: RecordBlock) -> Iterator[tuple[str, str, Scenario | MultisineExperiment]]:
    """Experiments on the nominal arm, each with its name and the key of its measurement, shared by its records."""
    if block.scenarios:
        for scenario in (load(one) for name in block.scenarios for one in (names(name) if name in tags() else (name,))):
            duration = scenario.duration if block.duration is None else block.duration
            for mark, volts, excitation in _amplified(block, scenario.excitation):
                played = replace(scenario, duration=duration, excitation=excitation)
                yield f"{scenario.name}{mark}", f"{scenario.name} {volts}", played
        return
    for axes in [(axis,) for axis in block.axes] if block.each_axis else [block.axes]:
        name, joined = f"{block.name}-{axes[0]}" if block.each_axis else block.name, " ".join(axes)
        setting = Scenario(
            name=block.name,
            axes=axes,
            excitation=block.excitation or (Excitation("white_noise"),),
            duration=1.0 if block.duration is None else block.duration,
            mode=block.mode,
            independent_channels=True,
            chain=block.chain,
            hand_controller=block.hand_controller,
        )
        if block.multisines is None:
            for mark, volts, excitation in _amplified(block, block.excitation):
                yield f"{name}{mark}", f"{joined} {volts}", replace(setting, excitation=excitation)
            continue
        for amplitude in block.amplitudes or (block.multisines.rms,):
            mark = f"-{1000 * amplitude:g}mrad" if len(block.amplitudes) > 1 else ""
            experiments = multisine_experiments(setting, replace(block.multisines, rms=amplitude))
            for number, experiment in enumerate(experiments, start=1):
                yield f"{name}{mark}-{number:02d}", f"{joined} {amplitude!r}", experiment


def _amplified(
    block: RecordBlock, excitation: tuple[Excitation, ...]
) -> Iterator[tuple[str, str, tuple[Excitation, ...]]]:
    """The excitation at every amplitude of a block, with the mark of its name and the volts of its key."""
    for amplitude in block.amplitudes or (None,):
        mark = f"-{amplitude:g}V" if len(block.amplitudes) > 1 else ""
        entries = excitation
        if amplitude is not None:
            entries = tuple(_with_parameter(one, "amplitude", amplitude) for one in excitation)
        yield mark, " ".join(repr(one.parameters.get("amplitude")) for one in entries), entries


def _with_parameter(entry: Excitation, name: str, value: float) -> Excitation:
    if name not in entry.parameters:
        raise ScenarioError(f"excitation {entry.kind!r} has no {name}; given amplitudes for it")
    return replace(entry, parameters={**entry.parameters, name: value})
