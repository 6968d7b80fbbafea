"""Random-phase multisines and the experiment that plays one realisation."""

from dataclasses import dataclass, replace

import numpy as np

from hmtb_twin import NOMINAL_PLANT, NOMINAL_SPECIMEN, Chain, Experiment, HandController, Operator, Plant, Specimen
from hmtb_twin.control.data_acquisition import BOARD
from hmtb_twin.parameters.values import HAND_CONTROLLER, OPERATING_POSE, SAMPLE_RATE, SAMPLE_TIME
from scenarios.experiments.waveform import LONGEST, check_seed
from scenarios.files.errors import ScenarioError

GROUP = 4
"""Of so many consecutive odd lines one, drawn at random, stays silent in an odd-random grid."""


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
        period: Length of a period, s.
        odd: Excite odd lines only and leave one of every four of those silent too: even and odd nonlinear distortion
            then show apart, at the silent even and at the silent odd lines.
        realisations: R; two at least, for the nonlinear distortion is the scatter between them.
        periods: Steady periods of each record; two at least, for the noise is the scatter between them.
        settling: Periods played before them, in which the transient dies out.
        seed: Draws the phases.
    """

    rms: float = 0.01
    f_min: float = 0.05
    f_max: float = 5.0
    period: float = 10.24
    odd: bool = False
    realisations: int = 16
    periods: int = 2
    settling: int = 1
    seed: int = 0

    def __post_init__(self) -> None:
        check_seed(self.seed)
        self._check_types()
        ticks = self.period * SAMPLE_RATE
        wanted = {
            "rms": (0.0 < self.rms <= 1.0, "above 0 and up to 1 rad"),
            "period": (8 <= ticks <= 10**6 and abs(ticks - round(ticks)) < 1e-6, "a multiple of 0.02 s from 0.16 s on"),
            "realisations": (2 <= self.realisations <= 10**4, "2 or more"),
            "periods": (2 <= self.periods <= 10**4, "2 or more"),
            "settling": (1 <= self.settling <= 10**4, "1 or more: records start at rest"),
            "f_max": (0.0 <= self.f_min <= self.f_max < SAMPLE_RATE / 2, f"f_min to below {SAMPLE_RATE / 2:g} Hz"),
        }
        for name, (passes, expected) in wanted.items():
            if not passes:
                raise ScenarioError(f"multisines: {name} = {getattr(self, name)} given, expected {expected}")
        if self.duration > LONGEST:
            raise ScenarioError(f"multisines: records of {self.duration:g} s asked for, expected up to {LONGEST:g} s")
        if not len(self.lines):
            raise ScenarioError(
                f"multisines: no line in {self.f_min:g} to {self.f_max:g} Hz; lines are {1 / self.period:g} Hz apart"
            )

    def _check_types(self) -> None:
        kinds = {
            "a number": (int | float | np.integer | np.floating, ("rms", "f_min", "f_max", "period")),
            "a whole number": (int | np.integer, ("realisations", "periods", "settling")),
            "True or False": (bool | np.bool_, ("odd",)),
        }
        for expected, (kind, names) in kinds.items():
            for name in names:
                value = getattr(self, name)
                if not isinstance(value, kind) or (name != "odd" and isinstance(value, bool)):
                    raise ScenarioError(f"multisines: {name} = {value!r} given, expected {expected}")

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
        groups = np.arange(0, len(odd) - GROUP + 1, GROUP)
        silent = groups + np.random.default_rng([self.seed, 1]).integers(0, GROUP, len(groups))
        return np.delete(odd, silent)

    @property
    def band(self) -> np.ndarray:
        """All multiples of 1 / period between the lowest and the highest line, excited or silent."""
        multiples = np.arange(1, (self.samples - 1) // 2 + 1)
        frequencies = multiples / self.period
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
        rng = np.random.default_rng([self.seed, 0, realisation])
        of_axes = rng.random((axes, len(lines)))
        of_records = rng.random((axes, len(lines)))
        turns = of_axes + of_records[record] + (record * np.arange(axes)[:, None]) / axes
        spectrum = np.zeros((self.samples // 2 + 1, axes), dtype=complex)
        # Every line carries an equal part of the mean square: |X_k|^2 = rms^2 N^2 / (2 L) in numpy's scaling.
        spectrum[lines] = (self.rms * self.samples / np.sqrt(2.0 * len(lines))) * np.exp(2j * np.pi * turns).T
        one = np.fft.irfft(spectrum, self.samples, axis=0)
        return np.tile(one, (self.settling + self.periods, 1))


MODE = "single_joint"
"""The control mode in which the stick's offset is a joint's offset."""


@dataclass(frozen=True)
class MultisineExperiment:
    """One record of one realisation of a multisine, played on the joints of an arm.

    The excitation computer's files of 100 points last two seconds; this one plays from a longer memory, through the
    same converters, wires and hand controller.

    Attributes:
        name: Its name in messages and logs.
        axes: The joints excited.
        multisines: The excitation class.
        realisation: Which realisation this is.
        record: Which of its records.
        variant: Arm variant.
        payload: What the end effector holds.
        plant: What the drives run on and rub with.
        specimen: How this one arm deviates from its variant.
        pose: Keyframe about which the joints are excited.
        worksite: Whether the arm stands at its worksite.
        chain: Which links of the chain act.
        hand_controller: The hand-controller interface.
        seed: Of the laboratory's noise in this record.
        mode: Control mode.
        shutdown: No emergency shutdowns.
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
    hand_controller: HandController = HAND_CONTROLLER
    seed: int = 0
    mode: str = MODE
    shutdown: tuple[float, ...] = ()

    @property
    def duration(self) -> float:
        """Length of the record, s."""
        return self.multisines.duration

    def offsets(self) -> np.ndarray:
        """Return the requested offsets of the joints (N, n_axes), rad, before any converter."""
        return self.multisines.offsets(self.realisation, self.record, len(self.axes))

    def volts(self) -> np.ndarray:
        """Return the excitation computer's output (N, n_axes), V.

        Raises:
            ScenarioError: The multisine asks for more than the converter gives.
        """
        volts = self.offsets() / self.hand_controller.gain
        if BOARD.exceeds_range(volts).any():
            raise ScenarioError(
                f"{self.name}: a multisine of {self.multisines.rms:g} rad has peaks of {np.abs(volts).max():.3g} V; "
                "expected less than the converter's 10 V: lower rms, or raise the hand controller's gain"
            )
        return BOARD.convert(volts, rounds=self.chain.dac)

    def operator(self) -> Operator | None:
        """Nobody: the excitation computer moves the stick."""
        return None


