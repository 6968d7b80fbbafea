"""Records of links, servos and motion; the pin, the hand controller and the recorder with unit, tag and source."""

from dataclasses import dataclass
from math import nextafter, pi

from hmtb_twin.files.errors import TwinError, shown
from hmtb_twin.parameters.quantity import quantity
from hmtb_twin.parameters.real_number import real_number


@dataclass(frozen=True)
class Pin:
    """Stiff spring at an indexed joint, with an added inertia that keeps its mode slow enough for the simulation step.

    Its mode lies at 100 rad/s, critically damped; under the arm's weight it yields some 1e-8 rad.
    """

    stiffness: float = quantity(1e10, "N m/rad", "assumed", "rigid: a joint yields some 1e-8 rad")
    inertia: float = quantity(1e6, "kg m2", "assumed", "of no machine part: a constraint would cost a fifth of a step")
    damping: float = quantity(2e8, "N m s/rad", "assumed", "critical")


PIN = Pin()

SAMPLE_RATE = 50
"""Rate of the position loop and of the bus record, Hz [Morris1996, II.4]."""

SAMPLE_TIME = 1.0 / SAMPLE_RATE
"""Period of the position loop, s."""


@dataclass(frozen=True)
class Link:
    """A link as a uniform solid cylinder along its own x axis.

    Attributes:
        length: Its length, m.
        mass: Its mass, kg.
        radius: Its outer radius, m.
    """

    length: float
    mass: float
    radius: float

    @property
    def axial_inertia(self) -> float:
        """Moment of inertia about the link's axis, kg m^2."""
        # A uniform solid cylinder: no document tells where the mass of a link sits.
        return 0.5 * self.mass * self.radius**2

    @property
    def transverse_inertia(self) -> float:
        """Moment of inertia about a transverse axis through the centre of mass, kg m^2."""
        return self.mass * (3.0 * self.radius**2 + self.length**2) / 12.0


@dataclass(frozen=True)
class Servo:
    """Design goals of a joint's position servo at the operating pose: poles, torque lag, damping of the oil.

    Attributes:
        slow_pole: Slower pole of the joint alone, rad/s.
        fast_pole: Faster pole, rad/s.
        torque_lag: Longest lag of the torque behind its command for which a torque servo is tuned, s.
        oil_damping: Damping ratio of the oil's resonance at which the dynamic pressure feedback of a flow servo aims.
    """

    slow_pole: float
    fast_pole: float
    torque_lag: float = 0.003
    oil_damping: float = 0.7


@dataclass(frozen=True)
class Motion:
    """Range of a joint and velocity limit of its command.

    Attributes:
        lower: Lower end of the range, rad.
        upper: Upper end, rad.
        velocity_limit: Largest velocity of the command, rad/s.
    """

    lower: float
    upper: float
    velocity_limit: float


GAINS = {"degrees": 1.17e-3, "nominal": 4e-3, "radians": 67e-3}
"""Readings of the hand controller's gain, whose unit the thesis does not print, rad/V.

The OKID matrices (5.8)-(5.10) look like models of data normalised by a largest command of 0.049 to 0.067 per unit
input. `degrees`: 0.067 read in degrees. `radians`: read in radians; then nine tenths of a PRBS slew at 25 deg/s.
`nominal`: the largest round gain at which none does: a PRBS of 1 V changes by 2 V in a tick, the joints by at most
8.7 mrad, so at most 4.36 mrad/V. The text agrees with small ones: "very small" gains, "small deviations", an input
"white in nature".
"""


