"""The models that the thesis prints, digit by digit, and the range that rounding leaves [Morris1996, ch. IV and V]."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cache
from types import MappingProxyType

import numpy as np
from numpy.typing import NDArray

from hmtb_twin.parameters.values import SAMPLE_TIME
from scenarios.files.errors import ScenarioError, unknown
from sysid import StateSpace
from sysid.models import block_diagonal
from sysid.models.bandwidth import half_power_hz


@dataclass(frozen=True, eq=False)
class PublishedModel:
    """One printed model of one joint.

    Attributes:
        name: Number of the equation, e.g. ``"4.7"``; two of them where the model takes its digits from both.
        joint: Joint that it describes.
        method: ``"armax"``, ``"oe"`` or ``"okid"``.
        chosen: Whether the thesis takes it into a three-joint model.
        digits: The numbers as printed, zeros and ones of the structure without a point: numerator, denominator (highest
            power of z first) and K, or rows of A, then B, C, D and G.
        doubts: Possible errors of the print, and reasons for the reading.
        model: The model in innovation form, K zero where the print has none.
    """

    name: str
    joint: str
    method: str
    chosen: bool
    digits: tuple[str, ...]
    doubts: str
    model: StateSpace = field(init=False)

    def __post_init__(self) -> None:
        """Assemble the model from its digits."""
        object.__setattr__(self, "model", self._assembled([_numbers(text) for text in self.digits]))

    @property
    def label(self) -> str:
        """Method and equation, e.g. ``"ARMAX (4.7)"``."""
        return f"{self.method.upper()} ({self.name})"

    @property
    def joints(self) -> tuple[str, ...]:
        """Joints that it describes: one."""
        return (self.joint,)

    @property
    def bandwidth_hz(self) -> float:
        """Frequency at which the gain has fallen by 3 dB from its value at zero, Hz."""
        return float(self.model.bandwidth()[0, 0])

    @property
    def dc_gain(self) -> float:
        """Gain at 0 Hz, rad/rad."""
        return float(self.model.dc_gain()[0, 0])

    @property
    def half_power_hz(self) -> float:
        """Frequency at which the gain is 0.707, whatever it is at 0 Hz, Hz."""
        return half_power_hz(self.model)

    @property
    def noise_polynomial(self) -> NDArray[np.float64]:
        """C of the innovation form, 1 first: the characteristic polynomial of A - K C; its roots are the observer's."""
        return np.asarray(np.poly(self.model.A - self.model.gain @ self.model.C), dtype=np.float64)

    def within_rounding(self, rng: np.random.Generator) -> StateSpace:
        """Draw a model with the same printed digits: every number moves by up to half a unit of its last place."""
        return self._assembled(
            [_numbers(text) + _half_units(text) * rng.uniform(-1.0, 1.0, len(text.split())) for text in self.digits]
        )

    def _assembled(self, parts: list[NDArray[np.float64]]) -> StateSpace:
        if self.method == "okid":
            A, B, C, D, G = parts
            n = len(B)
            # K = -G [Morris1996, eq. 5.7]
            matrices = A.reshape(n, n), B[:, None], C[None], D[None], -G[:, None]
        else:
            # Observer form of a strictly proper fraction in z; the thesis' own form.
            numerator, denominator, K = parts
            n = len(denominator) - 1
            A, B = np.eye(n, k=1), np.zeros((n, 1))
            A[:, 0] = -denominator[1:]
            B[n - len(numerator) :, 0] = numerator
            matrices = A, B, np.eye(1, n), np.zeros((1, 1)), K[:, None]
        return StateSpace(
            *matrices, SAMPLE_TIME, input_names=(f"{self.joint} commanded",), output_names=(f"{self.joint} measured",)
        )


def _numbers(text: str) -> NDArray[np.float64]:
    return np.array([float(entry) for entry in text.split()])


def _half_units(text: str) -> NDArray[np.float64]:
    """Half a unit of the last printed place; nothing for the zeros and ones of the structure."""
    return np.array([0.5 * 10.0 ** -len(entry.partition(".")[2]) if "." in entry else 0.0 for entry in text.split()])


