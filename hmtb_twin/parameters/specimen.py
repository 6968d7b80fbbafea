"""Specimen: deviations of one arm from its variant; the table `[specimen]` of an experiment."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from hmtb_twin.files.errors import TwinError, shown
from hmtb_twin.parameters.arm_description import ArmDescription
from hmtb_twin.parameters.drives import Drive, ElectricDrive
from hmtb_twin.parameters.real_number import real_number
from hmtb_twin.parameters.servo_gains import ServoGains
from hmtb_twin.parameters.values import Recorder
from hmtb_twin.parameters.variants import JOINTS, LINKS

LINK_NAMES = tuple(LINKS)
"""The bodies of an arm, in sequence: the link that each joint moves, and the end effector."""

AXES = 3
"""Numbers of each body in `stretch`, `shear` and `shift`."""

LARGEST = 100.0
"""Largest factor; the smallest of those that must not vanish is one over it."""

FARTHEST = 3.0
"""Largest magnitude of `stretch`, `shear` and `shift`: far beyond any body that can be built."""

MAY_VANISH = ("dry_friction", "drag", "resolver_noise")
"""Factors that may be 0, which switches off the quantity that they multiply."""

OIL = ("bulk_modulus", "leakage")
"""Quantities of the oil, which electric drives do not have."""

DEVIATIONS = ("stretch", "shear", "shift")
"""Quantities that are nominally 0; all others are factors, nominally 1."""

PER_JOINT = ("dry_friction", "drag", "kp", "kd")
"""Quantities with an entry for each joint of the arm."""

LENGTHS = {
    "mass": len(LINK_NAMES),
    **dict.fromkeys(DEVIATIONS, AXES * len(LINK_NAMES)),
    **dict.fromkeys(PER_JOINT, len(JOINTS)),
}
"""Number of entries of each quantity that has one per body, axis or joint, of the arms of the test bed."""


@dataclass(frozen=True)
class Specimen:
    """Deviations of one arm from its variant. Its controller knows the variant, not the specimen.

    The pseudo-inertia of a body about its own centre of mass, J = [[S, 0], [0, m]] with S the second moments of its
    mass, becomes m_f U0 U U^T U0^T: U0 U0^T = J, and U the log-Cholesky matrix of [Rucker2022]

        U = [[exp(d1), s12, s13, t1], [0, exp(d2), s23, t2], [0, 0, exp(d3), t3], [0, 0, 0, 1]].

    Any numbers give a physically possible body, zeros give the variant's, and the mass factor scales mass and inertia
    alike. The axes are those of the body's frame, x along the link; one unit of a `shift` is the root mean square
    extent of the variant's body along that axis.

    An empty tuple, the default, means no deviation; a tuple of nominal entries is stored as an empty one.

    Attributes:
        mass: Factors of the masses of the bodies in the sequence of `LINK_NAMES` (8,).
        stretch: d1, d2, d3 of each body in turn (24,).
        shear: s12, s23, s13 of each body in turn (24,).
        shift: t1, t2, t3 of each body in turn, the displacement of the centre of mass (24,).
        payload_mass: Factor of the mass and inertia of the payload.
        dry_friction: Factors of the dry friction of the joints, in the sequence of `JOINTS` (7,).
        drag: Factors of their viscous friction (7,).
        kp: Factors of their servo gains for position (7,).
        kd: Factors of their servo gains for velocity (7,).
        bulk_modulus: Factor of the oil's stiffness.
        leakage: Factor of the internal leakage of the drives.
        resolver_noise: Factor of the standard deviation of the resolvers' noise.

    Raises:
        TwinError: A number that is not finite or out of its range, or a tuple of another length.
    """

    mass: tuple[float, ...] = ()
    stretch: tuple[float, ...] = ()
    shear: tuple[float, ...] = ()
    shift: tuple[float, ...] = ()
    payload_mass: float = 1.0
    dry_friction: tuple[float, ...] = ()
    drag: tuple[float, ...] = ()
    kp: tuple[float, ...] = ()
    kd: tuple[float, ...] = ()
    bulk_modulus: float = 1.0
    leakage: float = 1.0
    resolver_noise: float = 1.0

    def __post_init__(self) -> None:
        for name, value in vars(self).items():
            lower, upper = _range(name)
            if name in LENGTHS:
                object.__setattr__(self, name, _checked_tuple(name, value, lower, upper))
            else:
                object.__setattr__(self, name, _checked_number(name, value, lower, upper))

    def check(self, arm: ArmDescription) -> None:
        """Raise `TwinError` if an arm cannot have these deviations: other joints, or links that are not its own."""
        for name in PER_JOINT:
            count = len(getattr(self, name))
            if count not in (0, len(arm.joints)):
                raise TwinError(_wrong_number(name, count, len(arm.joints)))
        if arm.rigid is not None and (self.mass or any(getattr(self, name) for name in DEVIATIONS)):
            raise TwinError(
                f"specimen: deviating links of {arm.name} given, expected those of an arm of the test bed; factors of "
                f"joints ({', '.join(PER_JOINT)}) and of the payload apply to every arm"
            )

    @property
    def deviations(self) -> Mapping[str, float | tuple[float, ...]]:
        """Deviating parameters by the name of their field."""
        nominal = vars(NOMINAL_SPECIMEN)
        return {name: value for name, value in vars(self).items() if value != nominal[name]}

    @property
    def as_designed(self) -> bool:
        """Whether links and payload have the masses and inertias of the variant."""
        return not self.deviations.keys() & {"mass", "payload_mass", *DEVIATIONS}

    def recorder(self, arm: ArmDescription) -> Recorder:
        """The recorder of an arm with the noise of this one's resolvers."""
        return replace(arm.recorder, noise=self.resolver_noise * arm.recorder.noise)

    def applied(self, joint: int, drive: Drive) -> Drive:
        """Return the drive of a joint, by its place; raises `TwinError` for deviating oil and an electric drive."""
        oil_factors = [name for name in OIL if getattr(self, name) != 1.0]
        if isinstance(drive, ElectricDrive):
            if oil_factors:
                raise TwinError(
                    f"specimen: {oil_factors[0]} = {getattr(self, oil_factors[0])!r} given, but the drives of this arm "
                    "are electric, without oil; expected 1.0"
                )
        elif oil_factors:
            oil = drive.hydraulics
            oil = replace(oil, bulk_modulus=self.bulk_modulus * oil.bulk_modulus, leakage=self.leakage * oil.leakage)
            drive = replace(drive, hydraulics=oil)
        dry, drag = self._of_joint("dry_friction", joint), self._of_joint("drag", joint)
        # Electric drives have friction too, though no oil.
        if drive.friction is None or dry == drag == 1.0:
            return drive
        seals = drive.friction
        changed = {"coulomb": dry * seals.coulomb, "load_loss": dry * seals.load_loss, "viscous": drag * seals.viscous}
        return replace(drive, friction=replace(seals, **changed))

    def gains(self, joint: int, tuned: ServoGains) -> ServoGains:
        """Return the gains of the servo of a joint, by its place, on this arm from the tuned ones."""
        return tuned._replace(kp=self._of_joint("kp", joint) * tuned.kp, kd=self._of_joint("kd", joint) * tuned.kd)

    def bodies(
        self, masses: np.ndarray, centres: np.ndarray, moments: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return the mass properties of the bodies of this arm, in the order of `LINK_NAMES`.

        Args:
            masses: Masses of the variant's bodies (8,), kg.
            centres: Their centres of mass (8, 3), m.
            moments: Their moments of inertia about these, principal along the bodies' axes (8, 3), kg m^2.

        Returns:
            Masses (8,) in kg, centres of mass (8, 3) in m, and inertias about them (8, 3, 3) in kg m^2.
        """
        count = len(LINK_NAMES)
        factors = np.array(self.mass) if self.mass else np.ones(count)
        stretch, shear, shift = self._shapes
        # U but for its last row and column.
        shape = np.zeros((count, AXES, AXES))
        shape[:, range(AXES), range(AXES)] = np.exp(stretch)
        # s12, s23, s13.
        shape[:, [0, 1, 0], [1, 2, 2]] = shear
        # Second moments of the mass per mass, and their roots: the bodies' extents along their axes.
        extents = np.sqrt((0.5 * moments.sum(axis=1, keepdims=True) - moments) / masses[:, None])
        root = extents[:, :, None] * shape
        second_moments = (factors * masses)[:, None, None] * (root @ root.transpose(0, 2, 1))
        # Inertia = trace(S) 1 - S.
        trace = np.trace(second_moments, axis1=1, axis2=2)
        inertias = trace[:, None, None] * np.eye(AXES) - second_moments
        return factors * masses, centres + extents * shift, inertias

    @property
    def deviating(self) -> tuple[str, ...]:
        """The bodies of `LINK_NAMES` that differ from the variant's."""
        deviates = np.any(self._shapes, axis=(0, 2))
        if self.mass:
            deviates |= np.array(self.mass) != 1.0
        return tuple(name for name, flag in zip(LINK_NAMES, deviates, strict=True) if flag)

    @property
    def _shapes(self) -> np.ndarray:
        """Stretch, shear and shift (3, 8, 3)."""
        shapes = [getattr(self, name) or [0.0] * LENGTHS[name] for name in DEVIATIONS]
        return np.array(shapes).reshape(3, -1, AXES)

    def _of_joint(self, name: str, joint: int) -> float:
        """Return the factor of a joint in a quantity with one per joint; 1 where nothing deviates."""
        values = getattr(self, name)
        return float(values[joint]) if values else 1.0


def _range(name: str) -> tuple[float, float]:
    """Return the smallest and the largest value of a quantity."""
    if name in DEVIATIONS:
        return -FARTHEST, FARTHEST
    smallest = 0.0 if name in MAY_VANISH else 1.0 / LARGEST
    return smallest, LARGEST


def _checked_tuple(name: str, value: object, lower: float, upper: float) -> tuple[float, ...]:
    """Return a quantity with several entries as a tuple of floats, an empty one if all are nominal."""
    if isinstance(value, str) or not isinstance(value, Sequence | np.ndarray):
        raise TwinError(f"specimen: {name} = {shown(value)} given, expected a tuple of numbers")
    # How many joints an arm has is known when it is loaded.
    if name not in PER_JOINT and len(value) not in (0, LENGTHS[name]):
        raise TwinError(_wrong_number(name, len(value), LENGTHS[name]))
    factors = []
    for i, factor in enumerate(value):
        factors.append(_checked_number(f"{name}[{i}]", factor, lower, upper))
    nominal = 0.0 if name in DEVIATIONS else 1.0
    # Equal arms are equal records, whichever way they were written.
    deviates = any(factor != nominal for factor in factors)
    return tuple(factors) if deviates else ()


def _wrong_number(name: str, count: int, expected: int) -> str:
    return f"specimen: {count} entries of {name} given, expected {expected}, or none where nothing deviates"


def _checked_number(name: str, value: object, lower: float, upper: float) -> float:
    """Return a number as a float; raises `TwinError` outside its range."""
    real = real_number(value)
    if not lower <= real <= upper:
        raise TwinError(f"specimen: {name} = {shown(value)} given, expected a number from {lower:g} to {upper:g}")
    return real


NOMINAL_SPECIMEN = Specimen()
"""The arm exactly as its variant defines it."""
