"""One-step prediction errors."""

from numpy.typing import ArrayLike

from sysid.arrays import FloatArray
from sysid.data import IOData, as_record
from sysid.estimate import Estimate
from sysid.predict import predict
from sysid.state_space import StateSpace


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
