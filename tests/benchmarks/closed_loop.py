"""Identification in a loop: accuracy against the Cramer-Rao bound, bias, coverage and time.

Records of 500 samples in the loop u = r - k y, with r and e white. Per estimator: mean square error of the frequency
response at 20 frequencies relative to the bound of the true structure, mean over these; the part of the error that is
bias; coverage of nominal 95 % intervals of the parameters of the path from u to y, where there are such; median
processor time. PARSIM-K of SIPPY is among them where `sippy_unipi` is installed.
"""

import warnings
from importlib.util import find_spec

import numpy as np

import sysid
from sysid import Polynomials
from sysid.models import innovations_form
from sysid.polynomial.orders import Orders
from sysid.validation import cramer_rao_bound
from tests.benchmarks.tables import heading, options, row, timed
from tests.sysid.systems import in_feedback

HZ, SAMPLES, SETTLE = np.linspace(0.1, 4.9, 20), 500, 200
GENERAL = Polynomials(A=[1, -1.2, 0.6], B=[0, 1, 0.5], C=[1, 0.4], D=[1, 0.7], F=[1, -0.8])
ARMAX = Polynomials(A=[1, -1.5, 0.7], B=[0, 1, 0.5], C=[1, -0.6, 0.3])
BOX_JENKINS = Polynomials(B=[0, 0.5, 0.3], F=[1, -1.2, 0.5], C=[1, 0.3], D=[1, -0.8])


def delayed(r):
    """The reference as instruments for output and input."""
    return np.column_stack((np.r_[0, 0, r[:-2]], r))


def parsim(data, *_):
    """State space by PARSIM-K of SIPPY."""
    from scenarios.estimators.state_space_peers import sippy_n4sid
    from scenarios.estimators.task import Task

    return sippy_n4sid(data, Task("ss", {"order": 2}, 2, HZ), weighting="PARSIM-K")


# estimators of a record, its reference, and the signals of the loop without disturbance
CASES = {
    "A, B, C, D, F": (
        GENERAL,
        0.1,
        {
            "polyest": lambda d, r, x: sysid.polyest(d, 2, 2, 1, 1, 1),
            "pbsid, order 5": lambda d, r, x: sysid.pbsid(d, 5),
            "n4sid, order 5": lambda d, r, x: sysid.n4sid(d, 5, direct=False),
        },
    ),
    "ARMAX": (
        ARMAX,
        0.5,
        {
            "armax": lambda d, r, x: sysid.armax(d, 2, 2, 2),
            "ivx, x simulated": lambda d, r, x: sysid.ivx(d, 2, 2, 1, x),
            "ivx, x = r": lambda d, r, x: sysid.ivx(d, 2, 2, 1, delayed(r)),
            "iv4": lambda d, r, x: sysid.iv4(d, 2, 2),
            "pbsid": lambda d, r, x: sysid.pbsid(d, 2),
            "pem_ss from pbsid": lambda d, r, x: sysid.pem_ss(d, sysid.pbsid(d, 2), direct=False),
            "okid, p = 10": lambda d, r, x: sysid.okid(d, 2, p=10, direct=False),
            "n4sid": lambda d, r, x: sysid.n4sid(d, 2, direct=False),
            **({"PARSIM-K (SIPPY)": parsim} if find_spec("sippy_unipi") else {}),
        },
    ),
    "Box-Jenkins": (
        BOX_JENKINS,
        0.5,
        {
            "bj": lambda d, r, x: sysid.bj(d, 2, 1, 1, 2),
            "two_stage": lambda d, r, x: sysid.two_stage(d, 2, 2, 1, r),
            "oe": lambda d, r, x: sysid.oe(d, 2, 2),
        },
    ),
}


def measured(truth, gain, noise, estimator, draws):
    """Error over the bound, share of bias, coverage, and time in ms."""
    g = innovations_form(truth, 0.1).frequency_response(HZ)[:, 0, 0]
    _, r = in_feedback(0, SAMPLES + SETTLE, gain=gain, truth=truth)
    bound = cramer_rao_bound(
        truth, Orders.of(truth), r[:, None], dt=0.1, variance=noise**2, frequencies=HZ, feedback=gain, burn_in=SETTLE
    )
    least = np.trace(bound.response_covariance[:, 0, 0], axis1=1, axis2=2)
    true = dict(zip(Orders.of(truth).names, bound.parameters, strict=True))
    errors, hits, times = [], [], []
    for seed in range(draws):
        data, r = in_feedback(seed, SAMPLES, noise, gain=gain, truth=truth)
        clean, _ = in_feedback(seed, SAMPLES, 0.0, gain=gain, truth=truth)
        estimate, seconds = timed(estimator, data, r, np.hstack((clean.y, clean.u)))
        times.append(seconds)
        errors.append(estimate.model.frequency_response(HZ)[:, 0, 0] - g)
        if hasattr(estimate, "covariance") and estimate.polynomials is not None:
            spreads = 1.96 * np.sqrt(np.diag(estimate.covariance))
            names = estimate.parameter_names
            path = [k for k, name in enumerate(names) if name in true and name[0] in "abf"]
            hits.append([abs(estimate.parameters[k] - true[names[k]]) <= spreads[k] for k in path])
    squares = np.mean(np.abs(errors) ** 2, axis=0)
    bias = np.mean(np.abs(np.mean(errors, axis=0)) ** 2 / squares)
    return np.mean(squares / least), bias, np.mean(hits) if hits else np.nan, 1e3 * np.median(times)


if __name__ == "__main__":
    parser = options(__doc__)
    parser.add_argument("draws", nargs="?", type=int, default=500, help="records per estimator")
    draws = parser.parse_args().draws
    warnings.simplefilter("ignore", sysid.SysidWarning)
    heading("true structure", "estimator", "error / bound", "bias / error", "coverage", "ms")
    for name, (truth, gain, estimators) in CASES.items():
        for title, estimator in estimators.items():
            error, bias, coverage, time = measured(truth, gain, 0.5, estimator, draws)
            hits = "" if np.isnan(coverage) else f"{coverage:.3f}"
            row(name, title, f"{error:.3g}", f"{bias:.2f}", hits, f"{time:.1f}")
