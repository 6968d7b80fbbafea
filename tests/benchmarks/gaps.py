"""Efficiency, coverage and time of fits to records with missing outputs.

A quarter of the outputs of the problems of `efficiency.py`, cut to 2500 samples, is lost: sample by sample, or in
bursts of 20 on average. Per problem: the mean of error' J error / p with J the Fisher information of the outputs that
are left (1 is the Cramer-Rao bound); the coverage of nominal 95 % intervals of the parameters; the mean of the variance
found over the true one; runs that did not converge; the median time over that of the complete record.

State-space models have local parameters: there the first figure is the square of the error of |H| (ss1: the model of
p3, ss2: two outputs that lose different samples) in units of its standard deviation, and the coverage that of |G| and
of |H|, over a quarter as many draws.
"""

import sys
from time import perf_counter

import numpy as np
from scipy.linalg import solve_triangular, toeplitz
from scipy.signal import lfilter

import sysid
from scenarios.problems.registry import problem
from sysid.models.delta_method import spread
from sysid.polynomial.structures import layout
from tests.benchmarks.efficiency import STRUCTURES
from tests.benchmarks.tables import heading, row, timed
from tests.sysid.systems import CORRELATED_OUTPUTS, bursts_of_loss, losing, parameters_covered

SAMPLES = 2500
STEP = 1e-5


def holes(seed, shape, bursts):
    rng = np.random.default_rng(70_000 + seed)
    return bursts_of_loss(rng, *shape) if bursts else rng.random(shape) < 0.25


def information(system, known):
    """Fisher information of the parameters in the known outputs, from their joint normal distribution alone.

    Mean and covariance are differentiated numerically. The variance of the innovation is unknown too, and eliminated.
    """
    orders = layout(system.structure, system.task(None).orders)
    pulse = np.zeros(20_000)
    pulse[0] = 1.0

    def moments(theta):
        moved = orders.polynomials(theta)
        response = lfilter(moved.C, np.convolve(moved.A, moved.D), pulse)
        products = np.fft.irfft(np.abs(np.fft.rfft(response, 2 * len(pulse))) ** 2)[:SAMPLES]
        output = lfilter(moved.B, np.convolve(moved.A, moved.F), system.reference[:, 0])
        return output[-SAMPLES:][known], products

    theta = system.bound(None).parameters
    root = np.linalg.cholesky(toeplitz(moments(theta)[1])[np.ix_(known, known)])
    means, spreads = [], []
    for i in range(len(theta)):
        step = STEP * np.eye(1, len(theta), i)[0]
        ends = [moments(theta + s * step) for s in (1.0, -1.0)]
        mean, products = ((up - down) / (2.0 * STEP) for up, down in zip(*ends, strict=True))
        means.append(solve_triangular(root, mean, lower=True))
        moved = toeplitz(products)[np.ix_(known, known)]
        if moved.any():
            moved = solve_triangular(root, solve_triangular(root, moved, lower=True).T, lower=True)
        spreads.append(moved)
    by_mean = np.array(means) @ np.array(means).T / system.variance
    by_spread = np.array([[np.vdot(a, b) for b in spreads] for a in spreads])
    traces = np.array([np.trace(a) for a in spreads])
    return by_mean + 0.5 * by_spread - 0.5 * np.outer(traces, traces) / known.sum()


def polynomial_draws(system, estimator, orders, draws, bursts):
    """Figures of a polynomial model in each noise realisation; the same samples are lost in all."""
    lost = holes(0, (SAMPLES,), bursts)
    bound, truth = information(system, ~lost), system.bound(None).parameters
    for seed in range(draws):
        data = system.draw(seed)
        _, whole = timed(estimator, data, *orders, clock=perf_counter)
        estimate, gapped = timed(estimator, losing(data, lost), *orders, clock=perf_counter)
        error = estimate.parameters - truth
        covered = np.mean(parameters_covered(estimate, truth))
        variance = estimate.noise_variance[0, 0] / system.variance
        failed = not estimate.diagnostics["converged"]
        yield error @ bound @ error / len(error), covered, variance, failed, gapped / whole


def state_space_draws(model, draws, bursts):
    """Figures of `pem_ss` in each noise realisation."""
    ny, f = model.ny, np.array([0.02, 0.1, 0.3, 0.6]) * 0.5 / model.dt

    def size(of):
        return np.abs(np.concatenate((of.frequency_response(f), of.noise_response(f)), axis=2))

    truth = size(model)
    inputs, direct = np.hstack((model.B, model.gain)), np.hstack((model.D, np.eye(ny)))
    joint = sysid.StateSpace(model.A, inputs, model.C, direct, None, model.dt)
    for seed in range(draws):
        rng = np.random.default_rng(seed)
        e = rng.multivariate_normal(np.zeros(ny), model.innovation_covariance, SAMPLES)
        u = rng.standard_normal((SAMPLES, model.nu))
        data = sysid.IOData(u, sysid.simulate(joint, np.hstack((u, e))), model.dt)
        _, whole = timed(sysid.pem_ss, data, model, clock=perf_counter)
        lost = holes(seed, (SAMPLES,), True)[:, None] if bursts else holes(seed, (SAMPLES, ny), False)
        gapped_data = losing(data, np.broadcast_to(lost, data.y.shape))
        estimate, gapped = timed(sysid.pem_ss, gapped_data, model, clock=perf_counter)
        moves = spread(lambda theta: size(estimate.realise(theta)), estimate.parameters, estimate.covariance)  # noqa: B023
        relative = (size(estimate.model) - truth) / np.sqrt(np.sum(moves**2, axis=0))
        variance = np.mean(np.diag(estimate.noise_variance) / np.diag(model.innovation_covariance))
        failed = not estimate.diagnostics["converged"]
        error = np.mean(relative[:, :, model.nu :] ** 2)
        yield error, np.mean(np.abs(relative) <= 1.96), variance, failed, gapped / whole


def print_row(name, lost, draws):
    errors, covered, variances, failed, ratios = zip(*draws, strict=True)
    numbers = np.mean(errors), np.std(errors) / np.sqrt(len(errors)), np.mean(covered), np.mean(variances)
    row(name, lost, *(f"{number:.3f}" for number in numbers), sum(failed), f"{np.median(ratios):.0f}")


def main():
    draws = int(sys.argv[1]) if len(sys.argv) > 1 else 400
    models = {"ss1": problem("p3").truth, "ss2": CORRELATED_OUTPUTS}
    errors = ("squared error", "its standard error", "coverage", "variance")
    heading("problem", "lost", *errors, "not converged", "time")
    lost = {"at random": False, "bursts": True}
    for name, (estimator, orders) in list(STRUCTURES.items())[:4]:
        system = problem(f"{name}@{SAMPLES}")
        for how, bursts in lost.items():
            print_row(f"{name} {estimator.__name__}", how, polynomial_draws(system, estimator, orders, draws, bursts))
    for name, model in models.items():
        for how, bursts in lost.items():
            print_row(f"{name} pem_ss", how, state_space_draws(model, max(draws // 4, 2), bursts))


if __name__ == "__main__":
    main()
