"""One-step prediction errors."""

from numpy.typing import ArrayLike

from sysid.models.estimate import Estimate
from sysid.models.predict import predict
from sysid.models.state_space import StateSpace
from sysid.records.arrays import FloatArray
from sysid.records.data import IOData, as_record


def residuals(model: StateSpace | Estimate, data: IOData, *, x0: ArrayLike | None = None) -> FloatArray:
    """y(t) minus its one-step prediction [Ljung1999, sec. 3.2].

    Args:
        model: The model, or an estimate of it.
        data: Inputs and outputs.
        x0: State at the first sample (n,); None fits it (see `predict`).

    Returns:
        Prediction errors (N, ny).

    Raises:
        SysidError: Channels that do not fit the model.
    """
    return as_record(data).y - predict(model, data, x0=x0)
