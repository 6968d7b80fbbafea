"""The experiments of a data set, each made on demand from the spec: a plan of any size needs little memory."""

from collections import Counter
from collections.abc import Hashable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import product
from pathlib import PurePosixPath
from typing import overload

import numpy as np

from hmtb_twin import STUDIED_JOINTS, Experiment, Plant, Specimen
from hmtb_twin.parameters.specimen_draw import draw_specimen
from hmtb_twin.parameters.values import JOINTS, OPERATING_POSE, SAMPLE_RATE, SAMPLE_TIME
from scenarios.datasets.spec import DataSetSpec
from scenarios.datasets.spec_tables import PAYLOAD, RecordBlock
from scenarios.experiments.excitation_computer import Excitation
from scenarios.experiments.multisines import MultisineExperiment, multisine_experiments
from scenarios.experiments.registry import load, names, tags
from scenarios.experiments.scenario import Scenario
from scenarios.files.errors import ScenarioError

DATA = "data"
"""Folder of what an analyst may see: `data/<part>/<experiment>.nc`."""

TRUTH = "truth"
"""Folder of what only a simulation knows; a copy of the data set may lack it."""

SPEC = "spec.toml"
"""The spec, all defaults written out, from which the data set can be built again."""

JOURNAL = "journal.sqlite"
"""Finished work of a build, from which it resumes; gone from a data set that is done."""

INDEX = "experiments.json"
"""Every experiment with its part, joints, seeds, conditions, file and array hashes, in the order of the plan; and the
pieces of the stages."""

BUILD = "build.json"
"""Software that the data set was built with."""

SUMS = "SHA256SUMS"
"""Checksum of every other file."""

BASELINES = "baselines.csv"
"""Scores of known methods, a row for each."""

ATTAINABLE = "truth/attainable.csv"
"""Best attainable scores, a row for each scored record and output."""

LICENSE = "CC-BY-4.0"
"""SPDX identifier of the licence of the data."""

UNFINISHED = ".unfinished"
"""Ending of the folder while the data set is being built."""


def data_file(part: str, experiment: str) -> PurePosixPath:
    """Return the path of the record of an experiment."""
    return PurePosixPath(DATA, part, f"{experiment}.nc")


def signals_file(experiment: str) -> PurePosixPath:
    """Return the path of the signals that only the simulation knows."""
    return PurePosixPath(TRUTH, "signals", f"{experiment}.nc")


def arm_file(arm: str) -> PurePosixPath:
    """Return the path of the small-signal truth of an arm under its conditions."""
    return PurePosixPath(TRUTH, "arms", f"{arm}.nc")


def best_linear_file(experiment: str) -> PurePosixPath:
    """Return the path of the best linear approximation for the conditions of an experiment."""
    return PurePosixPath(TRUTH, "best-linear", f"{experiment}.nc")


def attainable_file(experiment: str) -> PurePosixPath:
    """Return the path of all floors of a scored record."""
    return PurePosixPath(TRUTH, "attainable", f"{experiment}.json")


def baseline_file(method: str) -> PurePosixPath:
    """Return the path of the scores of a baseline, written as in a spec, ``"oe:2/2/1"``, on every record."""
    return PurePosixPath("baselines", f"{method.replace(':', '-').replace('/', '-')}.json")


LEAST_SCORED = 10
"""Samples of a scored record behind its window at least."""

CONDITIONS = ("variants", "payloads", "poses", "actuators", "frictions", "process_noises")
"""The lists of a block that make an arm and its surroundings, in the order of their product."""


