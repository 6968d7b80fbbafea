"""The linear model of the arm at 50 Hz: whole, by joint and by channel."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from types import MappingProxyType

import numpy as np
from scipy.linalg import eig

from hmtb_twin.arm_files.known_arms import arm_named
from hmtb_twin.files.errors import TwinError
from hmtb_twin.parameters.arm_description import ArmDescription
from hmtb_twin.parameters.plant import Plant
from hmtb_twin.parameters.specimen import Specimen
from hmtb_twin.truth.innovations import Disturbances, innovations_form, minimal_innovations_form
from sysid import StateSpace

SILENT = 1e-7
"""Modes with a smaller share of the gain at 0 Hz belong to other channels: a zero of this one cancels them."""

ORIGIN = 1e-6
"""Poles and zeros of smaller modulus are delays, or too fast to be distinguished from them."""

DEFECTIVE = 1e14
"""Condition of eigenvectors from which on they are no basis."""

FAR = 1e3
"""Zeros of larger modulus are rounding errors of zeros at infinity."""


def modal(channel: StateSpace, late: int = 0) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the modes of a channel that connect its command with its measurement.

    Balanced truncation keeps the response but moves poles that are near a zero; here poles are eigenvalues of the whole
    model. Modes that the channel does not show are left out, each with the zero that cancels it.

    Args:
        channel: A stable single-input single-output model with all states.
        late: Samples by which its output is late. A mode that decays fast carries the more of the gain the later its
            response is seen, which says nothing of the arm: shares are those ahead of these samples.

    Returns:
        Poles in the z plane, largest modulus first, without those at the origin (n,); the fraction of the gain at 0 Hz
        that each carries, as a modulus (n,); zeros, largest modulus first, without those at the origin (m,).
    """
    A, B, C = channel.A, channel.B.astype(complex), channel.C
    poles, vectors = np.linalg.eig(A)
    if np.linalg.cond(vectors) < DEFECTIVE:
        residues = (C @ vectors)[0] * np.linalg.solve(vectors, B)[:, 0]
    else:
        # Delays of several samples are one mode at the origin with a single eigenvector; the others are as they were.
        poles, left, vectors = eig(A, left=True)
        scales = np.einsum("ij,ij->j", left.conj(), vectors)
        residues = (C @ vectors)[0] * (left.conj().T @ B)[:, 0] / np.where(scales == 0.0, 1.0, scales)
    # At 0 Hz, z = 1, a mode with pole p and residue r contributes r / (1 - p).
    shares = np.abs(residues / (1.0 - poles)) / abs(channel.dc_gain()[0, 0])
    moving = np.abs(poles) > ORIGIN
    if late:
        shares = shares * np.abs(poles) ** late
    shown = moving & (shares > SILENT)
    zeros = channel.zeros()
    zeros = zeros[np.isfinite(zeros) & (np.abs(zeros) > ORIGIN) & (np.abs(zeros) < FAR)]
    # Rounding and finite differences keep pole and cancelling zero apart: the nearest zero is its partner.
    for pole in poles[moving & ~shown]:
        if len(zeros):
            zeros = np.delete(zeros, np.argmin(np.abs(zeros - pole)))
    order = np.argsort(-np.abs(poles[shown]), kind="stable")
    return poles[shown][order], shares[shown][order], zeros[np.argsort(-np.abs(zeros), kind="stable")]


MINIMAL = 1e-9
"""Hankel singular values below this fraction of the largest are rounding errors of the finite differences."""

DELAY = 1e-9
"""A Markov parameter below this fraction of the largest counts as zero."""


@dataclass(frozen=True)
class JointTruth:
    """Truth about one joint: from commanded to measured angle while the other servos hold their joints.

    Attributes:
        name: The joint.
        model: Minimal single-input single-output model; with process noise in innovations form, with the states that
            only noise moves beside those that the command moves.
        bandwidth_hz: First frequency at which the gain is 3.01 dB below its value at 0 Hz, Hz; NaN if it never is,
            and for an indexed joint, which a pin holds.
        dc_gain: Gain at 0 Hz.
        poles: Poles of the path from command to measurement in the z plane, largest modulus first: modes of the whole
            arm, and zero for every sample of delay beyond one.
        shares: Part of the gain at 0 Hz that each pole carries, as a modulus; 0 for delays.
        zeros: Zeros of that path in the z plane.
        delay_samples: Samples from a command to the first measurement that shows it; the analyst's nk.
    """

    name: str
    model: StateSpace
    bandwidth_hz: float
    dc_gain: float
    poles: np.ndarray
    shares: np.ndarray
    zeros: np.ndarray
    delay_samples: int

    @property
    def natural_poles(self) -> np.ndarray:
        """Poles in the s plane, rad/s, from those in the z plane; bus delays have none."""
        moving = self.poles[np.abs(self.poles) > 1e-6]
        return np.log(moving.astype(complex)) / self.model.dt

    @property
    def dominant_poles(self) -> np.ndarray:
        """Poles in the s plane that carry more than 5 % of the gain at 0 Hz each, rad/s, slowest first.

        Poles that decay to a twentieth within a sample are left out: they are so close together that their shares,
        large and of opposite sign, are meaningless.
        """
        dominant = self.poles[(self.shares > 0.05) & (np.abs(self.poles) > 0.05)].astype(complex)
        natural = np.log(dominant) / self.model.dt
        return natural[np.argsort(-natural.real, kind="stable")]


