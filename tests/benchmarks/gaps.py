"""Efficiency, coverage and time of fits to records with missing outputs.

Run by hand from the root of the repository: `PYTHONPATH=. python tests/benchmarks/gaps.py 400`.

A quarter of the outputs of the problems of `efficiency.py`, cut to 2500 samples, is lost: sample by sample, or in
bursts of 20 on average. Per problem: the mean of error' J error / p with J the Fisher information of the outputs that
are left (1 is the Cramer-Rao bound); the coverage of nominal 95 % intervals of the parameters; the mean of the variance
found over the true one; runs that did not converge; the median time over that of the complete record.

State-space models have local parameters: there the first figure is the square of the error of |H| (ss1: the model of
p3, ss2: two outputs that lose different samples) in units of its standard deviation, and the coverage that of |G| and
of |H|, over a quarter as many draws.
"""

import sys
import time
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import solve_triangular, toeplitz
from scipy.signal import lfilter

import sysid
from sysid.models.delta_method import spread
from tests.sysid import conftest as problems

Array = NDArray[np.float64]
SAMPLES = 2500
STEP = 1e-5
FREQUENCIES = np.array([0.02, 0.1, 0.3, 0.6]) * 0.5


def holes(seed: int, shape: tuple[int, ...], bursts: bool) -> NDArray[np.bool_]:
    """Which samples are lost."""
    rng = np.random.default_rng(70_000 + seed)
    if not bursts:
        return rng.random(shape) < 0.25
    out, t = np.zeros(shape, dtype=bool), 0
    while t < len(out):
        t += rng.geometric(1 / 60)
        length = rng.geometric(1 / 20)
        out[t : t + length] = True
        t += length
    return out


def lose(data: sysid.IOData, lost: NDArray[np.bool_]) -> sysid.IOData:
    """Take outputs away."""
    y = data.y.copy()
    y[lost] = np.nan
    return replace(data, y=y, missing=True)


def information(problem: Any, known: NDArray[np.bool_]) -> Array:
    """Fisher information of the parameters in the known outputs, from their joint normal distribution alone.

    Mean and covariance are differentiated numerically. The variance of the innovation is unknown too, and eliminated.
    """
    sizes = np.cumsum([len(problem.A) - 1, len(problem.B) - problem.nk, len(problem.C) - 1, len(problem.D) - 1])
    pulse = np.zeros(20_000)
    pulse[0] = 1.0

    def moments(theta: Array) -> tuple[Array, Array]:
        parts = np.split(theta, sizes)
        a, c, d, f = (np.concatenate(([1.0], parts[i])) for i in (0, 2, 3, 4))
        moved = replace(problem, A=a, B=np.concatenate((np.zeros(problem.nk), parts[1])), C=c, D=d, F=f)
        response = lfilter(c, np.convolve(a, d), pulse)
        products = np.fft.irfft(np.abs(np.fft.rfft(response, 2 * len(pulse))) ** 2)[: problem.samples]
        return moved.noise_free[-problem.samples :][known], products

    theta = problem.parameters
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
    by_mean = np.array(means) @ np.array(means).T / problem.variance
    by_spread = np.array([[np.vdot(a, b) for b in spreads] for a in spreads])
    traces = np.array([np.trace(a) for a in spreads])
    return by_mean + 0.5 * by_spread - 0.5 * np.outer(traces, traces) / known.sum()


def seconds(run: Callable[[], Any]) -> tuple[Any, float]:
    """What it returns, and how long it takes."""
    begin = time.perf_counter()
    out = run()
    return out, time.perf_counter() - begin


def polynomial_figures(problem: Any, estimator: Any, orders: tuple[int, ...], draws: int, bursts: bool) -> list[float]:
    """Run a polynomial model over noise realisations; the same samples are lost in all."""
    lost = holes(0, (problem.samples,), bursts)
    bound = information(problem, ~lost)
    errors, covered, variances, ratios, failed = [], [], [], [], 0
    for seed in range(draws):
        data = problem.draw(seed)
        _, whole = seconds(lambda: estimator(data, *orders))  # noqa: B023
        found, gapped = seconds(lambda: estimator(lose(data, lost), *orders))  # noqa: B023
        error = found.parameters - problem.parameters
        errors.append(error @ bound @ error / len(error))
        covered.append(np.mean(np.abs(error) <= 1.96 * np.sqrt(np.diag(found.covariance))))
        variances.append(found.noise_variance[0, 0] / problem.variance)
        ratios.append(gapped / whole)
        failed += not found.diagnostics["converged"]
    return _figures(errors, covered, variances, ratios, failed)


