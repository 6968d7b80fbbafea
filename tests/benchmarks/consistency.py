"""How the error of each method shrinks with the length of the record: a slope of -1/2 is consistency.

The error is the root mean square, over draws and frequencies up to half of Nyquist, of the relative error of the
frequency response.
"""

import sys
import warnings
from dataclasses import replace

import numpy as np

import sysid
from tests.benchmarks.tables import heading, row
from tests.sysid import conftest as problems

LENGTHS = (500, 2000, 8000, 32000)


def errors(problem, fit, draws):
    """Error at each length."""
    of_lengths = []
    for samples in LENGTHS:
        shorter = replace(problem, samples=samples)
        f = np.linspace(0.02, 0.5, 60) * 0.5 / shorter.model.dt
        true = shorter.model.frequency_response(f)
        squares = []
        for seed in range(draws):
            model = fit(shorter.draw(seed)).model
            squares.append(np.mean(np.abs(model.frequency_response(f) / true - 1.0) ** 2))
        of_lengths.append(float(np.sqrt(np.mean(squares))))
    return of_lengths


def main():
    draws = int(sys.argv[1]) if len(sys.argv) > 1 else 20
    warnings.simplefilter("ignore", sysid.SysidWarning)
    p3, p4, p5 = problems.make_p3(), problems.make_p4(), problems.make_p5()
    cases = {
        "arx, in its class": (p5, lambda d: sysid.arx(d, 3, 3, 2)),
        "arx, coloured noise (biased)": (p3, lambda d: sysid.arx(d, 2, 2, 1)),
        "iv4, coloured noise": (p3, lambda d: sysid.iv4(d, 2, 2, 1)),
        "armax": (p3, lambda d: sysid.armax(d, 2, 2, 2, 1)),
        "oe, coloured noise": (p3, lambda d: sysid.oe(d, 2, 2, 1)),
        "bj": (p4, lambda d: sysid.bj(d, 2, 2, 2, 2, 1)),
        "okid, p = 20": (p3, lambda d: sysid.okid(d, 2, p=20)),
        "n4sid": (p3, lambda d: sysid.n4sid(d, 2)),
        "pem_ss": (p3, lambda d: sysid.pem_ss(d, sysid.n4sid(d, 2))),
    }
    heading("method", *(f"N = {n}" for n in LENGTHS), "slope")
    for name, (problem, fit) in cases.items():
        of_lengths = errors(problem, fit, draws)
        slope = np.polyfit(np.log(LENGTHS), np.log(of_lengths), 1)[0]
        row(name, *(f"{100 * e:.3f} %" for e in of_lengths), f"{slope:.2f}")


if __name__ == "__main__":
    main()