@dataclass(frozen=True)
class HandController:
    """The hand-controller interface between the excitation computer and the position loop.

    Attributes:
        gain: Offset of a joint per volt in the single-joint mode, rad/V.
        rate_gain: Velocity of a joint per volt in the single-joint rate mode, rad/(s V).
        translation_gain: Offset of the tool per volt in the Cartesian mode, m/V.
        translation_rate_gain: Velocity of the tool per volt in the Cartesian rate mode, m/(s V).
        rotation_gain: Turn of the tool per volt in the Cartesian mode, rad/V.
        rotation_rate_gain: Angular velocity of the tool per volt in the Cartesian rate mode, rad/(s V).
        adc_bits: Resolution of the converter.
        adc_range: Its range, plus and minus, V.
        hold: Ticks of the position loop for which its processor holds each sample.
        deadband: Deflection below which nothing is commanded, V; larger ones start from zero at its edge.
        noise: Standard deviation of the noise that the wires pick up, V.
        noise_corner: Corner frequency of its first-order low-pass, Hz; 0 for white noise.
        logged_noise: Standard deviation of noise on every joint's command in the record alone, which the arm never
            feels, rad.
        logged_noise_corner: Corner frequency of its first-order low-pass, Hz; 0 for white noise.
        hum: Amplitude of mains hum of random phase, V.
        hum_frequency: Its frequency, Hz.
        bias: Standard deviation over experiments of each axis's offset, drawn from the experiment's seed, V.
        compensation: Fraction of the bias that the compensating circuit removes, 0 to 1.
    """

    gain: float = quantity(
        GAINS["nominal"],
        "rad/V",
        "derived",
        "largest round gain at which a PRBS of 1 V never slews at 25 deg/s; unit unknown: 0.067 of the OKID matrices "
        "(5.8)-(5.10) is 1.17e-3 read in degrees, 67e-3 in radians; 'very small'",
    )
    rate_gain: float = quantity(0.05, "rad/(s V)", "assumed", "joint rate mode: full stick a little above the limit")
    translation_gain: float = quantity(
        1.8e-3, "m/V", "assumed", "moves the joints about as far as the joint gain: 4 mrad/V on a quarter of the reach"
    )
    translation_rate_gain: float = quantity(0.02, "m/(s V)", "assumed", "full stick 0.2 m/s")
    rotation_gain: float = quantity(GAINS["nominal"], "rad/V", "assumed", "as the joint gain")
    rotation_rate_gain: float = quantity(0.05, "rad/(s V)", "assumed", "as the joint rate gain")
    adc_bits: int = quantity(12, "bit", "assumed", "that it quantises: thesis III.2A and III.4")
    adc_range: float = quantity(10.0, "V", "assumed", "plus and minus, like the excitation computer's converter")
    hold: int = quantity(3, "samples", "assumed", "that it samples and holds: plots of thesis III.2A, errors of III.4")
    deadband: float = quantity(0.0, "V", "assumed", "none is mentioned; an option")
    noise: float = quantity(
        0.1, "V", "assumed", "standard deviation; 'considerable noise': thesis III.2A, unshielded wires: III.4"
    )
    noise_corner: float = quantity(0.0, "Hz", "assumed", "corner of the noise's low-pass; 0: white up to 25 Hz")
    logged_noise: float = quantity(
        0.0, "rad", "assumed", "standard deviation; an option: 'errors on the input measurements', thesis III.4"
    )
    logged_noise_corner: float = quantity(0.0, "Hz", "assumed", "corner of its low-pass; 0: white up to 25 Hz")
    hum: float = quantity(0.0, "V", "assumed", "amplitude of mains hum; an option")
    hum_frequency: float = quantity(60.0, "Hz", "assumed", "mains; the 50 Hz loop sees it at 10 Hz")
    bias: float = quantity(
        0.02, "V", "assumed", "standard deviation over experiments; compensated for MIMO: thesis II.3B"
    )
    compensation: float = quantity(
        0.0, "1", "assumed", "part of the bias that the compensating circuit removes; 0.95 in MIMO tests"
    )

    def __post_init__(self) -> None:
        gains = [name for name in vars(self) if name.endswith("gain")]
        integers = ("adc_bits", "hold")
        volts = (0.0, 1000.0, "0 V to 1000 V")
        # Below half the sampling rate: the low-pass is one of samples.
        corner = (0.0, nextafter(SAMPLE_RATE / 2, 0.0), f"0 to below {SAMPLE_RATE / 2:g} Hz")
        ranges = {
            **dict.fromkeys(gains, (-100.0, 100.0, "up to 100 either way, not 0")),
            "adc_bits": (2, 24, "a whole number, 2 to 24"),
            "adc_range": (1e-3, 1000.0, "0.001 V to 1000 V"),
            "hold": (1, 10**6, "a whole number, 1 to 1000000"),
            "deadband": volts,
            "noise": volts,
            "noise_corner": corner,
            "logged_noise": (0.0, 10.0, "0 rad to 10 rad"),
            "logged_noise_corner": corner,
            "hum": volts,
            "hum_frequency": (nextafter(0.0, 1.0), 1e6, "above 0 Hz and up to 1 MHz"),
            "bias": volts,
            "compensation": (0.0, 1.0, "0 to 1"),
        }
        # Bounds of what anybody can mean: they catch typing errors, not implausible interfaces.
        for name, (lower, upper, expected) in ranges.items():
            value = real_number(getattr(self, name))
            # A gain of zero would leave the axis without any command.
            vanishing_gain = name in gains and value == 0.0
            fraction = name in integers and not value.is_integer()
            if vanishing_gain or fraction or not lower <= value <= upper:
                raise TwinError(f"hand controller: {name} = {shown(getattr(self, name))} given, expected {expected}")
            if name in integers:
                value = int(value)
            object.__setattr__(self, name, value)

    @property
    def adc_limit(self) -> int:
        """Number of converter counts on either side of zero."""
        return 2 ** (self.adc_bits - 1)

    @property
    def adc_step(self) -> float:
        """Voltage of one converter count, V."""
        # The range lies on both sides of zero.
        return 2.0 * self.adc_range / 2**self.adc_bits


@dataclass(frozen=True)
class Recorder:
    """Resolution and noise of the joint resolvers, as the 1553 record shows them."""

    resolver_bits: int = quantity(16, "bit", "assumed", "over one turn; 12 and 14 bit are the alternatives")
    noise: float = quantity(
        2e-5, "rad", "assumed", "standard deviation; disturbance one to two orders below the output: thesis III.2C"
    )

    @property
    def resolver_step(self) -> float:
        """Angle of one resolver count, rad."""
        return 2.0 * pi / 2**self.resolver_bits


@dataclass(frozen=True)
class BusTerminal:
    """A joint's terminal on the 1553 bus.

    Attributes:
        delay: Delay of the measured angle, samples.
    """

    delay: int


HAND_CONTROLLER = HandController()
LARGE_MOTION = HandController(
    gain=GAINS["radians"], translation_gain=0.03, rotation_gain=GAINS["radians"], noise=0.01, hold=1
)
"""Interface of experiments whose amplitude is a stated angle of the joints, up to 0.6 rad: nearly the ideal one."""

RECORDER = Recorder()