def multisine_experiments(setting: Experiment, multisines: Multisines) -> tuple[MultisineExperiment, ...]:
    """Return the records of a measurement: R realisations of as many records as axes, in this order.

    Args:
        setting: Any experiment in single-joint mode: its arm, payload, plant, specimen, pose, axes, chain and hand
            controller are taken, its seed draws those of the records; its excitation and length are not.
        multisines: The excitation class.

    Raises:
        ScenarioError: Another mode, a sample and hold that no period is a multiple of, a shutdown, or an amplitude that
            the converters do not resolve.
    """
    hold = setting.hand_controller.hold if setting.chain.hold else 1
    least = _resolved(setting)
    wrong = [
        (setting.mode != MODE, f"mode {setting.mode} given, expected {MODE}"),
        (bool(setting.shutdown), "an emergency shutdown given, expected none: the record must be periodic"),
        (
            multisines.samples % hold != 0,
            f"a hand controller that holds {hold} samples given, expected one whose hold divides the period of "
            f"{multisines.samples} samples",
        ),
        (
            multisines.rms < least,
            f"an amplitude of {multisines.rms:g} rad given, expected {least:.3g} rad or more: below half a count of "
            "the converters the noise of the wires, not the multisine, moves the command",
        ),
    ]
    for fails, message in wrong:
        if fails:
            raise ScenarioError(f"{setting.name}, best linear approximation: {message}")
    first = MultisineExperiment(
        name=setting.name,
        axes=tuple(setting.axes),
        multisines=multisines,
        variant=setting.variant,
        payload=setting.payload,
        plant=setting.plant,
        specimen=setting.specimen,
        pose=setting.pose,
        worksite=setting.worksite,
        chain=setting.chain,
        hand_controller=setting.hand_controller,
    )
    records = [(r, e) for r in range(multisines.realisations) for e in range(len(first.axes))]
    # 63 bits: what a record's file can hold.
    seeds = np.random.SeedSequence([setting.seed, 5]).generate_state(len(records), np.uint64) >> np.uint64(1)
    return tuple(
        replace(first, name=f"{first.name}-{r}-{e}", realisation=r, record=e, seed=int(seed))
        for (r, e), seed in zip(records, seeds, strict=True)
    )


def _resolved(setting: Experiment) -> float:
    """The angle that half a count of the coarsest converter that rounds stands for, rad: less is rounded to nothing."""
    converters = ((setting.chain.dac, BOARD.dac_step), (setting.chain.adc, setting.hand_controller.adc_step))
    return 0.5 * setting.hand_controller.gain * max((step for rounds, step in converters if rounds), default=0.0)
