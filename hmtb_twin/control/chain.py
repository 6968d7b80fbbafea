"""Which links of the chain act, from the excitation computer to the record."""

from dataclasses import dataclass


@dataclass(frozen=True)
class Chain:
    """The imperfections of the laboratory; each can be switched off alone.

    Attributes:
        dac: The excitation computer's converter rounds.
        noise: The wires pick up noise and hum.
        bias: The hand controller's axes stand off zero.
        adc: The hand controller's converter rounds.
        hold: Its processor samples slower than the position loop and holds; matters where `HandController.hold` is
            above 1.
        velocity_limit: Joint commands move no faster than their limits.
        friction: The seals rub; without, the oil's drag is left.
        resolver: The resolvers are noisy and round.
    """

    dac: bool = True
    noise: bool = True
    bias: bool = True
    adc: bool = True
    hold: bool = True
    velocity_limit: bool = True
    friction: bool = True
    resolver: bool = True


IDEAL = Chain(
    dac=False, noise=False, bias=False, adc=False, hold=False, velocity_limit=False, friction=False, resolver=False
)
"""Every link switched off; converters still saturate and joints keep their ranges."""
