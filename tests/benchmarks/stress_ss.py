"""Random multivariable systems on short records: does `pem_ss` converge, and to the best of several minima?

Systems have order 2 to 6, 1 to 3 inputs and outputs, poles up to 0.985, binary inputs held for 1, 2 or 5 samples, and
disturbances through the gain of a Kalman filter, 5 to 20 dB below the outputs; records 200 to 500 samples. A fit from
the default `n4sid` counts as off where N (V - V*) > 20, V the logarithm of the determinant of the errors' covariance
and V* the least that was reached from n4sid with other horizons, from OKID and from the truth.
"""

import warnings
from time import perf_counter

import numpy as np
from scipy.linalg import block_diag, solve_discrete_are

import sysid
from tests.benchmarks.stress import BURN_IN, OFF, summary
from tests.benchmarks.tables import options, timed
from tests.sysid.systems import random_roots

SYSTEMS = 200


def draw_system(rng, order, nu, ny):
    """Modes of random size; the gain is that of a Kalman filter for disturbances of states and outputs."""
    blocks = [
        np.array([[root.real, -root.imag], [root.imag, root.real]]) if np.iscomplex(root) else np.array([[root]])
        for root in random_roots(rng, order, 0.985)
    ]
    A = block_diag(*blocks)
    B, C = rng.standard_normal((order, nu)), rng.standard_normal((ny, order))
    half = rng.uniform(0.1, 1.0) * rng.standard_normal((order, order))
    P = solve_discrete_are(A.T, C.T, half @ half.T, order * np.eye(ny))
    S = C @ P @ C.T + order * np.eye(ny)
    return sysid.StateSpace(A, B, C, np.zeros((ny, nu)), A @ P @ C.T @ np.linalg.inv(S), 1.0, S)


def make_case(seed):
    """Draw a system and a record of it in steady state; return the record and the system."""
    rng = np.random.default_rng(seed)
    truth = draw_system(rng, int(rng.integers(2, 7)), int(rng.integers(1, 4)), int(rng.integers(1, 4)))
    total = int(rng.integers(200, 501)) + BURN_IN
    hold, snr_db = int(rng.choice([1, 2, 5])), rng.uniform(5.0, 20.0)
    u = np.column_stack([np.repeat(rng.choice([-1.0, 1.0], -(-total // hold)), hold)[:total] for _ in range(truth.nu)])
    e = rng.standard_normal((total, truth.ny)) @ np.linalg.cholesky(np.asarray(truth.innovation_covariance)).T
    clean = sysid.simulate(truth, u)[BURN_IN:]
    disturbance = sysid.StateSpace(truth.A, truth.gain, truth.C, np.eye(truth.ny), None, 1.0)
    v = sysid.simulate(disturbance, e)[BURN_IN:]
    v *= np.sqrt(np.mean(clean**2) / np.mean(v**2)) / 10 ** (snr_db / 20)
    return sysid.IOData(u[BURN_IN:], clean + v, 1.0), truth


def loss(estimate):
    """Logarithm of the determinant of the errors' covariance."""
    e = estimate.residuals
    return float(np.linalg.slogdet(e.T @ e / len(e))[1])


def other_fits(data, truth):
    """From other beginnings."""
    order = truth.order
    most = len(data) // (2 * (data.nu + data.ny) + 3)
    starts = [lambda: truth, lambda: sysid.okid(data, order, p=min(10, max(3, most // 2)))]
    starts += [
        lambda rows=rows: sysid.n4sid(data, order, block_rows=rows)
        for rows in (order // data.ny + 2, 8, 12, 20)
        if order // data.ny + 1 < rows <= most
    ]
    for start in starts:
        try:
            yield sysid.pem_ss(data, start(), search=False, max_iterations=200)
        except sysid.SysidError:
            continue


def measure():
    """Fit every system and compare with the best of the other fits."""
    fits, steps = [], []
    for seed in range(SYSTEMS):
        data, truth = make_case(seed)
        start = sysid.n4sid(data, truth.order)
        estimate, seconds = timed(sysid.pem_ss, data, start, clock=perf_counter)
        m = estimate.model
        others = [loss(other) for other in other_fits(data, truth) if other.model.order == m.order]
        distance = len(data) * (loss(estimate) - min([loss(estimate), *others]))
        fits.append({"distance": distance, "seconds": seconds, "converged": estimate.diagnostics["converged"]})
        fits[-1]["lower order given"] = m.order < truth.order
        fits[-1]["at the edge of stability"] = np.abs(np.linalg.eigvals(m.A - m.gain @ m.C)).max() > 1.0 - 1e-4
        steps.append(estimate.diagnostics["iterations"])
        if distance > OFF or not estimate.diagnostics["converged"]:
            sizes = f"order {m.order}, {m.nu} inputs, {m.ny} outputs, N = {len(data)}"
            print(f"system {seed}: {sizes}, distance {distance:.4g}, {estimate.diagnostics['reason']}", flush=True)
    return {**summary(fits), "median iterations": float(np.median(steps))}


def main():
    options(__doc__).parse_args()
    warnings.simplefilter("ignore", sysid.SysidWarning)
    for figure, value in measure().items():
        print(f"K free  {figure:26s}{value:10.4g}", flush=True)


if __name__ == "__main__":
    main()
