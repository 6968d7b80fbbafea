"""What the arm's drives run on and rub with: the table `[plant]` of an experiment."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from numbers import Real

from hmtb_twin.parameters.drives import COLDEST, HOTTEST, Drive, ElectricDrive, Friction, Hydraulics
from hmtb_twin.parameters.errors import TwinError

ACTUATOR_FORMS = ("linear", "orifice")
"""Fidelities of the actuators: a linear load-flow characteristic, or a servo valve with square-root orifices."""

FRICTIONS = ("none", "viscous", "coulomb", "lugre")
"""What the joints rub with: nothing; the oil's drag; that and Coulomb friction; that and LuGre friction."""


@dataclass(frozen=True)
class Plant:
    """The physics of the drives that an experiment may choose, beside the variant of the arm and its payload.

    Attributes:
        actuator: One of `ACTUATOR_FORMS`.
        friction: One of `FRICTIONS`.
        friction_level: Dry friction, in multiples of the variant's.
        supply_pressure: Pressure of the supply, MPa.
        oil_temperature: Temperature of the oil, which sets its viscosity, and so drag and leakage, degrees Celsius.
        process_noise: Standard deviation of the torque that noise in the valve drives adds, as a part of each joint's
            rated torque; white at 50 Hz and held over each tick.
    """

    actuator: str = "linear"
    friction: str = "lugre"
    friction_level: float = 1.0
    supply_pressure: float = Hydraulics.supply_pressure
    oil_temperature: float = Hydraulics.oil_temperature
    process_noise: float = 0.0

    def __post_init__(self) -> None:
        for name, known in (("actuator", ACTUATOR_FORMS), ("friction", FRICTIONS)):
            text = getattr(self, name)
            if not isinstance(text, str) or text not in known:
                raise TwinError(f"plant: unknown {name} {text!r}, available: {', '.join(known)}")
            # Texts and numbers of NumPy are stored as Python's own: equal plants look equal, in files too.
            object.__setattr__(self, name, str(text))
        lowest = 1.5 * Hydraulics.return_pressure
        ranges: Mapping[str, tuple[float, float, str]] = {
            "friction_level": (0.0, 100.0, "0 to 100"),
            "supply_pressure": (lowest, 100.0, f"{lowest:g} MPa, well above the return pressure, to 100 MPa"),
            "oil_temperature": (COLDEST, HOTTEST, f"{COLDEST:g} to {HOTTEST:g} degrees Celsius"),
            "process_noise": (0.0, 1.0, "0 to 1, a part of the rated torque"),
        }
        for name, (lower, upper, expected) in ranges.items():
            value = getattr(self, name)
            # A truth value equals 0 or 1 and would pass for it.
            number = isinstance(value, Real) and not isinstance(value, bool)
            if not (number and lower <= value <= upper):
                raise TwinError(f"plant: {name} = {value} given, expected {expected}")
            object.__setattr__(self, name, float(value))

    @property
    def sliding(self) -> "Plant":
        """The plant without dry friction: the oil's drag, where there is any, is left."""
        return self if self.friction == "none" else replace(self, friction="viscous")

    def applied(self, drive: Drive) -> Drive:
        """Return a drive of the arm as it is under these conditions.

        Raises:
            TwinError: The conditions are those of oil, and the drive is electric.
        """
        if isinstance(drive, ElectricDrive):
            self._check_dry()
            return replace(drive, friction=self._rubbing(drive.friction))
        oil = replace(drive.hydraulics, supply_pressure=self.supply_pressure, oil_temperature=self.oil_temperature)
        return replace(drive, hydraulics=oil, friction=self._rubbing(drive.friction))

    def _check_dry(self) -> None:
        for name in ("actuator", "supply_pressure", "oil_temperature"):
            given, nominal = getattr(self, name), getattr(type(self), name)
            if given != nominal:
                raise TwinError(
                    f"plant: {name} = {given!r} given, but the drives of this arm are electric, without valves and "
                    f"oil; expected {nominal!r} as where there is no choice. friction, friction_level and "
                    "process_noise apply"
                )

    def _rubbing(self, seals: Friction | None) -> Friction | None:
        if seals is None or self.friction == "none":
            return None
        dry = 0.0 if self.friction == "viscous" else self.friction_level * seals.coulomb
        return replace(seals, coulomb=dry, bristles=self.friction == "lugre" and dry > 0.0)


NOMINAL_PLANT = Plant()
"""The linear actuator with LuGre friction, at the nominal pressure and temperature, without process noise."""
