"""The models that the thesis prints, digit by digit, and the range that rounding leaves [Morris1996, ch. IV and V]."""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from types import MappingProxyType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hmtb_twin.parameters.values import SAMPLE_TIME
from scenarios.files.errors import ScenarioError, unknown
from scenarios.files.toml_file import package_table
from sysid import StateSpace
from sysid.models import block_diagonal
from sysid.models.bandwidth import half_power_hz

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


@dataclass(frozen=True, eq=False)
class PublishedModel:
    """One printed model of one joint.

    Attributes:
        name: Number of the equation, e.g. ``"4.7"``; two of them where the model takes its digits from both.
        joint: Joint that it describes.
        method: ``"armax"``, ``"oe"`` or ``"okid"``.
        digits: The numbers as printed, zeros and ones of the structure without a point: numerator, denominator (highest
            power of z first) and K, or rows of A, then B, C, D and G.
        doubts: Possible errors of the print, and reasons for the reading.
        chosen: Whether the thesis takes it into a three-joint model.
    """

    name: str
    joint: str
    method: str
    digits: tuple[str, ...]
    doubts: str
    chosen: bool = False

    @property
    def label(self) -> str:
        """Method and equation, e.g. ``"ARMAX (4.7)"``."""
        return f"{self.method.upper()} ({self.name})"

    @property
    def joints(self) -> tuple[str, ...]:
        """Joints that it describes: one."""
        return (self.joint,)

    @cached_property
    def model(self) -> StateSpace:
        """The model in innovation form, K zero where the print has none."""
        return self._assembled([np.array(line.split(), dtype=np.float64) for line in self.digits])

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

    @cached_property
    def digit_range(self) -> DigitRange:
        """Ranges over models drawn evenly within the rounding: half a unit of the last place of every number."""
        # The same draws on every call: the range belongs to the print, not to chance.
        rng, models = np.random.default_rng(0), list[StateSpace]()
        for _ in range(DRAWS):
            coefficients = []
            for words in map(str.split, self.digits):
                half_places = [_half_place(word) for word in words]
                printed = np.array(words, dtype=np.float64)
                coefficients.append(printed + half_places * rng.uniform(-1.0, 1.0, len(words)))
            models.append(self._assembled(coefficients))
        # An unstable model has no bandwidth; how many there are says how little the digits fix.
        stable = [model for model in models if model.is_stable()]
        bandwidths = [float(model.bandwidth()[0, 0]) for model in stable]
        gains = [float(model.dc_gain()[0, 0]) for model in stable]
        return DigitRange((min(bandwidths), max(bandwidths)), (min(gains), max(gains)), len(stable) / DRAWS)

    def _assembled(self, coefficients: list[NDArray[np.float64]]) -> StateSpace:
        """Assemble the model from its numbers in the sequence of `digits`."""
        if self.method == "okid":
            A, B, C, D, G = coefficients
            n = len(B)
            # K = -G [Morris1996, eq. 5.7]
            matrices = A.reshape(n, n), B[:, None], C[None], D[None], -G[:, None]
        else:
            # Observer form of a strictly proper fraction in z; the thesis' own form.
            numerator, denominator, K = coefficients
            n = len(denominator) - 1
            A, B = np.eye(n, k=1), np.zeros((n, 1))
            A[:, 0] = -denominator[1:]
            B[n - len(numerator) :, 0] = numerator
            matrices = A, B, np.eye(1, n), np.zeros((1, 1)), K[:, None]
        return StateSpace(
            *matrices, SAMPLE_TIME, input_names=(f"{self.joint} commanded",), output_names=(f"{self.joint} measured",)
        )


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
        return tuple(joint_model.joint for joint_model in self.parts)

    @property
    def model(self) -> StateSpace:
        """The block-diagonal model."""
        return block_diagonal([joint_model.model for joint_model in self.parts])


def _half_place(word: str) -> float:
    """Return half a unit of the last decimal place of a printed number."""
    # Zeros and ones of the structure have no place to round.
    if "." not in word:
        return 0.0
    return float(0.5 * 10.0 ** -len(word.partition(".")[2]))


def _printed_model(row: Mapping[str, Any]) -> PublishedModel:
    """Make a model from its row of `published.toml`."""
    return PublishedModel(**{**row, "digits": tuple(row["digits"])})


def _printed_system(row: Mapping[str, Any]) -> PublishedSystem:
    """Make a model of three joints from its row of `published.toml`."""
    return PublishedSystem(row["name"], row["label"], tuple(EQUATIONS[equation] for equation in row["parts"]))


_PRINT = package_table("published.toml")

EQUATIONS: Mapping[str, PublishedModel] = MappingProxyType(
    {row["name"]: _printed_model(row) for row in _PRINT["model"]}
)
"""Every printed model of one joint by the number of its equation, second prints too."""

PUBLISHED: tuple[PublishedModel, ...] = tuple(
    EQUATIONS[name] for name in ("4.7", "4.9", "4.8", "5.8", "4.10", "5.9", "4.12", "5.10")
)
"""Every printed model that differs from all others, joint by joint."""

SYSTEMS: tuple[PublishedSystem, ...] = tuple(_printed_system(row) for row in _PRINT["system"])
"""The thesis' models of three joints, with the digits of the transfer functions [Morris1996, sec. VI.6]."""

BY_NAME: Mapping[str, PublishedModel | PublishedSystem] = MappingProxyType(
    {**EQUATIONS, **{system.name: system for system in SYSTEMS}}
)
"""Everything printed, by name: the equations and the models of three joints."""

BREAK_FREQUENCY = {"shoulder_yaw": 6.0, "shoulder_pitch": 7.0, "elbow_pitch": 7.0}
"""Low-frequency cutoff that the thesis reads off its spectral estimates, rad/s [Morris1996, sec. III.2A and III.3]."""

PERCENT_DESCRIBED = {"shoulder_yaw": 99.8691, "shoulder_pitch": 96.1075, "elbow_pitch": 98.8832}
"""Part of the test data that two states of its OKID models describe, % [Morris1996, sec. V.2 and V.3]."""


def published(joint: str) -> tuple[PublishedModel, ...]:
    """Return the printed models of one joint; none for joints that the thesis did not identify."""
    return tuple(model for model in PUBLISHED if model.joint == joint)


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
