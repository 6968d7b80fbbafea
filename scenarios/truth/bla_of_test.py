"""Best linear approximation for a test, measured under a multisine of the same band and strength as its command."""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from hmtb_twin import Experiment, linearize, load_arm
from hmtb_twin.arm_files.known_arms import arm_named
from hmtb_twin.control.data_acquisition import BOARD
from hmtb_twin.run.experiment_row import experiment_arm, prepare
from scenarios.experiments.multisines import MultisineExperiment, Multisines, multisine_experiments
from scenarios.truth.best_linear import MOST, REALISATIONS, best_linear_as_needed, cautions
from sysid import FrequencyResponse, IOData
from sysid.models.bandwidth import HALF_POWER, gain_crossing
from sysid.records.arrays import FloatArray

SHARE = 0.95
"""Share of the command's power that the multisine's band holds."""

CLOSE = 0.01
"""How close the multisine's command comes to the test's, as a part of its root mean square."""

ROUNDS = 12
"""Most amplitudes in the search."""

FLATTEST = 0.1
"""Least slope that the search assumes, logarithm of the command's strength over that of the amplitude."""

ROOM = 0.98
"""Part of the converter's range that the multisine may fill: noise and rounding need the rest."""


@dataclass(frozen=True)
class BestLinearOfTest:
    """Best linear bandwidth of a joint that is commanded as strongly as in a test.

    Attributes:
        joint: The joint.
        test: The test.
        hz: Half-power bandwidth relative to the gain extrapolated to 0 Hz, Hz; NaN where none shows.
        ci95: Its 95 % interval, Hz.
        half_power_hz: Where the gain is 0.707, whatever it is at 0 Hz, Hz.
        wanted_rms: Root mean square of the test's command, rad.
        command_rms: That of the multisine's, as logged, rad.
        f_max: Upper end of the multisine's band, Hz.
        f_min: Its lowest line, Hz.
        realisations: Of the multisine.
        slewing: Share of samples in which the multisine's command moved at its velocity limit.
        distortion_percent: Nonlinear distortion, percent of the linear part.
        physics_s: Wall time in the physics, s.
        cautions: Reasons not to rely on it, in words.
        response: The response from commanded to measured angle, with its uncertainty.
    """

    joint: str
    test: str
    hz: float
    ci95: tuple[float, float]
    half_power_hz: float
    wanted_rms: float
    command_rms: float
    f_max: float
    f_min: float
    realisations: int
    slewing: float
    distortion_percent: float
    physics_s: float
    cautions: tuple[str, ...]
    response: FrequencyResponse = field(repr=False, compare=False)

    @property
    def described(self) -> str:
        """The class of excitation in words."""
        lines = f"equal lines from {self.f_min:.2g} to {self.f_max:.2g} Hz"
        strength = f"{1000 * self.command_rms:.1f} mrad rms as logged (test: {1000 * self.wanted_rms:.1f})"
        return f"random-phase multisine of {self.realisations} realisations, {lines}, command of {strength}"


def best_linear_of_test(
    setting: Experiment, records: Sequence[IOData], *, test: str, seed: int = 0, threads: int | None = None
) -> BestLinearOfTest:
    """Measure the best linear approximation under a multisine like a test's command, friction and noise included.

    Like it in two numbers: the root mean square of the command *as logged*, behind the velocity limit, and the
    frequency below which 95 % of its power lies. The lines begin at 0.1 Hz all the same, because a bandwidth is
    relative to the gain at 0 Hz, and a file of 2 s excites nothing below 0.5 Hz. The distribution of amplitudes is
    not that of a binary sequence, which changes the effect of friction by some percent of the gain.

    Args:
        setting: Any experiment of the joint on the arm, for its conditions.
        records: Settled records of the test without means, of one seed or more, rad.
        test: Name of the test.
        seed: Of phases and noise.
        threads: Threads for the physics.

    Raises:
        ScenarioError: See `scenarios.truth.best_linear.best_linear_as_needed`.
    """
    commands = [record.u[:, 0] for record in records]
    base, multisines, wanted_rms = multisine_like(setting, commands, seed=seed, realisations=REALISATIONS)
    approximation = best_linear_as_needed(base, multisines, threads=threads)
    response = approximation.servo.response
    hz, low, high = approximation.bandwidth.path()
    truth = linearize(experiment_arm(base), setting.pose, amplitudes=())
    return BestLinearOfTest(
        joint=base.name,
        test=test,
        hz=hz,
        ci95=(low, high),
        half_power_hz=gain_crossing(response, HALF_POWER),
        wanted_rms=wanted_rms,
        command_rms=float(approximation.command_rms[0]),
        f_max=multisines.f_max,
        f_min=float(response.frequencies[0]),
        realisations=approximation.experiment.multisines.realisations,
        slewing=approximation.slewing,
        distortion_percent=float(approximation.distortion_percent[0]),
        physics_s=approximation.physics_seconds,
        cautions=cautions(approximation, truth),
        response=response,
    )


