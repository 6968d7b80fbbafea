"""Fits to measured data beside the peers, at equal orders.

Run by hand in an environment that has the peers, with a folder that holds the DaISy files [DeMoor1997]:
`python tests/benchmarks/real_data.py FOLDER`. Models are fitted to the first half of each record, mean removed; the
loss is the root mean square of the one-step prediction error there, `held out` the simulation fit to the second half,
both with the initial state fitted for every model alike.
"""

import sys
import warnings
from pathlib import Path

from peers import pysib, silence, sippy  # isort: skip - sets the number of threads before NumPy loads
import numpy as np

import sysid

SETS = {
    "robot arm": ("robot_arm.dat", 0, 1, 1.0),
    "hair dryer": ("hair_dryer.dat", 0, 1, 0.08),
    "heat exchanger": ("heat_exchanger.dat", 1, 2, 1.0),
}
STRUCTURES = {
    "robot arm": (("armax", (4, 4, 4, 1)), ("oe", (4, 4, 1))),
    "hair dryer": (("armax", (2, 2, 2, 3)), ("oe", (2, 2, 3))),
    "heat exchanger": (("armax", (2, 2, 2, 1)), ("oe", (2, 2, 1))),
}


def scores(p: sysid.Polynomials, first: sysid.IOData, second: sysid.IOData) -> str:
    """One-step loss on the first half, simulation fit to the second."""
    model = sysid.innovations_form(p, first.dt)
    predictor = np.abs(np.linalg.eigvals(model.A - model.gain @ model.C)).max(initial=0.0)
    if predictor >= 1.0:
        return f"unstable predictor, radius {predictor:.3f} | "
    error = float(np.sqrt(np.mean(sysid.residuals(model, first) ** 2)))
    (fit,) = sysid.compare(model, second)
    return f"{error:.6g} | {float(fit.simulation[0]):.2f} %"


def main() -> None:
    """Fit all and write a table."""
    folder = Path(sys.argv[1])
    warnings.simplefilter("ignore")
    print("| data | structure | method | one-step loss | held out, simulation fit |\n|---|---|---|---|---|")
    for name, (file, input_column, output_column, dt) in SETS.items():
        table = np.loadtxt(folder / file)
        half = len(table) // 2
        u, y = table[:, input_column], table[:, output_column]
        u1, y1 = u[:half] - u[:half].mean(), y[:half] - y[:half].mean()
        u2, y2 = u[half:] - u[:half].mean(), y[half:] - y[:half].mean()
        for method, orders in STRUCTURES[name]:
            data, second = sysid.IOData(u1, y1, dt), sysid.IOData(u2, y2, dt)
            fits = {"this package": getattr(sysid, method)(data, *orders).polynomials}
            for peer, make in (("pysib", pysib), ("sippy-unipi", sippy)):
                try:
                    with silence(), np.errstate(all="ignore"):
                        fits[peer] = make(method, orders)(u1, y1)
                except Exception as error:
                    print(f"| {name} | {method} {orders} | {peer} | failed: {type(error).__name__} | |")
            for who, p in fits.items():
                with np.errstate(all="ignore"):
                    print(f"| {name} | {method} {orders} | {who} | {scores(p, data, second)} |")


if __name__ == "__main__":
    main()
