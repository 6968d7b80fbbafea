"""A block of records in a data set's spec, and the experiments that it asks for."""

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, fields, replace
from itertools import product
from typing import Any, NamedTuple

from hmtb_twin import MODES, PAYLOADS, POSES, VARIANTS, Chain, HandController, Plant
from hmtb_twin.parameters.arm_description import ArmDescription
from hmtb_twin.parameters.plant import ACTUATOR_FORMS, FRICTIONS
from hmtb_twin.parameters.values import HAND_CONTROLLER, RECORDER, SAMPLE_RATE
from hmtb_twin.parameters.variants import JOINTS, OPERATING_POSE
from scenarios.experiments.arm_tests import interface
from scenarios.experiments.excitation_computer import Excitation
from scenarios.experiments.multisines import MultisineExperiment, Multisines, multisine_experiments
from scenarios.experiments.registry import load, names, tags, tests_of
from scenarios.experiments.scenario import NAME, Scenario, known_arm
from scenarios.files import codec
from scenarios.files.errors import ScenarioError, unknown

PARTS = ("train", "validation", "test")
"""Purposes of records: to identify from, to choose a model by, and to score it on."""


def check_ranges(table: str, record: object, ranges: Mapping[str, tuple[int, int]]) -> None:
    """Refuse numbers of a table of a spec that are out of range; above it they are slips of the keyboard.

    Raises:
        ScenarioError: A number below its least or above its largest value.
    """
    for name, (lower, upper) in ranges.items():
        value = getattr(record, name)
        if not lower <= value <= upper:
            # Cut, because a slip may have thousands of digits.
            raise ScenarioError(f"{table}: {name} = {str(value)[:20]} given, expected {lower} to {upper}")


PAYLOAD = "rpcm"
"""Default payload of the end effector."""

CHOICES: Mapping[str, tuple[str, ...]] = {
    "variants": tuple(VARIANTS),
    "payloads": tuple(PAYLOADS),
    "poses": tuple(POSES),
    "actuators": ACTUATOR_FORMS,
    "frictions": FRICTIONS,
    "joints": JOINTS,
}
"""Choices for the lists of a block."""


OWN: Mapping[str, tuple[str, ...]] = {"variants": ("nominal",), "payloads": (PAYLOAD,), "poses": (OPERATING_POSE,)}
"""Defaults of a block; of another machine they stand for its own payload and pose."""