@dataclass(frozen=True)
class PlannedExperiment:
    """One experiment of a data set.

    Attributes:
        name: Its own name, that of its files.
        part: `train`, `validation` or `test`.
        block: Name of the block of records that asks for it.
        arm: Name of the arm under its conditions, that of the file of its truth.
        twin: Number of the randomised twin; None for a variant itself.
        joints: Joints whose commands are the inputs and whose angles the outputs.
        experiment: The experiment to run.
    """

    name: str
    part: str
    block: str
    arm: str
    twin: int | None
    joints: tuple[str, ...]
    experiment: Experiment

    @property
    def data(self) -> str:
        """File of what an analyst may see."""
        return str(data_file(self.part, self.name))

    @property
    def signals(self) -> str:
        """File of what only the simulation knows."""
        return str(signals_file(self.name))

    @property
    def arm_truth(self) -> str:
        """File of the truth about its arm."""
        return str(arm_file(self.arm))

    @property
    def best_linear(self) -> str:
        """File of the best linear approximation for its conditions."""
        return str(best_linear_file(self.name))


@dataclass(frozen=True)
class _Template:
    """An experiment without its twin and its seeds.

    Seeds follow from `key`, which is the same whatever else the spec asks for; marks and digits in `name` depend on
    how many other experiments there are.
    """

    name: str
    key: str
    block: RecordBlock
    experiment: Scenario | MultisineExperiment
    joints: tuple[str, ...]

    @property
    def condition(self) -> Hashable:
        """What makes an arm and its surroundings."""
        return self.experiment.variant, self.experiment.payload, self.experiment.pose, self.experiment.plant


class DataSetPlan(Sequence[PlannedExperiment]):
    """The experiments of a spec in order: all of one twin, then all of the next.

    Args:
        spec: The spec.

    Raises:
        ScenarioError: Two experiments of one name, an experiment that the laboratory does not have, a length that is no
            whole number of samples, or a scored record that is hardly longer than its window.
    """

    def __init__(self, spec: DataSetSpec) -> None:
        self.spec = spec
        self._templates = tuple(entry for block in spec.records for entry in _templates(block))
        twice = [name for name, count in Counter(entry.name for entry in self._templates).items() if count > 1]
        if twice:
            raise ScenarioError(
                f"data set {spec.name!r}: two experiments are called {', '.join(twice[:3])}; "
                "name the blocks differently"
            )
        for template in self._templates:
            _check_length(template, spec.window)
        self._last: tuple[int, tuple[Specimen, Mapping[str, float]]] | None = None
        self._arms = {c: n for n, c in enumerate(dict.fromkeys(entry.condition for entry in self._templates))}
        first = {entry.condition: number for number, entry in reversed(list(enumerate(self._templates)))}
        self._first = frozenset(first.values())

    @cached_property
    def twins(self) -> int:
        """Number of arms that every experiment is run on."""
        return self.spec.twins.count if self.spec.twins else 1

    def __len__(self) -> int:
        return len(self._templates) * self.twins

    @overload
    def __getitem__(self, index: int) -> PlannedExperiment: ...
    @overload
    def __getitem__(self, index: slice) -> tuple[PlannedExperiment, ...]: ...
    def __getitem__(self, index: int | slice) -> PlannedExperiment | tuple[PlannedExperiment, ...]:
        if isinstance(index, slice):
            return tuple(self[i] for i in range(*index.indices(len(self))))
        if not -len(self) <= index < len(self):
            raise IndexError(f"experiment {index} of {len(self)}")
        twin, number = divmod(index % len(self), len(self._templates))
        return self._entry(self._templates[number], twin if self.spec.twins else None)

    def __iter__(self) -> Iterator[PlannedExperiment]:
        return (self[i] for i in range(len(self)))

    def duration(self, index: int) -> float:
        """Return the length of a record by its number in the plan, s."""
        return self._templates[index % len(self._templates)].experiment.duration

    def brings_arm(self, index: int) -> bool:
        """Return whether an experiment is the first on its arm, whose truth is made with it."""
        return index % len(self._templates) in self._first

    @property
    def seconds(self) -> float:
        """Length of all records together, s."""
        return self.twins * sum(entry.experiment.duration for entry in self._templates)

    def _entry(self, template: _Template, twin: int | None) -> PlannedExperiment:
        mark = "" if twin is None else f"twin-{twin:0{len(str(self.twins - 1))}d}-"
        name = f"{mark}{template.name}"
        return PlannedExperiment(
            name=name,
            part=template.block.part,
            block=template.block.name,
            arm=f"{mark}arm-{self._arms[template.condition]}",
            twin=twin,
            joints=template.joints,
            experiment=self._experiment(template, name, twin),
        )

    def _experiment(self, template: _Template, name: str, twin: int | None) -> Experiment:
        if self.spec.withheld:
            # Its seed is withheld: nothing random is known of it.
            return replace(template.experiment, name=name)
        key = template.key if twin is None else f"{template.key} | twin {twin}"
        one = template.experiment
        # The records of one multisine measurement share their waveforms' seed, not their noise.
        own = f"{key} | {one.realisation} {one.record}" if isinstance(one, MultisineExperiment) else key
        waveform, noise = _seeds(self.spec, key)[1], _seeds(self.spec, own)[0]
        one = replace(one, name=name, seed=noise)
        if self.spec.twins is not None and twin is not None:
            specimen, of_plant = self._drawn(twin)
            one = replace(one, specimen=specimen, plant=replace(one.plant, **of_plant))  # type: ignore[arg-type]
        if not template.block.draw_waveforms:
            return one
        if isinstance(one, MultisineExperiment):
            return replace(one, multisines=replace(one.multisines, seed=waveform))
        return replace(one, excitation=tuple(_reseeded(e, waveform + k) for k, e in enumerate(one.excitation)))

    def _drawn(self, twin: int) -> tuple[Specimen, Mapping[str, float]]:
        """Specimen and plant of a twin, kept for the next experiment, which is mostly on the same twin."""
        assert self.spec.twins is not None  # noqa: S101 - only a spec with twins has any
        if self._last is None or self._last[0] != twin:
            self._last = (
                twin,
                draw_specimen(self.spec.twins.distributions, np.random.SeedSequence([self.spec.seed, twin])),
            )
        return self._last[1]


