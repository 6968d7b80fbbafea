"""Random-phase multisines, and the experiments that play their realisations."""

from dataclasses import dataclass, replace
from itertools import product
from typing import Any, ClassVar, get_type_hints

import numpy as np

from hmtb_twin import NOMINAL_PLANT, NOMINAL_SPECIMEN, Chain, Experiment, HandController, Operator, Plant, Specimen
from hmtb_twin.arm_files.known_arms import arm_named
from hmtb_twin.control.data_acquisition import BOARD
from hmtb_twin.parameters.values import LARGE_MOTION, SAMPLE_RATE, SAMPLE_TIME
from hmtb_twin.parameters.variants import OPERATING_POSE
from scenarios.experiments.waveform import LONGEST, check_seed
from scenarios.files import codec
from scenarios.files.errors import ScenarioError
from sysid.design import sum_of_sines

GROUP = 4
"""Size of the groups of odd lines of which one, drawn at random, stays silent in an odd-random grid."""


@dataclass(frozen=True)
class Multisines:
    """R realisations of a random-phase multisine, each played for a whole number of periods.

    All lines of the grid have one amplitude; the phases are uniform and independent [Pintelon2012, ch. 4 and 5].
    A period is a whole number of ticks of the position loop, so every period of the command is the same to the bit.
    With n axes every realisation takes n records, whose phases are orthogonal over records at every line: record e
    turns axis j by 2 pi e j / n against the first, and all axes alike by a phase of its own.

    Attributes:
        rms: Root mean square of each axis's offset from the pose, rad.
        f_min: Lowest line, Hz.
        f_max: Highest line, Hz.
        period: Length of a period, s; 510 samples by default, so that holds of 2, 3 and 5 samples divide it.
        odd: Excite odd lines only and leave one of every four of those silent: even and odd nonlinear distortion then
            show separately, at the silent even and at the silent odd lines.
        realisations: R; at least two, because their scatter is the nonlinear distortion.
        periods: Steady periods of each record; at least two, because their scatter is the noise.
        settling: Periods before them in which the transient decays.
        seed: Draws the phases.
    """

    rms: float = 0.01
    f_min: float = 0.05
    f_max: float = 5.0
    period: float = 10.2
    odd: bool = False
    realisations: int = 16
    periods: int = 2
    settling: int = 1
    seed: int = 0

    def __post_init__(self) -> None:
        check_seed(self.seed)
        for name, type_hint in get_type_hints(type(self)).items():
            codec.structure(type_hint, getattr(self, name), f"multisines: {name}")
        ticks = self.period * SAMPLE_RATE
        is_whole = 8 <= ticks <= 10**6 and abs(ticks - round(ticks)) < 1e-6
        checks = {
            "rms": (0.0 < self.rms <= 1.0, "above 0 and up to 1 rad"),
            "period": (is_whole, "a multiple of 0.02 s from 0.16 s on"),
            "realisations": (2 <= self.realisations <= 10**4, "2 or more"),
            "periods": (2 <= self.periods <= 10**4, "2 or more"),
            "settling": (1 <= self.settling <= 10**4, "1 or more: records start at rest"),
            "f_max": (0.0 <= self.f_min <= self.f_max < SAMPLE_RATE / 2, f"f_min to below {SAMPLE_RATE / 2:g} Hz"),
        }
        for name, (passes, expected) in checks.items():
            if not passes:
                raise ScenarioError(f"multisines: {name} = {getattr(self, name)} given, expected {expected}")
        if self.duration > LONGEST:
            raise ScenarioError(f"multisines: records of {self.duration:g} s requested, expected up to {LONGEST:g} s")
        if not len(self.lines):
            raise ScenarioError(
                f"multisines: no line in {self.f_min:g} to {self.f_max:g} Hz; lines are {1 / self.period:g} Hz apart"
            )

    @property
    def samples(self) -> int:
        """Samples in a period."""
        return round(self.period * SAMPLE_RATE)

    @property
    def duration(self) -> float:
        """Length of a record, s."""
        return (self.settling + self.periods) * self.samples * SAMPLE_TIME

    @property
    def lines(self) -> np.ndarray:
        """Excited multiples of 1 / period (L,)."""
        band = self.band
        if not self.odd:
            return band
        odd = band[band % 2 == 1]
        group_starts = np.arange(0, len(odd) - GROUP + 1, GROUP)
        # A stream of its own: the phases are drawn from [seed, 0, realisation].
        silent = group_starts + np.random.default_rng([self.seed, 1]).integers(0, GROUP, len(group_starts))
        return np.delete(odd, silent)

    @property
    def band(self) -> np.ndarray:
        """All multiples of 1 / period between the lowest and the highest line, excited or silent."""
        multiples = np.arange(1, (self.samples - 1) // 2 + 1)
        frequencies = multiples / self.period
        # A line that stands at an end of the band belongs to it, whatever its last digit.
        return multiples[(frequencies >= self.f_min - 1e-9) & (frequencies <= self.f_max + 1e-9)]

    def offsets(self, realisation: int, record: int = 0, axes: int = 1) -> np.ndarray:
        """Return one record's offsets from the pose.

        Args:
            realisation: Which realisation, 0 to R - 1.
            record: Which of its records, 0 to axes - 1.
            axes: Axes excited at once.

        Returns:
            Offsets (N, axes) at 50 Hz, rad, N = 50 duration.
        """
        lines = self.lines
        # The same draws for every record: their phases must stay orthogonal.
        rng = np.random.default_rng([self.seed, 0, realisation])
        axis_phases = rng.random((axes, len(lines)))
        record_phases = rng.random((axes, len(lines)))
        turns = axis_phases + record_phases[record] + (record * np.arange(axes)[:, None]) / axes
        # Every line carries an equal part of the mean square: |X_k|^2 = rms^2 N^2 / (2 L) in numpy's scaling.
        height = self.rms * self.samples / np.sqrt(2.0 * len(lines))
        return np.tile(sum_of_sines(self.samples, lines, turns.T, height), (self.settling + self.periods, 1))


MODE = "single_joint"
"""Control mode in which an offset of the stick is an offset of a joint."""


@dataclass(frozen=True)
class MultisineExperiment:
    """One record of one realisation of a multisine, played on the joints of an arm.

    The excitation computer's files of 100 points last two seconds; this experiment plays from a longer memory, through
    the same converters, wires and hand controller. The attributes not named here are those of every `Experiment`.

    Attributes:
        axes: The excited joints.
        multisines: The excitation class.
        realisation: Number of the realisation.
        record: Number of the record in its realisation.
        seed: Seed of the laboratory's noise in this record.
    """

    name: str
    axes: tuple[str, ...]
    multisines: Multisines = Multisines()
    realisation: int = 0
    record: int = 0
    variant: str = "nominal"
    payload: str = "rpcm"
    plant: Plant = NOMINAL_PLANT
    specimen: Specimen = NOMINAL_SPECIMEN
    pose: str = OPERATING_POSE
    worksite: bool = False
    chain: Chain = Chain()  # noqa: RUF009
    hand_controller: HandController = LARGE_MOTION
    seed: int = 0
    mode: str = MODE
    shutdown: tuple[float, ...] = ()
    payload_changes: ClassVar[tuple[()]] = ()

    @property
    def duration(self) -> float:
        """Length of the record, s."""
        return self.multisines.duration

    @property
    def period(self) -> int:
        """Ticks of the arm's position loop in a period."""
        return round(self.multisines.period * self.sample_rate)

    @property
    def settling(self) -> int:
        """Ticks before the steady periods."""
        return self.multisines.settling * self.period

    @property
    def sample_rate(self) -> int:
        """Rate of the arm's position loop, Hz."""
        return arm_named(self.variant).sample_rate

    def offsets(self) -> np.ndarray:
        """Return the requested offsets of the joints (N, n_axes), rad, before any converter.

        The excitation computer plays 50 points a second; a faster position loop holds each of them.
        """
        points = self.multisines.offsets(self.realisation, self.record, len(self.axes))
        if self.sample_rate == SAMPLE_RATE:
            return points
        ticks = np.arange(round(self.duration * self.sample_rate))
        return points[ticks * SAMPLE_RATE // self.sample_rate]

    def volts(self) -> np.ndarray:
        """Return the excitation computer's output (N, n_axes), V.

        Raises:
            ScenarioError: The multisine exceeds the range of the converter.
        """
        volts = self.offsets() / self.hand_controller.gain
        if BOARD.exceeds_range(volts).any():
            raise ScenarioError(
                f"{self.name}: a multisine of {self.multisines.rms:g} rad has peaks of {np.abs(volts).max():.3g} V; "
                "expected less than the converter's 10 V: lower rms, or raise the hand controller's gain"
            )
        return BOARD.convert(volts, rounds=self.chain.dac)

    def operator(self) -> Operator | None:
        """No operator: the excitation computer moves the stick."""
        return None


def multisine_experiments(setting: Experiment, multisines: Multisines) -> tuple[MultisineExperiment, ...]:
    """Return the experiments of a measurement: R realisations of as many records as axes, in this order.

    Args:
        setting: Any experiment in single-joint mode; only its excitation and its length are not used. Its seed draws
            the seeds of the records.
        multisines: The excitation class.

    Raises:
        ScenarioError: Another mode, a sample and hold that does not divide the period, a shutdown, or an amplitude that
            the converters do not resolve.
    """
    chain, interface = setting.chain, setting.hand_controller
    hold = interface.hold if chain.hold else 1
    # Half a count of the coarsest converter that rounds, as an angle, rad: smaller ones are rounded to zero.
    converters = ((chain.dac, BOARD.dac_step), (chain.adc, interface.adc_step))
    coarsest_step = max((step for rounds, step in converters if rounds), default=0.0)
    smallest_rms = 0.5 * interface.gain * coarsest_step
    rate = arm_named(setting.variant).sample_rate
    period = multisines.period * rate
    problems = [
        (
            abs(period - round(period)) > 1e-6,
            f"a period of {multisines.period:g} s given, expected a whole number of ticks of the position loop of "
            f"{setting.variant}, of {1.0 / rate:g} s each",
        ),
        (setting.mode != MODE, f"mode {setting.mode} given, expected {MODE}"),
        (bool(setting.shutdown), "an emergency shutdown given, expected none: the record must be periodic"),
        (bool(setting.payload_changes), "payload_changes given, expected none: the record must be periodic"),
        (
            round(period) % hold != 0,
            f"a hand controller that holds {hold} samples given, expected one whose hold divides the period of "
            f"{round(period)} samples",
        ),
        (
            multisines.rms < smallest_rms,
            f"an amplitude of {multisines.rms:g} rad given, expected {smallest_rms:.3g} rad or more: below half a "
            "count of the converters the noise of the wires, not the multisine, moves the command",
        ),
    ]
    for fails, message in problems:
        if fails:
            raise ScenarioError(f"{setting.name}, best linear approximation: {message}")
    shared = ("name", "variant", "payload", "plant", "specimen", "pose", "worksite", "chain", "hand_controller")
    values: dict[str, Any] = {name: getattr(setting, name) for name in shared}
    first = MultisineExperiment(axes=tuple(setting.axes), multisines=multisines, **values)
    numbers = list(product(range(multisines.realisations), range(len(first.axes))))
    # 63 bits: what a record's file can hold.
    seeds = np.random.SeedSequence([setting.seed, 5]).generate_state(len(numbers), np.uint64) >> np.uint64(1)
    experiments = []
    for (realisation, record), seed in zip(numbers, seeds, strict=True):
        name = f"{first.name}-{realisation}-{record}"
        experiments.append(replace(first, name=name, realisation=realisation, record=record, seed=int(seed)))
    return tuple(experiments)