def multisine_like(
    setting: Experiment, commands: Sequence[FloatArray], *, seed: int, realisations: int
) -> tuple[MultisineExperiment, Multisines, float]:
    """Choose the multisine like a test's command; see `best_linear_of_test`.

    A limited command grows less than the amplitude at the stick, which a secant on logarithmic scales therefore finds.
    Where the converter clips first, it is the largest amplitude that the converter plays.

    Args:
        setting: Any experiment of the joint on the arm, for its conditions.
        commands: Commands of the test without means, of one seed or more (N,), rad.
        seed: Of phases and noise.
        realisations: Of the multisine.

    Returns:
        The setting for `best_linear`, the multisine, and the root mean square of the test's command, rad.

    Raises:
        ScenarioError: The multisine cannot be played.
    """
    wanted_rms = _rms(commands)
    (joint,) = setting.axes
    shared = ("variant", "payload", "plant", "specimen", "pose", "chain", "hand_controller")
    base = MultisineExperiment(joint, (joint,), seed=seed, **{name: getattr(setting, name) for name in shared})
    f_max = float(np.mean([_band_end(command, base.sample_rate) for command in commands]))
    target = Multisines(rms=wanted_rms, f_max=f_max, realisations=realisations, seed=seed)
    # An amplitude far below the limits comes out as it went in: slope one on logarithmic scales.
    rms, slope = wanted_rms, 1.0
    previous: tuple[float, float] | None = None
    for _ in range(ROUNDS):
        current = replace(target, rms=rms)
        # Random phases: each realisation has a peak of its own, and the converter must play all that may be needed.
        peak = max(float(np.abs(current.offsets(r)).max()) for r in range(max(realisations, MOST)))
        largest = ROOM * rms * BOARD.dac_range * base.hand_controller.gain / peak
        if rms > largest:
            rms, current = largest, replace(target, rms=largest)
        steady_from = replace(base, multisines=current).settling
        command_rms = _rms([joint_command(played)[steady_from:] for played in multisine_experiments(base, current)])
        close_enough = abs(command_rms / wanted_rms - 1.0) < CLOSE
        # The converter clips before the command is strong enough: nothing larger can be played.
        at_the_end = rms == largest and command_rms < wanted_rms
        if close_enough or at_the_end:
            break
        point = float(np.log(rms)), float(np.log(command_rms))
        # The converter's range may give the same amplitude twice, which has no secant.
        if previous is not None and point[0] != previous[0]:
            slope = (point[1] - previous[1]) / (point[0] - previous[0])
        previous = point
        # A command held at its velocity limit hardly grows any more: a flat slope would throw the next amplitude away.
        rms *= float((wanted_rms / command_rms) ** (1.0 / max(slope, FLATTEST)))
    return base, current, wanted_rms


def _rms(commands: Sequence[FloatArray]) -> float:
    """Root mean square of commands about their means, over all of them, rad."""
    return float(np.sqrt(np.mean([np.var(command) for command in commands])))


def _band_end(command: FloatArray, sample_rate: int) -> float:
    """Frequency below which a command (N,) at a rate in Hz has the share `SHARE` of its power, Hz."""
    power = np.abs(np.fft.rfft(command)) ** 2
    line = int(np.searchsorted(np.cumsum(power), SHARE * power.sum()))
    return line * sample_rate / len(command)


def joint_command(experiment: Experiment) -> FloatArray:
    """Return the command of an experiment's only joint (N,), rad, which follows without simulating the physics."""
    (joint,) = experiment.axes
    return prepare(experiment, load_arm).station.commands[:, arm_named(experiment.variant).joint_index(joint)]
