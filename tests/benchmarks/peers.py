"""Speed and quality beside the peers, same data, one process, one thread each, processor time.

Run by hand in an environment that has the peers (`pip install -e '.[peers]'`): `python tests/benchmarks/peers.py 3`,
3 being the noise draws per problem.
A fit is off when N (V - V0) / V0 exceeds 20, V0 being the lowest loss that any method found on the same data.
"""

import contextlib
import os
import sys
from importlib.metadata import version
from pathlib import Path
from statistics import median

for variable in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ[variable] = "1"
os.environ["XLA_FLAGS"] = "--xla_cpu_multi_thread_eigen=false intra_op_parallelism_threads=1"

sys.path.insert(0, str(Path(__file__).parents[2]))

import numpy as np  # noqa: E402 - BLAS reads its number of threads when it loads
from scipy.signal import lfilter  # noqa: E402

import sysid  # noqa: E402
from scenarios.estimators.task import Task  # noqa: E402
from sysid.polynomial.structures import STRUCTURES  # noqa: E402
from tests.benchmarks.tables import heading, row, timed  # noqa: E402
from tests.sysid import conftest as problems  # noqa: E402


@contextlib.contextmanager
def silence():
    """Send what compiled code prints to nowhere."""
    sys.stdout.flush()
    kept = os.dup(1)
    with open(os.devnull, "w") as nowhere:
        os.dup2(nowhere.fileno(), 1)
        try:
            yield
        finally:
            sys.stdout.flush()
            os.dup2(kept, 1)
            os.close(kept)


def loss(p, u, y):
    """Mean square of the one-step prediction error; infinite where the predictor is unstable."""
    if max((np.abs(np.roots(q)).max(initial=0.0) for q in (p.C, p.F)), default=0.0) >= 1.0:
        return np.inf
    error = lfilter(p.D, p.C, lfilter(p.A, [1.0], y) - lfilter(p.B, p.F, u))
    # Initial conditions are each method's own affair.
    return float(np.mean(error[500:] ** 2))


def ours(method, orders):
    return lambda u, y: getattr(sysid, method)(sysid.IOData(u, y, 0.02), *orders).polynomials


def adapted(function, method, orders):
    """A peer as the test bench calls it."""
    task = Task(method, dict(zip(STRUCTURES[method], orders, strict=True)), max(orders), np.ones(1))

    def fit(u, y):
        answer = function(sysid.IOData(u, y, 0.02), task)
        return answer.polynomials or from_states(answer.model)

    return fit


def from_states(model):
    """The output-error model of a state-space model with one input and one output."""
    F = np.poly(model.A)
    return sysid.Polynomials(B=np.convolve(F, model.markov(len(F))[:, 0, 0])[: len(F)], F=F)


def pysib(method, orders):
    from scenarios.estimators import polynomial_peers

    return adapted(getattr(polynomial_peers, f"pysib_{method}"), method, orders)


def sippy(method, orders, *, mode="OPT"):
    """SIPPY, by optimisation if not said otherwise."""
    from scenarios.estimators.polynomial_peers import sippy_polynomials

    return adapted(lambda data, task: sippy_polynomials(method, data, task, mode=mode), method, orders)


def jax_sysid(method, orders):
    """jax-sysid, double precision: an output-error fit of the same order."""
    from scenarios.estimators.state_space_peers import jax_sysid_oe

    return adapted(jax_sysid_oe, method, orders)


def versions(*names):
    return ", ".join(f"{name} {version(name)}" for name in names)


CASES = (
    ("P1", "armax", (5, 3, 5, 2), {"this package": ours, "pysib": pysib, "sippy-unipi": sippy}),
    ("P2", "oe", (2, 2, 1), {"this package": ours, "pysib": pysib, "sippy-unipi": sippy, "jax-sysid": jax_sysid}),
    ("P3", "armax", (2, 2, 2, 1), {"this package": ours, "pysib": pysib, "sippy-unipi": sippy}),
)


def main():
    draws = int(sys.argv[1]) if len(sys.argv) > 1 else 3
    print(versions("numpy", "scipy", "pysib", "sippy-unipi", "jax-sysid"), f"; {draws} draws")
    print()
    heading("problem", "method", "processor time, median s", "times ours", "off")
    for key, method, orders, peers in CASES:
        problem = getattr(problems, f"make_{key.lower()}")()
        seconds: dict[str, list[float]] = {name: [] for name in peers}
        losses: dict[str, list[float]] = {name: [] for name in peers}
        fits = {name: make(method, orders) for name, make in peers.items()}
        for seed in range(-1, draws):
            data = problem.draw(abs(seed))
            u, y = data.u[:, 0].copy(), data.y[:, 0].copy()
            for name, fit in fits.items():
                if seed < 0 and name in ("pysib", "sippy-unipi"):
                    continue  # nothing in them warms up
                with silence():
                    polynomials, elapsed = timed(fit, u, y)
                if seed >= 0:
                    seconds[name].append(elapsed)
                    losses[name].append(loss(polynomials, u, y))
        best = np.min([losses[name] for name in peers], axis=0)
        for name in peers:
            off = int((len(u) * (np.array(losses[name]) / best - 1.0) > 20.0).sum())
            ratio = median(seconds[name]) / median(seconds["this package"])
            row(f"{key} {method}", name, f"{median(seconds[name]):.3f}", f"{ratio:.1f}", f"{off}/{draws}")


if __name__ == "__main__":
    main()
