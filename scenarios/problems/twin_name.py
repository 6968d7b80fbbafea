"""Problems of the arm: their names, and the experiment and record of each draw."""

import re
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from hmtb_twin import Experiment, JointLog
from hmtb_twin.parameters.values import LARGE_MOTION, SAMPLE_RATE, SAMPLE_TIME
from scenarios.estimators.seeds import seed_of
from scenarios.experiments.campaign import REGISTER
from scenarios.experiments.excitation_computer import Excitation
from scenarios.experiments.multisines import MultisineExperiment, Multisines
from scenarios.experiments.scenario import Scenario, known_arm
from scenarios.files.errors import ScenarioError, unknown
from sysid import IOData
from sysid.records.arrays import FloatArray

PERIODS = {"multisine": 256, "prbs": 100, "chirp": 100}
"""Excitations, with the length of their period, samples."""

STEADY = {"multisine": 512, "prbs": 600, "chirp": 600}
"""Scored samples of a record where the name does not state them."""

SETTLING = 256
"""Samples in which the arm, which starts at rest, comes into its periodic answer: they are not scored."""

F_MAX = 5.0
"""Highest line of the multisines, Hz: above it a record shows little of the response."""

CLOCK = 2
"""Samples per bit of the binary sequences, as in the thesis' tests 5 and 6."""

SWEEP = (0.5, 4.5)
"""Band of the chirp, Hz: whole cycles in its window of 2 s, and the bandwidths of the joints inside."""

NAME = re.compile(
    r"twin-(?P<variant>[A-Za-z0-9_.]+)-(?P<joint>[A-Za-z0-9_.+]+)-(?P<excitation>[a-z]+)-(?P<mrad>\d+(\.\d+)?)mrad"
    r"(-w(?P<waveform>\d{1,6}))?(@(?P<samples>\d{1,7}))?"
)


