"""Seven-joint model: every joint and every coupling path from one campaign of all joints, beside the truth."""

import warnings
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

import sysid
from hmtb_twin import JOINTS, JointLog, JointTruth, simulate
from scenarios.experiments.log_review import SETTLING
from scenarios.experiments.multisines import MultisineExperiment, Multisines, multisine_experiments
from scenarios.experiments.registry import load
from scenarios.files.errors import ScenarioError
from scenarios.identification.recovered_bandwidth import Interval
from scenarios.truth.best_linear import BestLinearTruth, approximated
from sysid import Estimate, FrequencyResponse, SysidWarning
from sysid.frequency.band_gain import BandGain, band_gain
from sysid.records.arrays import Locked

SETTING = "every-joint"
"""Scenario whose arm, pose and chain of signals the campaign has."""

MULTISINES = Multisines(rms=0.03, f_min=1.0 / 6.0, f_max=8.0, period=6.0, realisations=5)
"""Excitation: 35 records of 18 s. At this amplitude every joint slides; lines to 8 Hz tell the delays."""

LEVEL = 0.01
"""Level of the test of each coupling path, of that path alone: of a hundred paths without coupling it calls one."""

FLOOR = 1e-6
"""Largest small-signal gain in the band up to which a path counts as not coupled.

The resolvers' noise of 0.02 mrad would hide a smaller one in an hour of commands of 0.03 rad. At the pose `home` the
paths that symmetry forbids have gains of rounding, 1e-13, and all others more than 1e-4.
"""

ORDERS = ((2, 3), (3, 4), (4, 4), (5, 5))
"""nb, nf of the output-error models of a joint; the Bayesian information criterion chooses [Schwarz1978]."""


@dataclass(frozen=True, eq=False)
class SevenJointPath:
    """Model of one joint from the campaign, beside its truth.

    Attributes:
        truth: The joint's small-signal truth.
        estimate: Output-error model of the response to its own command.
        hz: Its bandwidth with the 95 % interval, Hz.
        bare: Bandwidth of the response without a model, likewise: of a smooth curve through its lines, which may err by
            half a percent.
        delay: Samples from a command to the first measurement that shows it, by correlation; -1 where none shows.
    """

    truth: JointTruth
    estimate: Estimate
    hz: Interval
    bare: Interval
    delay: int


@dataclass(frozen=True, eq=False)
class SevenJoints(Locked):
    """The seven-input model: the response of every joint to every command, and what of it is significant.

    Rows are measured, columns commanded joints.

    Attributes:
        approximation: Response with the variance by noise and nonlinear distortion.
        paths: Models of the joints themselves.
        coupling: Gain of every path over the band, with 95 % interval and p-value of "no response".
        true_gain: The same gain of the small-signal truth (7, 7).
        coupled: Whether that truth exceeds `FLOOR` at a line (7, 7).
    """

    approximation: BestLinearTruth
    paths: tuple[SevenJointPath, ...]
    coupling: BandGain
    true_gain: np.ndarray
    coupled: np.ndarray

    @property
    def significant(self) -> np.ndarray:
        """Whether a path is called coupled at `LEVEL` (7, 7)."""
        return np.asarray(self.coupling.p < LEVEL)


def campaign(multisines: Multisines = MULTISINES, *, seed: int | None = None) -> tuple[MultisineExperiment, ...]:
    """Return the experiments: all joints of `SETTING` at once, as many records as joints for each realisation.

    Args:
        multisines: The excitation class.
        seed: Draws phases and noise; the scenario's own when not given.
    """
    setting = load(SETTING, seed=seed)
    return multisine_experiments(setting, replace(multisines, seed=setting.seed))


def identify_every_joint(
    multisines: Multisines = MULTISINES,
    *,
    seed: int | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> SevenJoints:
    """Play the campaign and identify the seven-joint model from it; see `campaign`.

    Args:
        multisines: The excitation class.
        seed: Draws phases and noise.
        progress: Called with the simulated ticks and those in all.

    Raises:
        ScenarioError: An experiment failed.
    """
    experiments = campaign(multisines, seed=seed)
    result = simulate(experiments, progress=progress)
    for name, reason in result.failed.items():
        raise ScenarioError(f"{name}: {reason}")
    return seven_joints(experiments, list(result), physics_seconds=result.physics_seconds)


def seven_joints(
    experiments: Sequence[MultisineExperiment], logs: Sequence[JointLog], *, physics_seconds: float = 0.0
) -> SevenJoints:
    """Identify the seven-joint model from existing records; see `campaign`."""
    origin = {"setting": SETTING, "seed": str(experiments[0].multisines.seed)}
    approximation = approximated(experiments, logs, JOINTS, physics_seconds=physics_seconds, origin=origin)
    response, truth = approximation.servo.response, approximation.small_signal
    band = approximation.bandwidth
    paths = []
    for k, (joint, delay) in enumerate(zip(JOINTS, _delays(logs), strict=True)):
        model = joint_model(response, joint, delay)
        paths.append(SevenJointPath(truth.joint(joint), model, model.bandwidth().path(), band.path(k, k), delay))
    true_gain = np.abs(truth.model.frequency_response(response.frequencies))
    return SevenJoints(
        approximation,
        tuple(paths),
        band_gain(approximation.servo),
        true_gain=np.sqrt((true_gain**2).mean(axis=0)),
        coupled=true_gain.max(axis=0) > FLOOR,
    )


def joint_model(response: FrequencyResponse, joint: str, delay: int) -> Estimate:
    """Output-error model of a joint's response to its own command, of the likeliest of `ORDERS`.

    Models that are slower than the lowest line are left out where others are there: their gain at 0 Hz is anyone's.
    """
    k = JOINTS.index(joint)
    of_joint = response.select(inputs=[k], outputs=[k])
    with warnings.catch_warnings():
        # Orders too high have poorly determined parameters: that is why the criterion chooses.
        warnings.simplefilter("ignore", SysidWarning)
        fits = [sysid.fit_response(of_joint, nb, nf, max(delay, 0), known_variance=False) for nb, nf in ORDERS]
    # Modulus of a real pole whose corner lies at the lowest line.
    slowest = np.exp(-2.0 * np.pi * response.frequencies[0] * response.dt)
    fast_enough = [fit for fit in fits if np.abs(fit.poles()).max() < slowest]
    return min(fast_enough or fits, key=lambda fit: fit.bic)


def _delays(logs: Sequence[JointLog]) -> list[int]:
    """Delay of each joint, samples: first lag at which its angle correlates with its whitened command."""
    # The arm first settles into its pose.
    start = round(SETTLING / logs[0].dt)
    records = [log.iodata(JOINTS)[start:] for log in logs]
    with warnings.catch_warnings():
        # Its test for feedback takes the friction's noise, which the command excites, for some.
        warnings.simplefilter("ignore", SysidWarning)
        return [int(lag) for lag in np.diag(sysid.delayest(records, largest=6, na=0, nb=1).correlation)]
