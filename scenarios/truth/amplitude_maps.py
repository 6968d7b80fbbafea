"""Where linear ends: the best linear approximation against amplitude and level of friction."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

from hmtb_twin import IDEAL, STUDIED_JOINTS, Arm, Truth, linearize
from scenarios.experiments.multisines import MultisineExperiment, Multisines
from scenarios.truth.bandwidth_caution import slow_gain
from scenarios.truth.best_linear import BestLinearTruth, best_linear
from scenarios.truth.local_dynamics import Progress
from sysid.models.bandwidth import response_bandwidth

AMPLITUDES = (3e-4, 1e-3, 3e-3, 1e-2, 3e-2, 1e-1)
"""Amplitudes of the command, rad, root mean square."""

LEVELS = (0.0, 0.5, 1.0, 2.0, 4.0, 8.0)
"""Levels of dry friction, multiples of the variant's."""

LEVEL_AMPLITUDE = 1e-2
"""Amplitude at which the level of friction is varied, rad, root mean square."""

MEASUREMENT = Multisines(realisations=4)
"""The excitation class: enough of it to see a few percent, in a second of one core per amplitude and joint."""

CHAIN = replace(IDEAL, friction=True, velocity_limit=True)
"""Friction and velocity limit act; noise and rounding, which are no part of the arm, do not."""


@dataclass(frozen=True)
class LargeSignal:
    """The best linear approximation of one joint at one amplitude, in few numbers.

    Attributes:
        joint: The joint, excited alone.
        amplitude: Root mean square of the angle asked for at the stick, rad.
        level: Level of dry friction, multiple of the variant's.
        hz: Bandwidth from commanded to measured angle, Hz; NaN where the response does not show one.
        ci95: Its 95 % interval, Hz.
        asked_hz: Bandwidth from the angle asked for at the stick, before the velocity limit, Hz.
        gain: Gain from commanded to measured angle over that of the small-signal truth, mean of the lines up to
            `bandwidth_caution.SLOWEST`.
        distortion_percent: Nonlinear distortion, percent of the linear part.
        slewing: Share of the time at the velocity limit.
    """

    joint: str
    amplitude: float
    level: float
    hz: float
    ci95: tuple[float, float]
    asked_hz: float
    gain: float
    distortion_percent: float
    slewing: float


@dataclass(frozen=True)
class LargeSignals:
    """How the arm answers away from small signals.

    Attributes:
        over_amplitude: Every studied joint over amplitude, friction as the arm has it.
        over_level: Every studied joint over the level of dry friction, at `LEVEL_AMPLITUDE`.
    """

    over_amplitude: tuple[LargeSignal, ...]
    over_level: tuple[LargeSignal, ...]


def large_signals(
    arm: Arm,
    pose: str,
    *,
    amplitudes: Sequence[float] = AMPLITUDES,
    levels: Sequence[float] = LEVELS,
    measurement: Multisines = MEASUREMENT,
    threads: int | None = None,
    progress: Progress | None = None,
) -> LargeSignals:
    """Measure the best linear approximation of each studied joint over amplitude and over friction.

    Args:
        arm: The arm.
        pose: Keyframe about which the joints move.
        amplitudes: Amplitudes, rad, root mean square.
        levels: Levels of dry friction; none are varied where the arm has no dry friction.
        measurement: The excitation class.
        threads: Threads for the physics; all processors by default.
        progress: Called with the measurements done and those in all.

    Returns:
        The approximations.

    Raises:
        ScenarioError: See `best_linear`.
    """
    truth = linearize(arm, pose, amplitudes=())
    level = arm.plant.friction_level if arm.friction else 0.0
    wanted = [(joint, amplitude, level) for joint in STUDIED_JOINTS for amplitude in amplitudes]
    varied = [(joint, LEVEL_AMPLITUDE, each) for joint in STUDIED_JOINTS for each in levels] if arm.friction else []
    found: dict[tuple[str, float, float], LargeSignal] = {}
    todo = list(dict.fromkeys(wanted + varied))
    for number, (joint, amplitude, each) in enumerate(todo):
        plant = replace(arm.plant, friction_level=each) if arm.friction else arm.plant
        setting = MultisineExperiment(
            joint,
            (joint,),
            variant=arm.variant,
            payload=arm.payload,
            plant=plant,
            specimen=arm.specimen,
            pose=pose,
            chain=CHAIN,
        )
        measured = best_linear(setting, replace(measurement, rms=amplitude), threads=threads)
        found[joint, amplitude, each] = _summary(measured, truth, joint, amplitude, each)
        if progress is not None:
            progress(number + 1, len(todo))
    return LargeSignals(tuple(found[key] for key in wanted), tuple(found[key] for key in varied))


def _summary(measured: BestLinearTruth, truth: Truth, joint: str, amplitude: float, level: float) -> LargeSignal:
    band, asked = measured.bandwidth, response_bandwidth(measured.chain.response)
    return LargeSignal(
        joint=joint,
        amplitude=amplitude,
        level=level,
        hz=float(band.hz[0, 0]),
        ci95=(float(band.ci95[0][0, 0]), float(band.ci95[1][0, 0])),
        asked_hz=float(asked.hz[0, 0]),
        gain=slow_gain(measured, truth),
        distortion_percent=float(measured.distortion_percent[0]),
        slewing=measured.slewing,
    )
