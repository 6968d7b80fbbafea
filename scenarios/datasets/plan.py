"""The experiments of a data set, each made on demand from the spec: a plan of any size needs little memory."""

from collections import Counter
from collections.abc import Hashable, Iterable, Iterator, Mapping
from dataclasses import dataclass, fields, replace
from functools import lru_cache
from itertools import chain
from typing import Any

import numpy as np

from hmtb_twin import Experiment, Specimen
from hmtb_twin.parameters.specimen_draw import TwinDistributions, draw_specimen
from hmtb_twin.parameters.values import SAMPLE_RATE, SAMPLE_TIME
from scenarios.datasets.record_block import Template, templates, with_waveform_seed
from scenarios.datasets.spec import DataSetSpec
from scenarios.experiments.multisines import MultisineExperiment
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
        experiment, plant = self.experiment, self.experiment.plant
        listed = {attribute.name: getattr(self, attribute.name) for attribute in fields(ListedExperiment)}
        return {
            **listed,
            "file": self.data,
            "seed": experiment.seed,
            "variant": experiment.variant,
            "payload": experiment.payload,
            "pose": experiment.pose,
            "actuator": plant.actuator,
            "friction": plant.friction,
            "process_noise": plant.process_noise,
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


class DataSetPlan:
    """The experiments of a spec in order: all of one twin, then all of the next.

    Raises:
        ScenarioError: Two experiments of one name, an experiment that the laboratory does not have, a length that is no
            whole number of samples, or a scored record that is hardly longer than its window.
    """

    def __init__(self, spec: DataSetSpec) -> None:
        self.spec = spec
        self.twins = spec.twins.count if spec.twins else 1
        self._templates = tuple(chain.from_iterable(map(templates, spec.records)))
        counts = Counter(template.name for template in self._templates)
        repeated = [name for name, count in counts.items() if count > 1]
        if repeated:
            raise ScenarioError(
                f"data set {spec.name!r}: two experiments are called {', '.join(repeated[:3])}; "
                "name the blocks differently"
            )
        for template in self._templates:
            _check_template(template, spec.window)
        self._arms = _arm_numbers(self._templates)

    def __len__(self) -> int:
        return len(self._templates) * self.twins

    def __getitem__(self, index: int) -> PlannedExperiment:
        if not 0 <= index < len(self):
            raise IndexError(f"experiment {index} of {len(self)}")
        round_number, template_number = divmod(index, len(self._templates))
        template = self._templates[template_number]
        twin = round_number if self.spec.twins is not None else None
        # As many digits as the last twin needs, so that files sort by twin.
        twin_mark = "" if twin is None else f"twin-{twin:0{len(str(self.twins - 1))}d}-"
        name = f"{twin_mark}{template.name}"
        return PlannedExperiment(
            name=name,
            part=template.block.part,
            block=template.block.name,
            arm=f"{twin_mark}arm-{self._arms[template_number]}",
            twin=twin,
            joints=template.joints,
            experiment=self._experiment(template, name, twin),
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
        template_number = index % len(self._templates)
        return self._arms.index(self._arms[template_number]) == template_number

    @property
    def seconds(self) -> float:
        """Length of all records together, s."""
        return self.twins * sum(template.experiment.duration for template in self._templates)

    def _experiment(self, template: Template, name: str, twin: int | None) -> Experiment:
        """The experiment of a template with its twin, its seed and its random waveforms."""
        if self.spec.withheld:
            # Its seed is withheld: nothing random is known of it.
            return replace(template.experiment, name=name)
        experiment = template.experiment
        measurement_key = template.key if twin is None else f"{template.key} | twin {twin}"
        record_key = measurement_key
        if isinstance(experiment, MultisineExperiment):
            # The records of one multisine measurement share their waveforms' seed, not their noise.
            record_key = f"{measurement_key} | {experiment.realisation} {experiment.record}"
        noise_seed, _ = self._seeds_of(record_key)
        _, waveform_seed = self._seeds_of(measurement_key)
        experiment = replace(experiment, name=name, seed=noise_seed)
        if self.spec.twins is not None and twin is not None:
            specimen, plant_changes = _drawn_arm(self.spec.twins.distributions, self.spec.seed, twin)
            plant = replace(experiment.plant, **plant_changes)  # type: ignore[arg-type]
            experiment = replace(experiment, specimen=specimen, plant=plant)
        if template.block.draw_waveforms:
            return with_waveform_seed(experiment, waveform_seed)
        return experiment

    def _seeds_of(self, key: str) -> tuple[int, int]:
        """Seeds of the noise and of the waveforms that follow from the seed of the spec and a key.

        They have 62 bits, so that no two are equal among millions, and the axes can be counted on from them within the
        63 bits that TOML and NetCDF hold.
        """
        sequence = np.random.SeedSequence([self.spec.seed, *key.encode()])
        noise_seed, waveform_seed = sequence.generate_state(2, np.uint64) >> 2
        return int(noise_seed), int(waveform_seed)


def _check_template(template: Template, window: int) -> None:
    """Refuse an experiment that makes no record, a record of two arms, or one that cannot be scored."""
    duration = template.experiment.duration
    samples = round(duration * SAMPLE_RATE)
    # Binary fractions: 0.14 s times 50 Hz is not 7 to the last digit.
    if samples < 1 or abs(samples - duration * SAMPLE_RATE) > 1e-9 * samples:
        raise ScenarioError(
            f"{template.name}: duration {duration:g} s given, expected a positive multiple of {SAMPLE_TIME:g} s"
        )
    if template.experiment.payload_changes:
        raise ScenarioError(f"{template.name}: payload_changes given, expected none: a record has one truth")
    if template.block.part != "train" and samples - window < 10:
        raise ScenarioError(
            f"{template.name} has {samples} samples, its window {window}: expected 10 or more behind it to score"
        )


def _arm_numbers(templates: Iterable[Template]) -> list[int]:
    """Number the arms under their conditions in the order in which the templates first use them; one per template."""
    number_of_arm: dict[Hashable, int] = {}
    arm_numbers = []
    for template in templates:
        experiment = template.experiment
        arm = (experiment.variant, experiment.payload, experiment.pose, experiment.plant)
        arm_numbers.append(number_of_arm.setdefault(arm, len(number_of_arm)))
    return arm_numbers


@lru_cache(maxsize=1)
def _drawn_arm(distributions: TwinDistributions, seed: int, twin: int) -> tuple[Specimen, Mapping[str, float]]:
    """Specimen and plant of a twin, kept for the next experiment, which is mostly on the same twin."""
    return draw_specimen(distributions, np.random.SeedSequence([seed, twin]))