@dataclass(frozen=True)
class RecordBlock:
    """A block of records: every combination of its lists is one experiment.

    A block plays one of three: registered `scenarios`; an `excitation` on `axes`; `multisines` on `axes`.

    Attributes:
        name: Experiments are named after it.
        part: What the records are for, one of `PARTS`.
        scenarios: Registered scenarios, or tags of them.
        axes: Axes to excite; with `each_axis` every joint that follows commands by default.
        each_axis: Whether each axis has a record of its own, instead of all at once.
        excitation: One entry, played on every axis, or one per axis.
        multisines: Random-phase multisines: every realisation and record of the measurement is an experiment.
        draw_waveforms: Whether random waveforms are drawn anew for every experiment, instead of from the seeds in the
            spec; multisines for every measurement, whose realisations and records belong together.
        amplitudes: Of the excitation, V; root mean square of multisines, rad; as written where there are none.
        joints: Joints whose commands are the inputs and whose angles the outputs; the excited joints by default, in
            Cartesian modes the three that the thesis studied.
        variants: Variants of the test bed.
        arm: An arm of another machine, by name or by the path of its files; its tests are its `scenarios`. Empty: the
            variants. Payload and pose are its own ones where the block names none.
        payloads: Payloads of the end effector.
        poses: Keyframes of the operating point.
        actuators: Forms of the actuators.
        frictions: Friction models of the joints.
        process_noises: Standard deviations of the drives' noise, part of the rated torque.
        mode: Control mode.
        repeats: Number of runs of each combination, with different noise.
        duration: Length, s; of scenarios their own by default.
        chain: Which links of the chain act.
        hand_controller: The hand-controller interface.
    """

    name: str
    part: str
    scenarios: tuple[str, ...] = ()
    axes: tuple[str, ...] = ()
    each_axis: bool = False
    excitation: tuple[Excitation, ...] = ()
    multisines: Multisines | None = None
    draw_waveforms: bool = False
    amplitudes: tuple[float, ...] = ()
    joints: tuple[str, ...] = ()
    variants: tuple[str, ...] = ("nominal",)
    payloads: tuple[str, ...] = (PAYLOAD,)
    poses: tuple[str, ...] = (OPERATING_POSE,)
    actuators: tuple[str, ...] = ("linear",)
    frictions: tuple[str, ...] = ("lugre",)
    process_noises: tuple[float, ...] = (0.0,)
    mode: str = "single_joint"
    repeats: int = 1
    duration: float | None = None
    chain: Chain = Chain()  # noqa: RUF009
    hand_controller: HandController = HAND_CONTROLLER
    arm: str = ""

    def __post_init__(self) -> None:
        for problem in self._problems():
            raise ScenarioError(f"records {self.name!r}: {problem}")
        check_ranges(f"records {self.name!r}", self, {"repeats": (1, 10_000)})

    def _problems(self) -> Iterator[str]:
        """Yield what is wrong in single settings, then what contradicts what."""
        yield from self._name_problems()
        yield from self._list_problems()
        yield from self._waveform_problems()

    def _name_problems(self) -> Iterator[str]:
        if not NAME.fullmatch(self.name):
            yield "expected 1 to 100 letters, digits, '.', '_', '-' or '+' as a name"
        if self.part not in PARTS:
            yield unknown("part", self.part, PARTS)
        if self.mode not in MODES:
            yield unknown("mode", self.mode, MODES)
        if self.arm:
            # Its joints, payloads and poses are checked when its experiments are planned: a list of specs reads no arm.
            if self.arm in VARIANTS:
                yield f"arm = {self.arm!r} given, expected another machine: variants = [{self.arm!r}] names it"
            if self.variants != ("nominal",):
                yield "arm and variants given, expected one of them"
            return
        for key, choices in CHOICES.items():
            yield from (unknown(key, value, choices) for value in getattr(self, key) if value not in choices)

    def _list_problems(self) -> Iterator[str]:
        """Yield the lists that name a value twice, which would make two experiments of one name, and empty ones."""
        for attribute in fields(self):
            values = getattr(self, attribute.name)
            # Two axes may be excited alike; the scenario refuses axes given twice.
            is_list_of_choices = isinstance(values, tuple) and attribute.name not in ("excitation", "axes")
            if is_list_of_choices and len(set(values)) < len(values):
                yield f"{attribute.name} = {values} given, expected each once"
        empty = [key for key in (*CHOICES, "process_noises") if key != "joints" and not getattr(self, key)]
        if empty:
            yield f"an empty list given for {', '.join(empty)}"

    def _waveform_problems(self) -> Iterator[str]:
        ways_to_excite = [bool(self.scenarios), bool(self.excitation), self.multisines is not None]
        if sum(ways_to_excite) != 1:
            yield f"expected one of scenarios, excitation and multisines, given {sum(ways_to_excite)}"
        if self.scenarios and (self.axes or self.each_axis):
            yield "axes given beside scenarios, which have their own"
        if not self.scenarios and not self.axes and not self.each_axis:
            yield "expected axes to excite, or each_axis = true for every joint of the arm alone; given none"
        if self.multisines is not None and self.duration is not None:
            yield "a duration given for multisines; it follows from period and periods"
        if self.excitation and self.duration is None:
            yield "expected a duration in s, given none"

    @property
    def arms(self) -> tuple[str, ...]:
        """The arms that the block runs on: variants of the test bed, or another machine."""
        return (self.arm,) if self.arm else self.variants

    def to_table(self) -> dict[str, Any]:
        """Write the block as plain values; of chain and hand controller only what differs from the nominal ones."""
        table = codec.unstructure(replace(self, chain=Chain(), hand_controller=HAND_CONTROLLER))
        table["chain"] = codec.changes(self.chain, Chain())
        table["hand_controller"] = codec.changes(self.hand_controller, HAND_CONTROLLER)
        excitation = table.pop("excitation")
        if excitation:
            table["excitation"] = excitation  # last, because tables stand behind values in TOML
        # Another machine has no variants, nor the payload and pose of the test bed: the file names none of them.
        for key, default in (("arm", ""), *(OWN.items() if self.arm else ())):
            if getattr(self, key) == default:
                del table[key]
        return {key: value for key, value in table.items() if value != {}}


