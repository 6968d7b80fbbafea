"""Names of the twin's problems, which say all of them."""

import re
from dataclasses import dataclass
from hashlib import sha256

from hmtb_twin import JOINTS, VARIANTS
from hmtb_twin.parameters.values import INDEXED_JOINTS
from scenarios.files.errors import ScenarioError, unknown

PERIODS = {"multisine": 256, "prbs": 100, "chirp": 100}
"""Excitations, with the length of their period, samples."""

STEADY = {"multisine": 512, "prbs": 600, "chirp": 600}
"""How much of a record counts, samples, where the name does not say it."""

NAME = re.compile(
    r"twin-(?P<variant>[a-z_]+)-(?P<joint>[a-z_]+)-(?P<excitation>[a-z]+)-(?P<mrad>\d+(\.\d+)?)mrad"
    r"(-w(?P<waveform>\d{1,6}))?(@(?P<samples>\d{1,7}))?"
)
"""Form of a name."""

FORM = "twin-VARIANT-JOINT-EXCITATION-AMPLITUDEmrad, then -wNUMBER and @SAMPLES where wanted"
"""The form in words."""


@dataclass(frozen=True)
class TwinName:
    """A problem of the twin.

    Attributes:
        variant: Arm variant.
        joint: The joint that is excited and measured, any that a pin does not hold.
        excitation: One of `PERIODS`. `multisine`: phases at random, equal lines up to 5 Hz. `prbs`: binary sequences of
            the thesis' clock. `chirp`: a sweep from 0.5 to 4.5 Hz.
        mrad: Root mean square of the angle that is asked for at the stick, mrad.
        waveform: Which realisation of the excitation; None: each draw has its own.
        samples: How much of a record counts, samples, a whole number of periods.
    """

    variant: str
    joint: str
    excitation: str
    mrad: float
    waveform: int | None = None
    samples: int = 0

    def __post_init__(self) -> None:
        known = {
            "variant": tuple(VARIANTS),
            "joint": tuple(joint for joint in JOINTS if joint not in INDEXED_JOINTS),
            "excitation": tuple(PERIODS),
        }
        for what, names in known.items():
            if getattr(self, what) not in names:
                raise ScenarioError(unknown(what, getattr(self, what), names))
        if not 0.0 < self.mrad <= 1000.0:
            raise ScenarioError(f"an amplitude of {self.mrad:g} mrad given, expected above 0 and up to 1000 mrad")
        period = PERIODS[self.excitation]
        object.__setattr__(self, "samples", self.samples or STEADY[self.excitation])
        if self.samples % period or self.samples < 2 * period:
            raise ScenarioError(
                f"a record of {self.samples} samples given, expected two or more periods of {period} of a "
                f"{self.excitation}"
            )

    @property
    def period(self) -> int:
        """Length of a period, samples."""
        return PERIODS[self.excitation]

    @property
    def excitation_class(self) -> str:
        """What all realisations have in common: arm, joint, excitation and amplitude."""
        return f"twin-{self.variant}-{self.joint}-{self.excitation}-{self.mrad:g}mrad"

    def __str__(self) -> str:
        waveform = "" if self.waveform is None else f"-w{self.waveform}"
        samples = "" if self.samples == STEADY[self.excitation] else f"@{self.samples}"
        return f"{self.excitation_class}{waveform}{samples}"

    def waveform_seed(self, seed: int) -> int:
        """Seed of the waveform of a draw: of the class and the number of the waveform, else of the draw's own seed."""
        which = f"draw {seed}" if self.waveform is None else f"waveform {self.waveform}"
        return int.from_bytes(sha256(f"{self.excitation_class}|{which}".encode()).digest()[:8], "big") >> 1


def twin_name(text: str) -> TwinName:
    """Read a name.

    Args:
        text: Such as `twin-nominal-elbow_pitch-multisine-10mrad`, `twin-nominal-elbow_pitch-multisine-10mrad-w3`,
            `twin-nominal-elbow_pitch-prbs-67mrad@1200`.

    Raises:
        ScenarioError: It is none.
    """
    found = NAME.fullmatch(text)
    if found is None:
        raise ScenarioError(f"{text!r} given, expected a problem of the twin: {FORM}")
    waveform, samples = found["waveform"], found["samples"]
    return TwinName(
        variant=found["variant"],
        joint=found["joint"],
        excitation=found["excitation"],
        mrad=float(found["mrad"]),
        waveform=None if waveform is None else int(waveform),
        samples=_length(found["excitation"], samples),
    )


def _length(excitation: str, samples: str | None) -> int:
    """0 where the name says nothing; an explicit 0 is refused like any other length that is too short."""
    if samples is None:
        return STEADY.get(excitation, 0)
    if int(samples) == 0:
        raise ScenarioError("a record of 0 samples given, expected two or more periods")
    return int(samples)
