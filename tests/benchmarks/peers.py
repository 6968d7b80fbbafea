"""Speed and quality beside the peers, same data, one process, one thread each, processor time.

Run by hand in an environment that has the peers (`pip install -e '.[peers]'`): `python tests/benchmarks/peers.py 3`,
3 being the noise draws per problem.
A fit is off when N (V - V0) / V0 exceeds 20, V0 being the lowest loss that any method found on the same data.
"""

import contextlib
import os
import sys
from collections.abc import Callable, Iterator
from importlib.metadata import version
from pathlib import Path
from statistics import median
from time import process_time

for variable in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ[variable] = "1"
os.environ["XLA_FLAGS"] = "--xla_cpu_multi_thread_eigen=false intra_op_parallelism_threads=1"

sys.path.insert(0, str(Path(__file__).parents[2]))

import numpy as np  # noqa: E402 - BLAS reads its number of threads when it loads
from efficiency import problems  # noqa: E402
from scipy.signal import lfilter  # noqa: E402

import sysid  # noqa: E402

SKIP = 500
"""First residuals left out of every loss: initial conditions are each method's own affair."""

Fit = Callable[[np.ndarray, np.ndarray], sysid.Polynomials]


@contextlib.contextmanager
def silence() -> Iterator[None]:
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


def loss(p: sysid.Polynomials, u: np.ndarray, y: np.ndarray) -> float:
    """Mean square of the one-step prediction error; infinite where the predictor is unstable."""
    if max((np.abs(np.roots(q)).max(initial=0.0) for q in (p.C, p.F)), default=0.0) >= 1.0:
        return np.inf
    error = lfilter(p.D, p.C, lfilter(p.A, [1.0], y) - lfilter(p.B, p.F, u))
    return float(np.mean(error[SKIP:] ** 2))


def polynomials(A: object, B: object, C: object, F: object) -> sysid.Polynomials:
    """Polynomials from whatever a peer returns."""
    one = np.ones(1)
    a, c, f = (one if q is None else np.asarray(q, float).ravel() for q in (A, C, F))
    b = np.asarray(B, float).squeeze()
    return sysid.Polynomials(a, b, c, one, f if b.ndim == 1 else np.tile(f, (len(b), 1)))


def ours(method: str, orders: tuple[int, ...]) -> Fit:
    """This package."""

    def fit(u: np.ndarray, y: np.ndarray) -> sysid.Polynomials:
        return getattr(sysid, method)(sysid.IOData(u, y, 0.02), *orders).polynomials

    return fit


def pysib(method: str, orders: tuple[int, ...]) -> Fit:
    """pysib, its prediction-error estimators."""
    import pysib as peer

    def fit(u: np.ndarray, y: np.ndarray) -> sysid.Polynomials:
        _, m = getattr(peer, method)(u, y, *orders)
        return polynomials(m["A"], m["B"], m["C"], m["F"])

    return fit


def sippy(method: str, orders: tuple[int, ...], *, mode: str = "OPT") -> Fit:
    """SIPPY, by optimisation if not said otherwise; its theta counts delay beyond one sample."""
    from sippy_unipi import system_identification

    def fit(u: np.ndarray, y: np.ndarray) -> sysid.Polynomials:
        inputs = 1 if u.ndim == 1 else u.shape[1]
        na, nb, *noise, nk = orders if method == "armax" else (None, *orders)
        counts = [[na]] if method == "armax" else []
        counts += [[[nb] * inputs], *([n] for n in noise), [[nk - 1] * inputs]]
        found = system_identification(
            y, u, method.upper(), **{f"{method.upper()}_orders": counts, f"{method.upper()}_mod": mode}
        )
        den = np.asarray(found.G.den[0][0])
        nums = [np.asarray(num) for num in found.G.num[0]]
        B = np.squeeze([np.r_[np.zeros(len(den) - len(num)), num] for num in nums])
        if method == "oe":
            return polynomials(None, B, None, den)
        C = np.asarray(found.H.num[0][0])
        return polynomials(den, B, C / C[0], None)

    return fit


def jax_sysid(method: str, orders: tuple[int, ...]) -> Fit:
    """jax-sysid, double precision, L-BFGS on a linear state-space model: an output-error fit of the same order."""
    import jax

    jax.config.update("jax_enable_x64", True)
    from jax_sysid.models import LinearModel

    def fit(u: np.ndarray, y: np.ndarray) -> sysid.Polynomials:
        model = LinearModel(orders[1], 1, 1, feedthrough=False)
        model.loss(rho_x0=0.0, rho_th=0.0)
        model.optimization(adam_epochs=0, lbfgs_epochs=1000, iprint=-1)
        model.fit(y[:, None], u[:, None])
        A, B, C = (np.asarray(m) for m in model.params[:3])
        F = np.poly(A)
        pulses = [0.0] + [float((C @ np.linalg.matrix_power(A, k) @ B)[0, 0]) for k in range(len(A))]
        return polynomials(None, np.convolve(F, pulses)[: len(F)], None, F)

    return fit


def versions(*names: str) -> str:
    """What was measured beside ours."""
    return ", ".join(f"{name} {version(name)}" for name in names)


CASES = (
    ("P1", "armax", (5, 3, 5, 2), {"this package": ours, "pysib": pysib, "sippy-unipi": sippy}),
    ("P2", "oe", (2, 2, 1), {"this package": ours, "pysib": pysib, "sippy-unipi": sippy, "jax-sysid": jax_sysid}),
    ("P3", "armax", (2, 2, 2, 1), {"this package": ours, "pysib": pysib, "sippy-unipi": sippy}),
)


def main() -> None:
    """Measure and write a table."""
    draws = int(sys.argv[1]) if len(sys.argv) > 1 else 3
    library = problems()
    print(versions("numpy", "scipy", "pysib", "sippy-unipi", "jax-sysid"), f"; {draws} draws")
    print("\n| problem | method | processor time, median s | times ours | off |\n|---|---|---|---|---|")
    for key, method, orders, peers in CASES:
        problem = getattr(library, f"make_{key.lower()}")()
        seconds: dict[str, list[float]] = {name: [] for name in peers}
        losses: dict[str, list[float]] = {name: [] for name in peers}
        fits = {name: make(method, orders) for name, make in peers.items()}
        for seed in range(-1, draws):
            data = problem.draw(abs(seed))
            u, y = data.u[:, 0].copy(), data.y[:, 0].copy()
            for name, fit in fits.items():
                if seed < 0 and name in ("pysib", "sippy-unipi"):
                    continue  # nothing in them warms up
                started = process_time()
                with silence():
                    found = fit(u, y)
                elapsed = process_time() - started
                if seed >= 0:
                    seconds[name].append(elapsed)
                    losses[name].append(loss(found, u, y))
        best = np.min([losses[name] for name in peers], axis=0)
        for name in peers:
            off = int((len(u) * (np.array(losses[name]) / best - 1.0) > 20.0).sum())
            ratio = median(seconds[name]) / median(seconds["this package"])
            print(f"| {key} {method} | {name} | {median(seconds[name]):.3f} | {ratio:.1f} | {off}/{draws} |")


if __name__ == "__main__":
    main()