@dataclass(frozen=True)
class Truth:
    """True small-signal dynamics of the arm at one operating point, without dry friction.

    Attributes:
        model: Seven commanded angles to seven measured angles at 50 Hz, rad, in innovations form: K and the innovation
            covariance of the best linear predictor from all seven measurements. Without process noise K is None and the
            covariance that of resolver noise and rounding.
        disturbances: The noise that the innovations form follows from.
        variant: Arm variant.
        payload: Payload of the end effector.
        plant: Supply, oil, friction and noise of the drives.
        specimen: Deviations of the arm from its variant.
        pose: Operating point, by name.
        angles: Operating point (7,), rad.
        small_signal_error: By amplitude in rad, the relative error of the linear model against simulation: root mean
            square of the difference over that of the response, largest over the studied joints; NaN where the arm is
            unstable.
        provenance: Method and software versions.
    """

    model: StateSpace
    disturbances: Disturbances
    variant: str
    payload: str
    plant: Plant
    specimen: Specimen
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
    def arm(self) -> ArmDescription:
        """Description of the arm."""
        return arm_named(self.variant)

    @property
    def dt(self) -> float:
        """Sampling time, s."""
        return self.model.dt

    @property
    def spectral_radius(self) -> float:
        """Largest modulus of the poles in the z plane; the arm is stable where it is below 1."""
        return float(np.abs(np.linalg.eigvals(self.model.A)).max())

    def joint(self, name: str) -> JointTruth:
        """Return the truth about one joint.

        Raises:
            TwinError: There is no such joint, or the arm is unstable: it has no gain at 0 Hz, and no bandwidth.
        """
        channel = self.channel(name, name)
        if not self.spectral_radius < 1.0:
            conditions = ", ".join(f"{key} = {value!r}" for key, value in vars(self.plant).items())
            raise TwinError(
                f"the arm is unstable at {self.pose} under {conditions}: spectral radius {self.spectral_radius:.6g} at "
                f"{1.0 / self.dt:g} Hz, expected below 1"
            )
        commanded = replace(channel, K=None)
        path = commanded.minimal(MINIMAL)
        on_the_bus = self.arm.bus[name].delay
        # The arms of the test bed have one sample, which their published shares include.
        poles, shares, zeros = modal(commanded, max(on_the_bus - 1, 0))
        # A hundred samples after the bus delay: rounding stays below `DELAY`.
        pulse = np.abs(path.markov(100 + on_the_bus)[:, 0, 0])
        delay = int(np.argmax(pulse > DELAY * pulse.max()))
        # The delay is the excess of poles over zeros: those that `modal` has left out are at the origin.
        delay_poles = np.zeros(max(0, delay - len(poles) + len(zeros)))
        indexed = name in self.arm.indexed
        bandwidth = np.nan if indexed else float(path.bandwidth()[0, 0])
        return JointTruth(
            name=name,
            model=minimal_innovations_form(channel, MINIMAL),
            bandwidth_hz=bandwidth,
            dc_gain=float(path.dc_gain()[0, 0]),
            poles=np.concatenate([poles, delay_poles]),
            shares=np.concatenate([shares, delay_poles]),
            zeros=zeros,
            delay_samples=delay,
        )

    def channel(self, commanded: str, measured: str) -> StateSpace:
        """Return the model from one joint's command to one joint's measurement with all states; see `subset`."""
        return self.subset((commanded,), (measured,))

    def subset(self, commanded: Sequence[str], measured: Sequence[str]) -> StateSpace:
        """Return the model from some commands to some measurements with all states.

        Its noise model is that of the subset alone: the innovations are the part of the named measurements that their
        past does not predict, while the noise of all drives acts and the other commands stand still. It is no part of
        the K and the covariance of the whole, whose predictor knows all seven measurements.

        Args:
            commanded: The commanded joints, one or more, each once.
            measured: The measured joints, likewise.

        Returns:
            A model with those inputs and outputs in that order.

        Raises:
            TwinError: No joint, a repeated one, or an unknown one.
        """
        for role, names in (("commanded", commanded), ("measured", measured)):
            if isinstance(names, str) or not isinstance(names, Sequence) or not names:
                raise TwinError(f"{role} = {names!r} given, expected one or more joints, each once")
        inputs = [self.arm.joint_index(name) for name in commanded]
        outputs = [self.arm.joint_index(name) for name in measured]
        for role, joints in (("commanded", inputs), ("measured", outputs)):
            if len(set(joints)) != len(joints):
                names = tuple(self.arm.joints[j] for j in joints)
                raise TwinError(f"{role} = {names!r} given, expected one or more joints, each once")
        model, disturbances = self.model, self.disturbances
        # Without K: the predictor of these measurements alone follows from the disturbances.
        path = StateSpace(
            model.A,
            model.B[:, inputs],
            model.C[outputs],
            model.D[np.ix_(outputs, inputs)],
            None,
            model.dt,
            input_names=tuple(f"{self.arm.joints[j]} commanded" for j in inputs),
            output_names=tuple(f"{self.arm.joints[i]} measured" for i in outputs),
            input_units=("rad",) * len(inputs),
            output_units=("rad",) * len(outputs),
        )
        return innovations_form(path, disturbances.drives, disturbances.resolvers[np.ix_(outputs, outputs)])
