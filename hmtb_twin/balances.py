"""Where the oil and the energy of a run went: the two books that must balance, whatever the actuator's form."""

from dataclasses import dataclass, fields

import numpy as np


@dataclass(frozen=True)
class OilBalance:
    """Oil of each drive over a run: what came in through the valve is where it went. Volumes (n,), cm^3.

    Attributes:
        ports: Net flow through the valve's load ports.
        leaked: Past the actuator.
        swept: Displaced by the joint's travel.
        stored: By compression.
        underway: Not yet taken or given by the joint, by which the oil lags one physics step: D h (w at the end less w
            at the start). Zero from rest to rest, and with the step.
        throughput: Integral of the magnitude of the flow through the load ports.
    """

    ports: np.ndarray
    leaked: np.ndarray
    swept: np.ndarray
    stored: np.ndarray
    underway: np.ndarray
    throughput: np.ndarray

    def __post_init__(self) -> None:
        for item in fields(self):
            volumes = np.array(getattr(self, item.name), dtype=float)
            volumes.setflags(write=False)
            object.__setattr__(self, item.name, volumes)

    @property
    def residual(self) -> np.ndarray:
        """Oil that came in and is nowhere, (n,) cm^3."""
        return self.ports - self.leaked - self.swept - self.stored + self.underway

    @property
    def closure(self) -> float:
        """Sum of the residuals' magnitudes over all the oil that flowed."""
        return float(np.abs(self.residual).sum() / self.throughput.sum())


@dataclass(frozen=True)
class EnergyBalance:
    """Energy of all drives and the arm over a run: what the supply gave is where it went. Energies in J.

    Attributes:
        supplied: By the supply: its pressure times the flow it delivers.
        throttled: Lost in the valves, between supply and load ports.
        leaked: Lost in leakage past the actuators.
        compressed: Stored in the oil's compression.
        limited: Taken by the limit of the actuators' torque, which cuts the torque but not the pressure; negative where
            a load overruns the limit: a real actuator's relief valves would open before.
        rubbed: Lost in dry friction.
        dragged: Lost in viscous drag.
        constrained: Taken by the pin of the indexed joint and by stops.
        kinetic: Gained by the links in kinetic energy.
        potential: Gained by the links in height.
    """

    supplied: float
    throttled: float
    leaked: float
    compressed: float
    limited: float
    rubbed: float
    dragged: float
    constrained: float
    kinetic: float
    potential: float

    @property
    def delivered(self) -> float:
        """Net energy through the load ports, J."""
        return self.supplied - self.throttled

    @property
    def residual(self) -> float:
        """Energy that came in and is nowhere, J."""
        return self.supplied - sum(getattr(self, item.name) for item in fields(self) if item.name != "supplied")

    @property
    def closure(self) -> float:
        """Magnitude of the residual over the energy supplied."""
        return abs(self.residual) / self.supplied
