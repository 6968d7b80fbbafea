"""How near a prediction-error fit comes to the cost of one least-squares solve of the same size.

Processor time in one process, median of runs taken in turn; the solve is that of as many rows
and columns as the fit has errors and parameters, regressors ready.
"""

import os
import warnings

for variable in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ[variable] = "1"

import numpy as np  # noqa: E402 - BLAS reads its number of threads when it loads
from scipy.signal import lfilter  # noqa: E402

import sysid  # noqa: E402
from sysid.polynomial.orders import make_orders  # noqa: E402
from sysid.polynomial.prediction_error import linearise  # noqa: E402
from tests.benchmarks.tables import heading, row, timed  # noqa: E402
from tests.sysid import conftest as problems  # noqa: E402

ORDERS = (5, 3, 5, 2)


def medians(runs):
    """Processor time of each in ms."""
    times: list[list[float]] = [[] for _ in runs]
    for _ in range(40):
        for run, taken in zip(runs, times, strict=True):
            taken.append(timed(run)[1])
    return [1e3 * float(np.median(taken)) for taken in times]


def main():
    warnings.simplefilter("ignore", sysid.SysidWarning)
    problem = problems.make_p1()
    data = problem.draw(0)
    na, nb, nc, nk = ORDERS
    orders = make_orders(1, na=na, nb=nb, nc=nc, nk=nk)
    estimate = sysid.armax(data, *ORDERS)
    y, u, e = data.y[:, 0], data.u[:, 0], estimate.residuals[:, 0]
    start = max(na, nc, nk + nb)
    signals = [(-y, lag) for lag in range(1, na + 1)]
    signals += [(u, lag) for lag in range(nk, nk + nb)] + [(e, lag) for lag in range(1, nc + 1)]
    phi = np.array([signal[start - lag : len(signal) - lag] for signal, lag in signals]).T.copy()
    target = y[start:]
    fit, step, filtering, solve = medians(
        [
            lambda: sysid.armax(data, *ORDERS),
            lambda: linearise([data], orders, estimate.parameters),
            lambda: lfilter([1.0], estimate.polynomials.C, y),
            lambda: np.linalg.lstsq(phi, target, rcond=None),
        ]
    )
    heading(f"P1, {len(phi)} x {phi.shape[1]}", "processor time, ms", "least-squares solves")
    rows = {
        "numpy.linalg.lstsq": solve,
        "armax": fit,
        "one evaluation of errors and Jacobian": step,
        "one recursive filter over the record": filtering,
    }
    for name, value in rows.items():
        row(name, f"{value:.2f}", f"{value / solve:.2f}")


if __name__ == "__main__":
    main()