YAW_ARMAX = PublishedModel(
    "4.7",
    "shoulder_yaw",
    "armax",
    True,
    (
        "0.003804 0.003504 -0.004285 0",
        "1 -2.542 2.367 -0.8523 -0.08044 0.1103",
        "2.1470 -2.4323 1.1597 0.0804 -0.1103",
    ),
    "Printed again as (4.9), every number the same to within rounding. But the gain at 0 Hz is a quotient of small "
    "differences, which the digits hardly fix: 1.18 here, 1.30 there. (4.9) has more digits of two coefficients, this "
    "print of the others; see 4.7+4.9. K is that of (4.9); it says that the noise polynomial has three terms.",
)
YAW_ARMAX_STATE_SPACE = PublishedModel(
    "4.9",
    "shoulder_yaw",
    "armax",
    False,
    (
        "0.0038 0.0035 -0.0043 0",
        "1 -2.5420 2.3667 -0.8523 -0.0804 0.1103",
        "2.1470 -2.4323 1.1597 0.0804 -0.1103",
    ),
    "The model of (4.7) again, with two digits of the numerator: its gain at 0 Hz is 1.30 instead of 1.18. The scan "
    "reads the index 1 of the matrices as the letter l. The last two entries of K are those of A, so both are read "
    "rightly.",
)
YAW_ARMAX_BOTH = PublishedModel(
    "4.7+4.9",
    "shoulder_yaw",
    "armax",
    False,
    (
        "0.003804 0.003504 -0.004285 0",
        "1 -2.5420 2.3667 -0.8523 -0.08044 0.1103",
        "2.1470 -2.4323 1.1597 0.0804 -0.1103",
    ),
    "Of every number of the yaw ARMAX the print with more digits: the second and third of the denominator from (4.9), "
    "all others from (4.7). The gain at 0 Hz is 1.34: neither print alone gives it.",
)
YAW_OE = PublishedModel(
    "4.8",
    "shoulder_yaw",
    "oe",
    False,
    ("0.0464 0.06144", "1 -0.7501 -0.1815 0", "0 0 0"),
    "Printed once, so no second print vouches for a sign or a digit. Were the sign of 0.1815 misread, the gain at 0 Hz "
    "would be 0.25 instead of 1.58. 0.0464 has one digit less than its neighbours, perhaps a zero that was dropped.",
)
SHOULDER_PITCH_OE = PublishedModel(
    "4.10",
    "shoulder_pitch",
    "oe",
    True,
    ("0.03459 0.07584", "1 -0.9776 0.07922", "0 0"),
    "(4.11) repeats it with fewer digits and agrees to within rounding.",
)
SHOULDER_PITCH_STATE_SPACE = PublishedModel(
    "4.11",
    "shoulder_pitch",
    "oe",
    False,
    ("0.0346 0.0758", "1 -0.9776 0.0792", "0 0"),
    "The model of (4.10) again, with fewer digits; they agree to within rounding.",
)
ELBOW_PITCH_ARMAX = PublishedModel(
    "4.12",
    "elbow_pitch",
    "armax",
    True,
    ("0.01237 0.0426", "1 -1.488 0.5435 0", "1.4698 -0.2739 0"),
    "(4.13) repeats it and agrees to within rounding; there the second number of the denominator has a digit more, "
    "1.4877. 0.0426 has one digit less than its neighbour, and (4.13) has no more of them. K is that of (4.13).",
)
ELBOW_PITCH_STATE_SPACE = PublishedModel(
    "4.13",
    "elbow_pitch",
    "armax",
    False,
    ("0.0124 0.0426", "1 -1.4877 0.5435 0", "1.4698 -0.2739 0"),
    "The model of (4.12) again; they agree to within rounding.",
)
YAW_OKID = PublishedModel(
    "5.8",
    "shoulder_yaw",
    "okid",
    True,
    (
        "0.99487 0.02896 -0.15355 0.55941",
        "2.7065 12.366",
        "0.004706 -0.001125",
        "0.000714",
        "-276.41 -123.20",
    ),
    "Printed once. C has four digits and D three where the other observers have five. What speaks for the reading: the "
    "observer's eigenvalues lie near the origin, which a wrong sign or a shifted point in A, C or G would spoil.",
)
SHOULDER_PITCH_OKID = PublishedModel(
    "5.9",
    "shoulder_pitch",
    "okid",
    True,
    (
        "0.90891 0.10801 -0.35206 0.33925",
        "6.881 11.762",
        "0.014742 -0.0065875",
        "0.010405",
        "-65.283 22.597",
    ),
    "Printed once. What speaks for the reading: the observer's eigenvalues lie near the origin, one of them within "
    "rounding on it. The direct term is 1 % of the command, where (4.10) has a delay of one sample.",
)
ELBOW_PITCH_OKID = PublishedModel(
    "5.10",
    "elbow_pitch",
    "okid",
    True,
    (
        "0.94738 0.077488 -0.27646 0.517280",
        "4.7407 11.0670",
        "0.013258 -0.0059914",
        "0.0032941",
        "-77.049 11.586",
    ),
    "Printed once. 0.517280 and 11.0670 have a digit more than their neighbours. What speaks for the reading: the "
    "observer's eigenvalues lie near the origin.",
)

PUBLISHED: tuple[PublishedModel, ...] = (
    YAW_ARMAX,
    YAW_ARMAX_STATE_SPACE,
    YAW_OE,
    YAW_OKID,
    SHOULDER_PITCH_OE,
    SHOULDER_PITCH_OKID,
    ELBOW_PITCH_ARMAX,
    ELBOW_PITCH_OKID,
)
"""Every printed model that differs from all others, joint by joint."""


