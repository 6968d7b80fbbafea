"""One record of a multisine measurement, an experiment like any other."""

from dataclasses import dataclass, replace

import numpy as np

from hmtb_twin import NOMINAL_PLANT, NOMINAL_SPECIMEN, Chain, Experiment, HandController, Operator, Plant, Specimen
from hmtb_twin.parameters import HAND_CONTROLLER, OPERATING_POSE
from scenarios.errors import ScenarioError
from scenarios.excitation_computer import BOARD
from scenarios.multisines import Multisines

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
    multisines: Multisines = Multisines()  # noqa: RUF009
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

    def asked(self) -> np.ndarray:
        """Return the offsets asked of the joints (N, n_axes), rad, before any converter."""
        return self.multisines.offsets(self.realisation, self.record, len(self.axes))

    def volts(self) -> np.ndarray:
        """Return the excitation computer's output (N, n_axes), V.

        Raises:
            ScenarioError: The multisine asks for more than the converter gives.
        """
        volts = self.asked() / self.hand_controller.gain
        if BOARD.beyond(volts).any():
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
