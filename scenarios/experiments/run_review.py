"""Review of a simulated experiment: clipping, velocity limit, inputs, task, shutdowns, and warnings."""

from dataclasses import dataclass

import numpy as np

from hmtb_twin import JointLog, Status
from hmtb_twin.bus.shutdown_intervals import ShutdownInterval, shutdown_intervals
from hmtb_twin.control.data_acquisition import BOARD
from scenarios.experiments.excitation_computer import MISSES_POINTS
from scenarios.experiments.joint_inputs import JointInputs, settled_inputs
from scenarios.experiments.log_review import velocity_limited_share
from scenarios.experiments.preview import deadband_warning
from scenarios.experiments.rpcm import RpcmOutcome, rpcm_outcome
from scenarios.experiments.scenario import Scenario


@dataclass(frozen=True, eq=False)
class RunReview:
    """Review of one log.

    Attributes:
        clipped: Share of the samples in which a converter clips, between 0 and 1.
        velocity_limited: Share of the samples at a joint's velocity limit, between 0 and 1.
        inputs: How independently several joints are commanded; None with fewer.
        task: Outcome of an operator's task; None without one.
        shutdowns: Stretches without power.
        warnings: Sentences for whoever uses the log.
    """

    clipped: float
    velocity_limited: float
    inputs: JointInputs | None
    task: RpcmOutcome | None
    shutdowns: tuple[ShutdownInterval, ...]
    warnings: tuple[str, ...]


def review(log: JointLog, scenario: Scenario) -> RunReview:
    """Review a log."""
    beyond = BOARD.exceeds_range(scenario.requested_volts()).any(axis=1)
    clipped = float(np.mean(beyond | ((log.status & Status.CONVERTER_SATURATED) != 0)))
    inputs = settled_inputs(log.commanded, scenario)
    task = rpcm_outcome(log) if scenario.task == "rpcm" else None
    warnings = [
        f"{100 * clipped:.2g} % of the samples stand at an end of a converter's range, whatever the excitation asked "
        "for; a smaller amplitude avoids it"
        if clipped > 0
        else None,
        inputs.warning() if inputs else None,
        MISSES_POINTS if any(excitation.misses_points for excitation in scenario.excitation) else None,
        deadband_warning(scenario),
        task.warning() if task else None,
    ]
    return RunReview(
        clipped,
        velocity_limited_share(log),
        inputs,
        task,
        shutdown_intervals(log),
        tuple(text for text in warnings if text),
    )