class Template(NamedTuple):
    """An experiment without its twin and its seeds.

    Seeds follow from `key`, which is the same whatever else the spec asks for; marks and digits in `name` depend on
    how many other experiments there are.
    """

    name: str
    key: str
    block: RecordBlock
    experiment: Scenario | MultisineExperiment
    joints: tuple[str, ...]


class _Conditions(NamedTuple):
    """What makes an arm and its surroundings; a block lists values of each, and runs on every combination."""

    variant: str
    payload: str
    pose: str
    actuator: str
    friction: str
    process_noise: float


class _Measurement(NamedTuple):
    """An experiment on the nominal arm, with the key of its measurement, which all records of it share."""

    name: str
    key: str
    experiment: Scenario | MultisineExperiment


def templates(block: RecordBlock) -> Iterator[Template]:
    """The experiments of a block: each measurement on every combination of the conditions, repeated."""
    arm = _arm_of(block)
    # In the order of `_Conditions`.
    arms = _arms(block, arm)
    choices = (*arms, block.actuators, block.frictions, block.process_noises)
    combinations = map(_Conditions._make, product(*choices))
    for measurement, conditions, repeat in product(_measurements(block, arm), combinations, range(block.repeats)):
        experiment = measurement.experiment
        joints = block.joints or tuple(axis for axis in experiment.axes if axis in arm.joints) or arm.compared
        yield Template(
            name="-".join((measurement.name, *_condition_marks(block, choices, conditions, repeat))),
            # All conditions, also those that do not differ: an experiment keeps its seeds when the block gets others.
            key=" | ".join((block.name, measurement.key, *map(str, conditions), f"repeat {repeat}")),
            block=block,
            experiment=_under_conditions(block, experiment, conditions),
            joints=joints,
        )


def _arm_of(block: RecordBlock) -> ArmDescription:
    """The arm of a block; of several variants the first, as all have the same joints.

    Raises:
        ScenarioError: There is no such arm, it has no such joints, payloads or poses, or its bus has another rate.
    """
    if not block.arm:
        return VARIANTS[block.variants[0]]
    arm = known_arm(block.arm)
    _, payloads, poses = _arms(block, arm)
    for what, given, available in (
        ("joint", block.joints, arm.joints),
        ("payload", payloads, arm.payloads),
        ("pose", poses, arm.poses),
    ):
        for name in given:
            if name not in available:
                raise ScenarioError(f"records {block.name!r}: {unknown(what, name, available)}")
    if arm.sample_rate != SAMPLE_RATE:
        raise ScenarioError(
            f"records {block.name!r}: the position loop of {block.arm} runs at {arm.sample_rate} Hz, expected "
            f"{SAMPLE_RATE} Hz: all records of a data set have one sampling interval"
        )
    if arm.recorder != RECORDER:
        raise ScenarioError(
            f"records {block.name!r}: resolvers of {arm.recorder.resolver_bits} bit and {arm.recorder.noise:g} rad of "
            f"{block.arm} given, expected those of the test bed, {RECORDER.resolver_bits} bit and {RECORDER.noise:g} "
            "rad: the datasheet states one noise of all records"
        )
    return arm


