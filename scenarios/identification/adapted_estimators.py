"""Estimators of the toolbox as functions of a record and orders alone: of two steps, of delays in samples."""

from collections.abc import Sequence

from numpy.typing import ArrayLike

import sysid
from scenarios.files.errors import ScenarioError
from sysid import Estimate, IOData, StateSpace
from sysid.models.continuous_estimate import ContinuousEstimate
from sysid.subspace import markov_parameters


def pem_from_n4sid(
    data: IOData | Sequence[IOData], order: int, *, direct: bool = True, start: Estimate | None = None
) -> Estimate:
    """Estimate a state-space model by prediction error, starting from the subspace estimate.

    Args:
        data: One experiment, or several that share the model.
        order: Number of states.
        direct: Whether D is estimated.
        start: Model near the answer, at which the search begins instead, and which needs no others.
    """
    first = start or sysid.n4sid(data, order, direct=direct)
    return sysid.pem_ss(data, first, direct=direct, search=start is None)


def era_of_record(data: IOData, order: int, pulses: int) -> StateSpace:
    """Realise the pulse response of a record, which least squares on past inputs alone gives.

    Args:
        data: The record.
        order: Number of states.
        pulses: Values of the pulse response.

    Returns:
        The model, without a noise model.
    """
    return sysid.era(markov_parameters(data, pulses), order, dt=data.dt).model


ESTIMATED = "estimated"
"""Word in place of a delay that is estimated."""


def tfest_in_samples(
    data: IOData | Sequence[IOData],
    poles: int,
    zeros: int,
    delay: int | str = ESTIMATED,
    *,
    offset: bool = False,
    start: ArrayLike | None = None,
) -> ContinuousEstimate:
    """Fit a continuous-time transfer function whose delay is estimated, or known in samples.

    Args:
        data: One experiment, or several that share the model.
        poles: Degree of the denominator.
        zeros: Degree of the numerator.
        delay: Known delay, samples, or `ESTIMATED`.
        offset: Whether the output has an unknown constant.
        start: Parameters near the answer, at which the search begins.

    Raises:
        ScenarioError: Another word than `ESTIMATED`.
    """
    if isinstance(delay, str) and delay != ESTIMATED:
        raise ScenarioError(f"tfest: delay {delay} given, expected samples, or {ESTIMATED}")
    dt = data.dt if isinstance(data, IOData) else data[0].dt
    seconds = None if isinstance(delay, str) else delay * dt
    return sysid.tfest(data, poles, zeros, delay=seconds, offset=offset, start=start)


def procest_of_kind(
    data: IOData | Sequence[IOData], kind: str, *, offset: bool = False, start: ArrayLike | None = None
) -> ContinuousEstimate:
    """Fit a process model; one with an integrator to the signals as they are, whose state has a constant already."""
    return sysid.procest(data, kind, offset=offset and not integrates(kind), start=start)


def integrates(kind: object) -> bool:
    """Whether a kind of process model has an integrator."""
    return "I" in str(kind).upper()
