"""Plant: supply, oil, friction and process noise of the drives; the table `[plant]` of an experiment."""

from collections.abc import Mapping
from dataclasses import dataclass, fields, replace

from hmtb_twin.files.errors import TwinError, shown
from hmtb_twin.parameters.drives import COLDEST, HOTTEST, Drive, ElectricDrive, Friction, Hydraulics
from hmtb_twin.parameters.real_number import real_number

ACTUATOR_FORMS = ("linear", "orifice")
"""Fidelities of the actuators: a linear load-flow characteristic, or a servo valve with square-root orifices."""

FRICTIONS = ("none", "viscous", "coulomb", "lugre")
"""Friction of the joints: none; viscous drag of the oil; drag and Dahl's model of Coulomb friction; drag and LuGre."""

SERVOS = ("variant", "flow", "torque")
"""Servo laws: that of the variant; the position error opens the valve; or it asks for a torque."""

LEAST_PRESLIDING = 1e-4
"""Least deflection of the bristles, rad: on shorter ones light joints reverse faster than the physics step resolves. At
1e-5 rad and three times the friction the nominal wrist roll swings ten times too far."""

STIFFEST = 5e-6
"""Least deflection of the bristles per multiple of friction, rad: on stiffer ones a stuck yaw, with the arm straight up
and so of little inertia, swings faster than the physics step resolves."""

FLATTEST = 0.02
"""Least slope of a load-flow line, over that of the straight one: a spool near null leaks a few percent of it."""


@dataclass(frozen=True)
class Plant:
    """Physics of the drives that an experiment may choose, besides the variant of the arm and its payload.

    Attributes:
        actuator: One of `ACTUATOR_FORMS`.
        servo: One of `SERVOS`.
        friction: One of `FRICTIONS`.
        friction_level: Dry friction, in multiples of the variant's.
        presliding: Deflection at which the bristles of dry friction carry Coulomb torque, rad; at least
            `LEAST_PRESLIDING`, and `STIFFEST` times the level.
        supply_pressure: Pressure of the supply, MPa.
        oil_temperature: Temperature of the oil, which sets its viscosity, and so drag and leakage, degrees Celsius.
        process_noise: Standard deviation of the torque noise of the valve drives, as a fraction of each joint's rated
            torque; white at 50 Hz and held over each tick.
        load_flow_slope: Slope of the valves' load-flow line near null, over that of the straight line from no-load flow
            to stall, at least `FLATTEST`; dynamic pressure feedback of a flow servo makes up for its damping.
    """

    actuator: str = "linear"
    servo: str = "variant"
    friction: str = "lugre"
    friction_level: float = 1.0
    presliding: float = Friction.presliding
    supply_pressure: float = Hydraulics.supply_pressure
    oil_temperature: float = Hydraulics.oil_temperature
    process_noise: float = 0.0
    load_flow_slope: float = Hydraulics.load_flow_slope

    def __post_init__(self) -> None:
        for name, available in (("actuator", ACTUATOR_FORMS), ("servo", SERVOS), ("friction", FRICTIONS)):
            choice = getattr(self, name)
            if not isinstance(choice, str) or choice not in available:
                raise TwinError(f"plant: unknown {name} {shown(choice)}, available: {', '.join(available)}")
            # NumPy texts and numbers become Python's: equal plants are written equally to files.
            object.__setattr__(self, name, str(choice))
        lowest = 1.5 * Hydraulics.return_pressure
        pressures = f"{lowest:g} MPa, well above the return pressure, to 100 MPa"
        deflections = f"{LEAST_PRESLIDING:g} to 0.1 rad: the physics step does not resolve stiffer bristles"
        ranges: Mapping[str, tuple[float, float, str]] = {
            "friction_level": (0.0, 100.0, "0 to 100"),
            "presliding": (LEAST_PRESLIDING, 0.1, deflections),
            "supply_pressure": (lowest, 100.0, pressures),
            "oil_temperature": (COLDEST, HOTTEST, f"{COLDEST:g} to {HOTTEST:g} degrees Celsius"),
            "process_noise": (0.0, 1.0, "0 to 1, a part of the rated torque"),
            "load_flow_slope": (FLATTEST, 1.0, f"{FLATTEST:g} to 1, a part of the straight line's"),
        }
        for name, (lower, upper, expected) in ranges.items():
            value = real_number(getattr(self, name))
            if not lower <= value <= upper:
                raise TwinError(f"plant: {name} = {shown(getattr(self, name))} given, expected {expected}")
            object.__setattr__(self, name, value)
        # Rounded: a level computed from a torque may be off in its last digit.
        shortest = round(STIFFEST * self.friction_level, 12)
        if self.presliding < shortest:
            raise TwinError(
                f"plant: presliding = {self.presliding:g} at friction_level = {self.friction_level:g} given, expected "
                f"{shortest:g} to 0.1 rad: the physics step does not resolve stiffer bristles"
            )

    def __repr__(self) -> str:
        """Name every field, but the slope only where it is not the nominal one: keys of stored truths lack it."""
        values = []
        for name in (field.name for field in fields(self)):
            value = getattr(self, name)
            if name != "load_flow_slope" or value != Hydraulics.load_flow_slope:
                values.append(f"{name}={value!r}")
        return f"Plant({', '.join(values)})"

    @property
    def sliding(self) -> "Plant":
        """The plant without dry friction, but with the oil's drag if it has any."""
        return self if self.friction == "none" else replace(self, friction="viscous")

    def applied(self, drive: Drive) -> Drive:
        """Return a drive under these conditions; raises `TwinError` for conditions of oil and an electric drive."""
        if isinstance(drive, ElectricDrive):
            self._check_no_oil()
            return replace(drive, friction=self._friction(drive.friction))
        oil = replace(
            drive.hydraulics,
            supply_pressure=self.supply_pressure,
            oil_temperature=self.oil_temperature,
            load_flow_slope=self.load_flow_slope,
        )
        return replace(drive, hydraulics=oil, friction=self._friction(drive.friction))

    def _check_no_oil(self) -> None:
        """Raise `TwinError` if the plant asks for valves or oil that electric drives do not have."""
        for name in ("actuator", "servo", "supply_pressure", "oil_temperature", "load_flow_slope"):
            value, nominal = getattr(self, name), getattr(type(self), name)
            # "torque" is the law of every electric servo, so that naming it changes nothing.
            if value not in (nominal, "torque"):
                raise TwinError(
                    f"plant: {name} = {value!r} given, but the drives of this arm are electric, without valves and "
                    f"oil; expected the nominal {nominal!r}. dry friction and process noise apply"
                )

    def _friction(self, seals: Friction | None) -> Friction | None:
        """Return the friction of a joint under this plant from that of its variant."""
        if seals is None or self.friction == "none":
            return None
        # The oil's drag stays in every model but "none".
        dry = 0.0 if self.friction == "viscous" else self.friction_level * seals.coulomb
        # Without Stribeck's peak LuGre friction is Dahl's.
        ratio = 1.0 if self.friction == "coulomb" else seals.static_ratio
        lost = 0.0 if self.friction == "viscous" else self.friction_level * seals.load_loss
        return replace(seals, coulomb=dry, presliding=self.presliding, static_ratio=ratio, load_loss=lost)


NOMINAL_PLANT = Plant()
"""Linear actuators on the variant's servo, LuGre friction, nominal pressure and temperature, no process noise."""
