"""An estimator for the test bench in Python: ARX by least squares, NumPy alone.

hmtb verify docs/examples/arx_estimator.py:estimate
"""

import numpy as np

import sysid
from scenarios.estimators.task import Task


def estimate(data: sysid.IOData, task: Task) -> tuple[sysid.Polynomials, np.ndarray]:
    """A y = B u + e of the orders asked; polynomials and the covariance of their parameters (p, p)."""
    if task.structure != "arx" or task.chooses or data.nu != 1 or data.ny != 1:
        raise NotImplementedError("ARX of one input and one output, of the orders asked")
    na, nb, nk = (task.orders[name] for name in ("na", "nb", "nk"))
    u, y = data.u[:, 0], data.y[:, 0]
    first = max(na, nb + nk - 1)
    past_y = [-y[first - k : len(y) - k] for k in range(1, na + 1)]
    past_u = [u[first - k : len(u) - k] for k in range(nk, nk + nb)]
    regressors, now = np.column_stack(past_y + past_u), y[first:]
    theta, *_ = np.linalg.lstsq(regressors, now, rcond=None)
    errors = now - regressors @ theta
    variance = errors @ errors / (len(now) - len(theta))
    covariance = variance * np.linalg.inv(regressors.T @ regressors)
    polynomials = sysid.Polynomials(A=[1.0, *theta[:na]], B=[*np.zeros(nk), *theta[na:]])
    return polynomials, covariance