@dataclass(frozen=True, eq=False)
class PublishedSystem:
    """Printed models of three joints side by side, as the thesis joins them.

    Attributes:
        name: `sysid`, `okid` or `hybrid`.
        label: Its name in the thesis, and where.
        parts: The models, joint by joint.
    """

    name: str
    label: str
    parts: tuple[PublishedModel, ...]

    @property
    def joints(self) -> tuple[str, ...]:
        """Joints that it describes."""
        return tuple(part.joint for part in self.parts)

    @property
    def model(self) -> StateSpace:
        """The block-diagonal model."""
        return block_diagonal([part.model for part in self.parts])


SYSTEMS: tuple[PublishedSystem, ...] = (
    PublishedSystem("sysid", "SysID model (4.14)", (YAW_ARMAX, SHOULDER_PITCH_OE, ELBOW_PITCH_ARMAX)),
    PublishedSystem("okid", "OKID model (5.11)", (YAW_OKID, SHOULDER_PITCH_OKID, ELBOW_PITCH_OKID)),
    PublishedSystem("hybrid", "hybrid model (VI.6)", (YAW_ARMAX, SHOULDER_PITCH_OKID, ELBOW_PITCH_OKID)),
)
"""The thesis' models of three joints, with the digits of the transfer functions [Morris1996, sec. VI.6]."""

_SINGLE = (
    *(YAW_ARMAX, YAW_OE, YAW_ARMAX_STATE_SPACE, YAW_ARMAX_BOTH, SHOULDER_PITCH_OE, SHOULDER_PITCH_STATE_SPACE),
    *(ELBOW_PITCH_ARMAX, ELBOW_PITCH_STATE_SPACE, YAW_OKID, SHOULDER_PITCH_OKID, ELBOW_PITCH_OKID),
)

BY_NAME: Mapping[str, PublishedModel | PublishedSystem] = MappingProxyType(
    {**{entry.name: entry for entry in _SINGLE}, **{entry.name: entry for entry in SYSTEMS}}
)
"""Everything printed, by name: the equations, second prints too, and the models of three joints."""

BREAK_FREQUENCY = {"shoulder_yaw": 6.0, "shoulder_pitch": 7.0, "elbow_pitch": 7.0}
"""Low-frequency cutoff that the thesis reads off its spectral estimates, rad/s [Morris1996, sec. III.2A and III.3]."""

PERCENT_DESCRIBED = {"shoulder_yaw": 99.8691, "shoulder_pitch": 96.1075, "elbow_pitch": 98.8832}
"""Part of the test data that two states of its OKID models describe, % [Morris1996, sec. V.2 and V.3]."""


def published(joint: str) -> tuple[PublishedModel, ...]:
    """Return the printed models of one joint; none for joints that the thesis did not identify."""
    return tuple(entry for entry in PUBLISHED if entry.joint == joint)


def published_model(name: str) -> PublishedModel | PublishedSystem:
    """Return a printed model by name.

    Args:
        name: Number of an equation (``"4.7"``, ``"5.10"``), ``"4.7+4.9"`` for the yaw ARMAX with the best digits of
            both prints, or ``"sysid"``, ``"okid"``, ``"hybrid"`` for the models of three joints.

    Raises:
        ScenarioError: There is none of that name.
    """
    if name not in BY_NAME:
        raise ScenarioError(unknown("published model", name, BY_NAME))
    return BY_NAME[name]


DRAWS = 100
"""Number of models with the same printed digits, of which the range is taken."""


@dataclass(frozen=True)
class DigitRange:
    """Ranges over models that round to the same printed digits.

    Attributes:
        bandwidth_hz: Lowest and highest bandwidth, Hz.
        dc_gain: Lowest and highest gain at 0 Hz, rad/rad.
        stable: Part of the models that are stable; ranges are of these.
    """

    bandwidth_hz: tuple[float, float]
    dc_gain: tuple[float, float]
    stable: float


@cache
def digit_range(name: str) -> DigitRange:
    """Draw models within the rounding of a print, evenly, and take the ranges.

    Args:
        name: Name of a printed model of one joint.

    Raises:
        ScenarioError: There is no such model.
    """
    entry = published_model(name)
    if not isinstance(entry, PublishedModel):
        raise ValueError(f"{name!r} is a model of {len(entry.joints)} joints; expected one of a single joint")
    rng = np.random.default_rng(0)
    models = [entry.within_rounding(rng) for _ in range(DRAWS)]
    stable = [model for model in models if model.is_stable()]
    bandwidths = [float(model.bandwidth()[0, 0]) for model in stable]
    gains = [float(model.dc_gain()[0, 0]) for model in stable]
    return DigitRange((min(bandwidths), max(bandwidths)), (min(gains), max(gains)), len(stable) / DRAWS)