def _arms(block: RecordBlock, arm: ArmDescription) -> tuple[tuple[str, ...], tuple[str, ...], tuple[str, ...]]:
    """Variants, payloads and poses of a block, where it names none those of its arm."""
    if not block.arm:
        return block.variants, block.payloads, block.poses
    payloads = (arm.tuned_payload,) if block.payloads == OWN["payloads"] else block.payloads
    poses = (arm.operating_pose,) if block.poses == OWN["poses"] else block.poses
    return (block.arm,), payloads, poses


def _condition_marks(
    block: RecordBlock, choices: Iterable[tuple[Any, ...]], conditions: _Conditions, repeat: int
) -> list[str]:
    """Words that distinguish an experiment from others of its block: only of conditions that differ in it."""
    words = (*conditions[:-1], f"noise{conditions.process_noise:g}")
    marks = [word for word, values in zip(words, choices, strict=True) if len(values) > 1]
    if block.repeats > 1:
        marks.append(f"r{repeat + 1:0{len(str(block.repeats))}d}")
    return marks


def _under_conditions(
    block: RecordBlock, experiment: Scenario | MultisineExperiment, conditions: _Conditions
) -> Scenario | MultisineExperiment:
    """The experiment on the arm and in the surroundings of its conditions."""
    payload, pose = conditions.payload, conditions.pose
    if block.scenarios and not block.arm:
        # Registered scenarios have a payload and a pose of their own, unless the block names others.
        if block.payloads == (PAYLOAD,):
            payload = experiment.payload
        if block.poses == (OPERATING_POSE,):
            pose = experiment.pose
    plant = Plant(actuator=conditions.actuator, friction=conditions.friction, process_noise=conditions.process_noise)
    return replace(experiment, variant=conditions.variant, payload=payload, pose=pose, plant=plant)


def _measurements(block: RecordBlock, arm: ArmDescription) -> Iterator[_Measurement]:
    """What a block plays, on the first of its arms."""
    if block.arm and block.scenarios:
        yield from _measurements_of_tests(block)
        return
    if block.scenarios:
        yield from _registered_measurements(block)
        return
    # Multisines have neither an excitation nor a duration of the block: theirs take the place of these.
    excitation_or_any = block.excitation or (Excitation("white_noise"),)
    duration_or_any = 1.0 if block.duration is None else block.duration
    axes_played_together = [(axis,) for axis in block.axes or arm.free] if block.each_axis else [block.axes]
    for axes in axes_played_together:
        name = f"{block.name}-{axes[0]}" if block.each_axis else block.name
        setting = Scenario(
            name=block.name,
            axes=axes,
            excitation=excitation_or_any,
            duration=duration_or_any,
            mode=block.mode,
            independent_channels=True,
            chain=block.chain,
            hand_controller=_interface(block, arm, axes),
            variant=arm.name,
            payload=arm.tuned_payload,
            pose=arm.operating_pose,
        )
        if block.multisines is not None:
            yield from _multisine_measurements(block, block.multisines, name, setting)
            continue
        for mark, volts, excitation in _amplified(block, block.excitation):
            experiment = replace(setting, excitation=excitation)
            yield _Measurement(f"{name}{mark}", f"{' '.join(axes)} {volts}", experiment)


def _interface(block: RecordBlock, arm: ArmDescription, axes: tuple[str, ...]) -> HandController:
    """The hand-controller interface of a block; on another machine by default that of the arm's own tests."""
    joints = [axis for axis in axes if axis in arm.joints]
    if not block.arm or block.hand_controller != HAND_CONTROLLER or not joints:
        return block.hand_controller
    return replace(HAND_CONTROLLER, **interface(arm, joints))


