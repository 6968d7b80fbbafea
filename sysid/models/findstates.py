"""The initial state of a model on data."""

import numpy as np

from sysid.models.estimate import Estimate
from sysid.models.predict import initial_state
from sysid.models.simulate import as_model
from sysid.models.state_space import StateSpace
from sysid.records.arrays import FloatArray
from sysid.records.data import IOData


def findstates(model: StateSpace | Estimate, data: IOData, *, simulation: bool = False) -> FloatArray:
    """State at the first sample for which the model explains the data best, by least squares [Ljung1999, sec. 10.5].

    The result serves as `x0` of `simulate`, `predict` and `residuals`.

    Args:
        model: The model, or an estimate of it.
        data: Inputs and outputs; with an initialisation window only that is looked at.
        simulation: Whether the simulated output is to fit; otherwise the one-step prediction.

    Returns:
        State (n,), of least norm where the data do not determine it.

    Raises:
        SysidError: Channels that do not fit the model.
    """
    m = as_model(model)
    return initial_state(m, data, np.zeros_like(m.gain) if simulation else None)