def state_space_figures(model: sysid.StateSpace, draws: int, bursts: bool) -> list[float]:
    """Run `pem_ss` over noise realisations."""
    ny, f = model.ny, FREQUENCIES / model.dt

    def size(of: sysid.StateSpace) -> Array:
        return np.abs(np.concatenate((of.frequency_response(f), of.noise_response(f)), axis=2))

    truth = size(model)
    errors, covered, variances, ratios, failed = [], [], [], [], 0
    for seed in range(draws):
        rng = np.random.default_rng(seed)
        e = rng.multivariate_normal(np.zeros(ny), model.innovation_covariance, SAMPLES)
        u = rng.standard_normal((SAMPLES, model.nu))
        joint = sysid.StateSpace(
            model.A, np.hstack((model.B, model.gain)), model.C, np.hstack((model.D, np.eye(ny))), None, model.dt
        )
        data = sysid.IOData(u, sysid.simulate(joint, np.hstack((u, e))), model.dt)
        _, whole = seconds(lambda: sysid.pem_ss(data, model))  # noqa: B023
        lost = holes(seed, (SAMPLES,), True)[:, None] if bursts else holes(seed, (SAMPLES, ny), False)
        found, gapped = seconds(lambda: sysid.pem_ss(lose(data, np.broadcast_to(lost, data.y.shape)), model))  # noqa: B023
        moves = spread(lambda theta: size(found.realise(theta)), found.parameters, found.covariance)  # noqa: B023
        relative = (size(found.model) - truth) / np.sqrt(np.sum(moves**2, axis=0))
        errors.append(np.mean(relative[:, :, model.nu :] ** 2))
        covered.append(np.mean(np.abs(relative) <= 1.96))
        variances.append(np.mean(np.diag(found.noise_variance) / np.diag(model.innovation_covariance)))
        ratios.append(gapped / whole)
        failed += not found.diagnostics["converged"]
    return _figures(errors, covered, variances, ratios, failed)


def _figures(*lists: Any) -> list[float]:
    errors, covered, variances, ratios, failed = lists
    standard = float(np.std(errors) / np.sqrt(len(errors)))
    means = [float(np.mean(part)) for part in (errors, covered, variances)]
    return [means[0], standard, *means[1:], failed, float(np.median(ratios))]


def main() -> None:
    """Measure all and write a row each."""
    draws = int(sys.argv[1]) if len(sys.argv) > 1 else 400
    plan = {
        "p1": (sysid.armax, (5, 3, 5, 2)),
        "p2": (sysid.oe, (2, 2, 1)),
        "p3": (sysid.armax, (2, 2, 2, 1)),
        "p4": (sysid.bj, (2, 2, 2, 2, 1)),
    }
    two = sysid.StateSpace(
        np.array([[0.9, 0.2], [-0.2, 0.7]]),
        np.array([[1.0], [0.3]]),
        np.array([[1.0, 0.0], [0.3, 1.0]]),
        np.array([[0.0], [0.2]]),
        np.array([[0.6, 0.1], [-0.2, 0.3]]),
        0.1,
        np.array([[1.0, 0.5], [0.5, 1.0]]),
    )
    models = {"ss1": problems.make_p3().model, "ss2": two}
    write = sys.stdout.write
    write("| problem | lost | squared error | its standard error | coverage | variance | not converged | time |\n")
    write("|---|---|---|---|---|---|---|---|\n")
    rows: list[tuple[str, Callable[[bool], list[float]]]] = []
    for name, (estimator, orders) in plan.items():
        problem = replace(getattr(problems, f"make_{name}")(), samples=SAMPLES)
        rows.append(
            (
                f"{name} {estimator.__name__}",
                lambda bursts, p=problem, e=estimator, o=orders: polynomial_figures(p, e, o, draws, bursts),
            )
        )
    for name, model in models.items():
        rows.append((f"{name} pem_ss", lambda bursts, m=model: state_space_figures(m, max(draws // 4, 2), bursts)))
    for name, figures in rows:
        for bursts in (False, True):
            error, standard, coverage, variance, failed, ratio = figures(bursts)
            how = "bursts" if bursts else "at random"
            write(
                f"| {name} | {how} | {error:.3f} | {standard:.3f} | {coverage:.3f} | {variance:.3f} | {failed} "
                f"| {ratio:.0f} |\n"
            )
            sys.stdout.flush()


if __name__ == "__main__":
    main()
