"""The exchange of the replacement unit: how far the arm goes from its operating point, and fits phase by phase."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

import sysid
from hmtb_twin import JOINTS, STUDIED_JOINTS, JointLog, Status
from scenarios.experiments.campaign import RPCM, Campaign
from scenarios.experiments.log_review import SETTLING
from scenarios.experiments.rpcm import rpcm_outcome
from sysid import StateSpace


@dataclass(frozen=True)
class Phase:
    """Part of the exchange.

    Attributes:
        name: What is done.
        start: Its start in the log, s.
        end: Its end, s.
        loaded: Share of it in which the unit is in the end effector.
        swing: Half of the measured angle's range by joint, rad.
        simulation: By model and joint, root mean square of the simulation's error, rad.
        one_step: By model and joint, root mean square of the one-step prediction's error, rad.
    """

    name: str
    start: float
    end: float
    loaded: float
    swing: Mapping[str, float]
    simulation: Mapping[str, Mapping[str, float]]
    one_step: Mapping[str, Mapping[str, float]]


@dataclass(frozen=True)
class Exchange:
    """Differences of the exchange from the experiments that models are identified from.

    Attributes:
        departure: Largest distance of each of the seven joints from the operating point, rad.
        loaded: Share of the record in which the unit is in the end effector.
        phases: Those that came to their end, in order.
    """

    departure: Mapping[str, float]
    loaded: float
    phases: tuple[Phase, ...]


def exchange(campaign: Campaign, models: Mapping[str, StateSpace]) -> Exchange:
    """Take the exchange apart.

    Within a phase the joints move little as a rule, so that a fit in percent would compare errors with next to nothing:
    errors are given in rad.

    Args:
        campaign: The records.
        models: Models of the studied joints, by name.

    Returns:
        Departure from the operating point and errors by phase; each model runs through the whole record at once.

    Raises:
        MissingRecordError: There is no record of the exchange.
    """
    log, data = campaign.log(RPCM), campaign.several(RPCM)
    fits = dict(zip(models, sysid.compare(models, data), strict=True))
    skipped = len(log) - len(data)
    held = (log.status[skipped:] & Status.UNIT_HELD) > 0
    phases = []
    for name, (start, end) in rpcm_outcome(log).phases.items():
        part = slice(max(round(start / log.dt) - skipped, 0), round(end / log.dt) - skipped)
        if part.stop - part.start < 2:
            continue
        phases.append(
            Phase(
                name,
                start,
                end,
                float(held[part].mean()),
                _by_joint(0.5 * np.ptp(data.y[part], axis=0)),
                {key: _by_joint(_rms(data.y[part] - fit.simulated[part])) for key, fit in fits.items()},
                {key: _by_joint(_rms(data.y[part] - fit.predicted[part])) for key, fit in fits.items()},
            )
        )
    return Exchange(_departure(log, campaign), float(held.mean()), tuple(phases))


def _departure(log: JointLog, campaign: Campaign) -> dict[str, float]:
    """From the pose that the truth is linearised at."""
    away = np.abs(log.true_angles[round(SETTLING / log.dt) :] - campaign.truth.angles).max(axis=0)
    return dict(zip(JOINTS, map(float, away), strict=True))


def _rms(errors: np.ndarray) -> np.ndarray:
    return np.asarray(np.sqrt(np.mean(errors**2, axis=0)))


def _by_joint(values: np.ndarray) -> dict[str, float]:
    return dict(zip(STUDIED_JOINTS, map(float, values), strict=True))
