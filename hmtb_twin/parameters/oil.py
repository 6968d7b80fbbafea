"""Viscosity of the hydraulic oil over temperature."""

from math import exp, log, log10

COLDEST, HOTTEST = 0.0, 100.0
"""Temperatures between which the viscosity law is used, degrees Celsius."""

REFERENCE_TEMPERATURE = 40.0
"""Temperature at which drag and leakage are stated, degrees Celsius."""

_KELVIN = 273.15
_KNOWN = ((40.0, 32.0), (100.0, 5.4))
"""Temperature, degrees Celsius, and kinematic viscosity, mm^2/s, of a mineral oil of ISO grade VG 32 (assumed)."""


def kinematic_viscosity(temperature: float) -> float:
    """Return the kinematic viscosity of an ISO VG 32 mineral oil, in mm^2/s.

    Walther's equation, log log (v + 0.7) linear in log T [ASTMD341], through 32 mm^2/s at 40 degrees Celsius, which is
    what the grade means, and 5.4 mm^2/s at 100.

    Args:
        temperature: Of the oil, degrees Celsius.
    """
    (cool, thick), (hot, thin) = _KNOWN
    outer = [log10(log10(v + 0.7)) for v in (thick, thin)]
    steps = [log(t + _KELVIN) for t in (cool, hot)]
    slope = (outer[1] - outer[0]) / (steps[1] - steps[0])
    power = outer[0] + slope * (log(temperature + _KELVIN) - steps[0])
    return exp(log(10.0) * 10.0**power) - 0.7


def relative_viscosity(temperature: float) -> float:
    """Return the viscosity at a temperature in degrees Celsius over that at 40: the density hardly changes."""
    return kinematic_viscosity(temperature) / kinematic_viscosity(REFERENCE_TEMPERATURE)