def _check_length(template: _Template, window: int) -> None:
    """Refuse a length that the laboratory or the score would refuse later."""
    duration = template.experiment.duration
    samples = round(duration * SAMPLE_RATE)
    if samples < 1 or abs(samples - duration * SAMPLE_RATE) > 1e-9 * samples:
        raise ScenarioError(
            f"{template.name}: duration {duration:g} s given, expected a positive multiple of {SAMPLE_TIME:g} s"
        )
    if template.block.part != "train" and samples - window < LEAST_SCORED:
        raise ScenarioError(
            f"{template.name} has {samples} samples, its window {window}: expected {LEAST_SCORED} or more behind it to "
            "score"
        )


def _seeds(spec: DataSetSpec, key: str) -> tuple[int, int]:
    """Seeds of noise and waveform of an experiment. Of 62 bits, so that no two are equal among millions."""
    seeds = np.random.SeedSequence([spec.seed, *key.encode()]).generate_state(2, np.uint64)
    return int(seeds[0]) >> 2, int(seeds[1]) >> 2


def _reseeded(excitation: Excitation, seed: int) -> Excitation:
    if "seed" not in excitation.parameters:
        return excitation
    return replace(excitation, parameters={**excitation.parameters, "seed": seed})


def _templates(block: RecordBlock) -> Iterator[_Template]:
    """The experiments of a block: what is played, on every combination of its conditions, repeated."""
    lists = [getattr(block, key) for key in CONDITIONS]
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
    """What is played on the nominal arm, with its name and its key; records of one measurement share the latter."""
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
            duration=block.duration or 1.0,
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
        entries = excitation if amplitude is None else tuple(_with_amplitude(one, amplitude) for one in excitation)
        yield mark, " ".join(repr(one.parameters.get("amplitude")) for one in entries), entries


def _with_amplitude(entry: Excitation, amplitude: float) -> Excitation:
    if "amplitude" not in entry.parameters:
        raise ScenarioError(f"excitation {entry.kind!r} has no amplitude; given amplitudes for it")
    return replace(entry, parameters={**entry.parameters, "amplitude": amplitude})
