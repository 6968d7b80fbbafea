"""State-space methods that take two steps of the toolbox, as one function of a record and an order."""

from collections.abc import Sequence

import sysid
from sysid import Estimate, IOData, StateSpace
from sysid.subspace import markov_parameters


def pem_from_n4sid(data: IOData | Sequence[IOData], order: int, *, direct: bool = True) -> Estimate:
    """Estimate a state-space model by prediction error, starting from the subspace estimate.

    Args:
        data: One experiment, or several that share the model.
        order: Number of states.
        direct: Whether D is estimated.
    """
    return sysid.pem_ss(data, sysid.n4sid(data, order, direct=direct), direct=direct)


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
