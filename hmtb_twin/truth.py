"""What is true of the arm: the linear model at 50 Hz that its physics implies."""

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType

import numpy as np

from hmtb_twin.modes import joint_index
from hmtb_twin.parameters import INDEXED_JOINTS, JOINTS
from hmtb_twin.plant import Plant
from sysid import StateSpace

MINIMAL = 1e-9
"""Hankel singular values below this part of the largest are numerical dust of the finite differences."""

DELAY = 1e-9
"""A Markov parameter below this part of the largest counts as zero."""


@dataclass(frozen=True)
class JointTruth:
    """The truth about one joint: commanded to measured angle while the others servo.

    Attributes:
        name: The joint.
        model: Minimal single-input single-output model.
        bandwidth_hz: First frequency at which the gain is 3.01 dB below its value at 0 Hz, Hz; NaN if it never is,
            and for an indexed joint, which a pin holds.
        dc_gain: Gain at 0 Hz.
        poles: Poles in the z plane, largest modulus first.
        zeros: Zeros in the z plane.
        delay_samples: Samples from a command to the first measurement that shows it; the analyst's nk.
    """

    name: str
    model: StateSpace
    bandwidth_hz: float
    dc_gain: float
    poles: np.ndarray
    zeros: np.ndarray
    delay_samples: int

    @property
    def natural_poles(self) -> np.ndarray:
        """Poles in the s plane that the sampled ones are images of, rad/s; bus delays, which have none, left out."""
        moving = self.poles[np.abs(self.poles) > 1e-6]
        return np.log(moving.astype(complex)) / self.model.dt

    @property
    def dominant_poles(self) -> np.ndarray:
        """Poles in the s plane that carry more than 5 % of the gain at 0 Hz each, rad/s, slowest first."""
        poles, vectors = np.linalg.eig(self.model.A)
        residues = (self.model.C @ vectors)[0] * np.linalg.solve(vectors, self.model.B.astype(complex))[:, 0]
        share = np.abs(residues / (1.0 - poles)) / abs(self.dc_gain)
        moving = np.abs(poles) > 1e-6
        dominant = np.log(poles[moving & (share > 0.05)].astype(complex)) / self.model.dt
        return dominant[np.argsort(-dominant.real)]


@dataclass(frozen=True)
class Truth:
    """The true small-signal dynamics of the arm at one operating point, dry friction off.

    Attributes:
        model: Seven commanded angles to seven measured angles at 50 Hz, rad; its innovation covariance is that of
            resolver noise and rounding, the only disturbance of the small-signal arm, so that K is zero.
        variant: Arm variant.
        payload: What the end effector holds.
        plant: What the drives run on and rub with.
        pose: Operating point, by name.
        angles: Operating point (7,), rad.
        small_signal_error: By amplitude in rad, the relative error of the linear model against simulation: root mean
            square of the difference over that of the response, largest over the studied joints.
        provenance: How it was obtained and with which software.
    """

    model: StateSpace
    variant: str
    payload: str
    plant: Plant
    pose: str
    angles: np.ndarray
    small_signal_error: Mapping[float, float]
    provenance: Mapping[str, str]

    def __post_init__(self) -> None:
        angles = np.array(self.angles, dtype=float)
        angles.setflags(write=False)
        object.__setattr__(self, "angles", angles)
        object.__setattr__(self, "small_signal_error", MappingProxyType(dict(self.small_signal_error)))
        object.__setattr__(self, "provenance", MappingProxyType(dict(self.provenance)))

    @property
    def dt(self) -> float:
        """Sampling time, s."""
        return self.model.dt

    def joint(self, name: str) -> JointTruth:
        """Return the truth about one joint.

        Args:
            name: The joint.

        Returns:
            Its single-input single-output model, poles, zeros, gain, bandwidth and delay.

        Raises:
            TwinError: There is no such joint.
        """
        model = self.channel(name, name).minimal(MINIMAL)
        pulse = np.abs(model.markov(100)[:, 0, 0])
        delay = int(np.argmax(pulse > DELAY * pulse.max()))
        return JointTruth(
            name=name,
            model=model,
            bandwidth_hz=np.nan if name in INDEXED_JOINTS else float(model.bandwidth()[0, 0]),
            dc_gain=float(model.dc_gain()[0, 0]),
            poles=model.poles(),
            zeros=model.zeros(),
            delay_samples=delay,
        )

    def channel(self, commanded: str, measured: str) -> StateSpace:
        """Return the model from one joint's command to one joint's measurement, all states kept.

        Args:
            commanded: The joint that is commanded.
            measured: The joint that is measured.

        Returns:
            A single-input single-output model.

        Raises:
            TwinError: There is no such joint.
        """
        i, j = joint_index(measured), joint_index(commanded)
        model = self.model
        covariance = model.innovation_covariance
        return StateSpace(
            model.A,
            model.B[:, [j]],
            model.C[[i]],
            model.D[np.ix_([i], [j])],
            None,
            model.dt,
            None if covariance is None else covariance[np.ix_([i], [i])],
            input_names=(f"{JOINTS[j]} commanded",),
            output_names=(f"{JOINTS[i]} measured",),
            input_units=("rad",),
            output_units=("rad",),
        )