def _measurements_of_tests(block: RecordBlock) -> Iterator[_Measurement]:
    """Tests of the arm of a block, each at every amplitude.

    Raises:
        ScenarioError: The arm has no such test.
    """
    tests = tests_of(block.arm)
    for name_or_tag in block.scenarios:
        tagged = [name for name, table in tests.items() if name_or_tag in table["tags"]]
        if not tagged and name_or_tag not in tests:
            of_arm = f"test of the arm {block.arm}"
            raise ScenarioError(
                f"records {block.name!r}: "
                + unknown(of_arm, name_or_tag, tests, listing=f"hmtb scenarios --arm {block.arm}")
            )
        for name in tagged or (name_or_tag,):
            scenario = Scenario.from_table(tests[name])
            duration = scenario.duration if block.duration is None else block.duration
            for mark, volts, excitation in _amplified(block, scenario.excitation):
                experiment = replace(scenario, duration=duration, excitation=excitation)
                # Behind the name of the block: joints of two arms may have the same names.
                yield _Measurement(f"{block.name}-{name}{mark}", f"{name} {volts}", experiment)


def _registered_measurements(block: RecordBlock) -> Iterator[_Measurement]:
    """Registered scenarios of a block, each at every amplitude."""
    for name_or_tag in block.scenarios:
        scenario_names = names(name_or_tag) if name_or_tag in tags() else (name_or_tag,)
        for name in scenario_names:
            scenario = load(name)
            duration = scenario.duration if block.duration is None else block.duration
            for mark, volts, excitation in _amplified(block, scenario.excitation):
                experiment = replace(scenario, duration=duration, excitation=excitation)
                yield _Measurement(f"{scenario.name}{mark}", f"{scenario.name} {volts}", experiment)


def _multisine_measurements(
    block: RecordBlock, multisines: Multisines, name: str, setting: Scenario
) -> Iterator[_Measurement]:
    """Records of the multisine measurement on the axes of a setting, at every amplitude of a block."""
    for amplitude in block.amplitudes or (multisines.rms,):
        mark = f"-{1000 * amplitude:g}mrad" if len(block.amplitudes) > 1 else ""
        key = f"{' '.join(setting.axes)} {amplitude!r}"
        experiments = multisine_experiments(setting, replace(multisines, rms=amplitude))
        for number, experiment in enumerate(experiments, start=1):
            yield _Measurement(f"{name}{mark}-{number:02d}", key, experiment)


def _amplified(
    block: RecordBlock, excitation: tuple[Excitation, ...]
) -> Iterator[tuple[str, str, tuple[Excitation, ...]]]:
    """Yield the excitation at every amplitude of a block, behind its suffix of the name and its amplitudes as text."""
    for amplitude in block.amplitudes or (None,):
        mark = f"-{amplitude:g}V" if len(block.amplitudes) > 1 else ""
        amplified = excitation
        if amplitude is not None:
            amplified = tuple(_with_parameter(signal, "amplitude", amplitude) for signal in excitation)
        yield mark, " ".join(repr(signal.parameters.get("amplitude")) for signal in amplified), amplified


def _with_parameter(excitation: Excitation, name: str, value: float) -> Excitation:
    if name not in excitation.parameters:
        raise ScenarioError(f"excitation {excitation.kind!r} has no {name}; given amplitudes for it")
    return replace(excitation, parameters={**excitation.parameters, name: value})


def with_waveform_seed(experiment: Scenario | MultisineExperiment, seed: int) -> Scenario | MultisineExperiment:
    """The experiment with random waveforms drawn from a seed, those of the axes from consecutive ones."""
    if isinstance(experiment, MultisineExperiment):
        return replace(experiment, multisines=replace(experiment.multisines, seed=seed))
    seeded = []
    for axis, excitation in enumerate(experiment.excitation):
        if "seed" in excitation.parameters:
            seeded.append(_with_parameter(excitation, "seed", seed + axis))
        else:
            seeded.append(excitation)
    return replace(experiment, excitation=tuple(seeded))