@dataclass(frozen=True)
class TwinName:
    """A problem of the arm, fully described by its name.

    Attributes:
        variant: The arm by name, whose bus has 50 Hz: a variant of the test bed, or another one.
        joint: The joint that is excited and measured, any that a pin does not hold; of another arm what comes after
            the arm's own name is enough.
        excitation: One of `PERIODS`. `multisine`: random phases, equal lines up to 5 Hz. `prbs`: binary sequences of
            the thesis' clock. `chirp`: a sweep from 0.5 to 4.5 Hz.
        mrad: Root mean square of the angle commanded at the stick, mrad.
        waveform: Which realisation of the excitation; None: each draw has its own.
        samples: Scored samples of a record, a whole number of periods.
    """

    variant: str
    joint: str
    excitation: str
    mrad: float
    waveform: int | None
    samples: int

    def __post_init__(self) -> None:
        # A pin holds an indexed joint: nothing can be identified there.
        arm = known_arm(self.variant)
        if arm.sample_rate != SAMPLE_RATE:
            raise ScenarioError(
                f"arm {self.variant} at {arm.sample_rate} Hz given, expected one whose bus has {SAMPLE_RATE} Hz"
            )
        named_alike = [joint for joint in arm.free if joint.endswith(f"_{self.joint}")]
        if self.joint not in arm.free and len(named_alike) == 1:
            # Joints of many arms begin with the arm's own name, which stands in the problem's already.
            object.__setattr__(self, "joint", named_alike[0])
        for field, names in (("joint", arm.free), ("excitation", tuple(PERIODS))):
            if getattr(self, field) not in names:
                raise ScenarioError(unknown(field, getattr(self, field), names))
        if not 0.0 < self.mrad <= 1000.0:
            raise ScenarioError(f"an amplitude of {self.mrad:g} mrad given, expected above 0 and up to 1000 mrad")
        if self.samples % self.period or self.samples < 2 * self.period:
            raise ScenarioError(
                f"a record of {self.samples} samples given, expected two or more periods of {self.period} of a "
                f"{self.excitation}"
            )

    @property
    def period(self) -> int:
        """Length of a period, samples."""
        return PERIODS[self.excitation]

    @property
    def excitation_class(self) -> str:
        """Name of what all realisations have in common: arm, joint, excitation and amplitude."""
        return f"twin-{self.variant}-{self.joint}-{self.excitation}-{self.mrad:g}mrad"

    @property
    def frequencies(self) -> FloatArray:
        """Lines of the excitation up to `F_MAX` (nf,), Hz: multiples of one over the period."""
        # 1e-9: a line at F_MAX itself must not be lost to rounding.
        count = int(np.floor(F_MAX * self.period / SAMPLE_RATE + 1e-9))
        return np.asarray(np.arange(1, count + 1) * (SAMPLE_RATE / self.period))

    def __str__(self) -> str:
        waveform = "" if self.waveform is None else f"-w{self.waveform}"
        samples = "" if self.samples == STEADY[self.excitation] else f"@{self.samples}"
        return f"{self.excitation_class}{waveform}{samples}"

    def waveform_seed(self, seed: int) -> int:
        """Seed of the waveform: from the class and the number of the waveform, else from the seed of the draw."""
        which = f"draw {seed}" if self.waveform is None else f"waveform {self.waveform}"
        return seed_of(f"{self.excitation_class}|{which}")

    def multisines(self, seed: int, *, realisations: int = 2) -> Multisines:
        """The excitation class of a multisine problem."""
        period = self.period * SAMPLE_TIME
        # The lowest line is that of one period.
        return Multisines(
            rms=self.mrad / 1000.0,
            f_min=1.0 / period,
            f_max=F_MAX,
            period=period,
            realisations=realisations,
            periods=self.samples // self.period,
            settling=SETTLING // self.period,
            seed=seed,
        )

    def experiment(self, seed: int) -> Experiment:
        """The experiment whose log is the record of a draw.

        Args:
            seed: Of the laboratory's noise, and of the waveform where the name does not state which.

        Raises:
            ScenarioError: The converters cannot play the amplitude.
        """
        waveform = self.waveform_seed(seed)
        if self.excitation == "multisine":
            multisines = self.multisines(waveform)
            experiment = replace(self.setting(seed), multisines=multisines)
            # It raises here, before a batch begins, where the converter cannot play the amplitude.
            experiment.volts()
            return experiment
        excitation = Excitation(self.excitation, self._settings(waveform))
        # Names of scenarios are names of files too, which have no @.
        arm = known_arm(self.variant)
        return Scenario(
            name=str(self).replace("@", "+"),
            axes=(self.joint,),
            excitation=(excitation,),
            duration=(SETTLING + self.samples) * SAMPLE_TIME,
            seed=seed,
            variant=self.variant,
            payload=arm.tuned_payload,
            pose=arm.operating_pose,
            hand_controller=LARGE_MOTION,
        )

    def setting(self, seed: int) -> MultisineExperiment:
        """An experiment on the joint at the arm's operating pose."""
        arm = known_arm(self.variant)
        return MultisineExperiment(
            str(self),
            (self.joint,),
            variant=self.variant,
            payload=arm.tuned_payload,
            pose=arm.operating_pose,
            seed=seed,
        )

    def _settings(self, waveform: int) -> dict[str, Any]:
        """Settings of a binary sequence or a chirp whose root mean square is the amplitude of the name."""
        volts = self.mrad / 1000.0 / LARGE_MOTION.gain
        if self.excitation == "prbs":
            return {"amplitude": volts, "clock": CLOCK, "seed": waveform, "register": REGISTER}
        # The peak of a sinusoid is sqrt(2) times its root mean square; a binary sequence has both alike.
        return {"f_start": SWEEP[0], "f_end": SWEEP[1], "amplitude": float(np.sqrt(2.0)) * volts}

    def record(self, log: JointLog) -> IOData:
        """The record of a log: commanded and measured angle about the operating point, rad.

        The operating point is the mean over the steady, whole periods, so that it takes nothing from the answer to the
        excitation. The settling stays as an initialisation window: the arm starts at rest there.
        """
        record = log.iodata(self.joint)
        u, y = (signal - signal[SETTLING:].mean(axis=0) for signal in (record.u, record.y))
        return IOData(u, y, SAMPLE_TIME, window=SETTLING)


def twin_name(name: str) -> TwinName:
    """Parse the name of a problem of the arm: variant, joint, excitation, amplitude, waveform and length.

    Args:
        name: Such as `twin-nominal-elbow_pitch-multisine-10mrad`, `twin-nominal-elbow_pitch-multisine-10mrad-w3`,
            `twin-nominal-elbow_pitch-prbs-67mrad@1200`.

    Raises:
        ScenarioError: It is no such name.
    """
    match = NAME.fullmatch(name)
    if match is None:
        raise ScenarioError(
            f"{name!r} given, expected a problem of the twin: twin-VARIANT-JOINT-EXCITATION-AMPLITUDEmrad, then "
            "-wNUMBER and @SAMPLES where wanted"
        )
    waveform = None if match["waveform"] is None else int(match["waveform"])
    samples = int(match["samples"] or STEADY.get(match["excitation"], 0))
    variant, joint, excitation = match.group("variant", "joint", "excitation")
    return TwinName(variant, joint, excitation, float(match["mrad"]), waveform, samples)
