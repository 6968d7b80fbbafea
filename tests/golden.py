"""Record the numbers of this version, or compare them with recorded ones.

    python tests/golden.py record FILE [CASE ...]
    python tests/golden.py compare FILE [CASE ...] [--tolerance 1e-9]

A case is a command of `hmtb` or every estimator of `sysid` on one of the problems P1 to P3. Only numbers and verdicts
are kept: no text, no time, no path, no version. `compare` is exact without --tolerance: on one machine, with one
version of each library, the numbers are the same bit for bit. Other processors round otherwise.
"""

import argparse
import json
import math
import os
import subprocess
import sys
import tempfile
import warnings
from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import partial
from pathlib import Path

for variable in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS"):
    os.environ[variable] = "1"

# The folder of a script comes first on the path, and its `sysid` would be taken for the package.
if __name__ == "__main__":
    sys.path[0] = str(Path(__file__).parents[1])

import numpy as np  # noqa: E402

import sysid  # noqa: E402
from scenarios.problems.registry import problem as problem_named  # noqa: E402

REFERENCE = Path(__file__).parent / "reference" / "golden.json"
# Keys whose values depend on the machine, the time or the place.
LEFT_OUT = set(
    ["cost", "effort", "files", "path", "physics_s", "provenance", "report", "seconds", "speed", "versions", "reasons"]
)

Numbers = dict[str, float | bool | None]


def flatten(value: object, name: str = "") -> Iterator[tuple[str, float | bool | None]]:
    """Every number of nested mappings and sequences, named by the keys and places that lead to it."""
    if isinstance(value, Mapping):
        for key, entry in value.items():
            if key not in LEFT_OUT:
                yield from flatten(entry, f"{name}/{key}")
    elif isinstance(value, np.ndarray):
        yield from flatten(value.tolist(), name)
    elif isinstance(value, Sequence) and not isinstance(value, str):
        for place, entry in enumerate(value):
            yield from flatten(entry, f"{name}/{place}")
    elif isinstance(value, complex):
        yield from flatten((value.real, value.imag), name)
    elif value is None or isinstance(value, bool):
        yield name, value
    elif isinstance(value, int | float):
        yield name, float(value)


def hmtb(*words: str) -> object:
    """What a command of `hmtb` prints as JSON."""
    done = subprocess.run([sys.executable, "-m", "scenarios", *words, "--json"], capture_output=True, text=True)
    if done.returncode not in (0, 1):
        raise SystemExit(f"hmtb {' '.join(words)}: {done.stderr}")
    return json.loads(done.stdout)


def dataset(name: str) -> Numbers:
    """The hash of a data set, as one number for each of its four quarters."""
    with tempfile.TemporaryDirectory() as folder:
        digest = hmtb("dataset", "build", name, "--out", folder)["hash"].removeprefix("sha256:")  # type: ignore[index]
    # 52 bits at a time: a float holds them exactly.
    return {f"hash/{k}": float(int(digest[k : k + 13], 16)) for k in range(0, len(digest), 13)}


def verify() -> object:
    """The metrics of two estimators on the quick bench."""
    with tempfile.TemporaryDirectory() as folder:
        words = ("verify", "our-arx", "our-pem", "--quick", "--seed", "0", "--out", folder)
        results = hmtb(*words)["estimators"]  # type: ignore[index]
    return {
        name: {
            key: {k: entry[k] for k in ("value", "expected", "interval", "passed", "parts") if k in entry}
            for key, entry in result["figures"].items()
            if key not in LEFT_OUT
        }
        for name, result in results.items()
    }


def truth(variant: str) -> object:
    """What `hmtb truth` prints of an arm; of the shoulder roll, which a pin holds, without what rounding decides.

    Its gain is 1e-7: the order of its minimal model and the place of its response's peak differ between processors.
    """
    printed = hmtb("truth", "--variant", variant)
    roll = printed["joints"]["shoulder_roll"]  # type: ignore[index]
    for key in ("poles", "zeros", "delay_samples"):
        del roll[key]
    return printed


def thesis() -> object:
    """The numbers of a short study."""
    with tempfile.TemporaryDirectory() as folder:
        return hmtb("thesis", "--quick", "--seed", "1", "--out", folder)


def estimators(problem: str) -> object:
    """Every estimator on one record of a problem."""
    data = problem_named(problem).draw(1)
    na, nb, nc, nk = {"p1": (5, 3, 5, 2), "p2": (2, 2, 2, 1), "p3": (2, 2, 2, 1)}[problem]
    nf = 2
    frequencies = np.array([0.1, 0.5, 1.0, 2.0, 5.0])
    warnings.simplefilter("ignore", sysid.SysidWarning)
    polynomial = {
        "arx": sysid.arx(data, na, nb, nk),
        "armax": sysid.armax(data, na, nb, nc, nk),
        "oe": sysid.oe(data, nb, nf, nk),
        "bj": sysid.bj(data, nb, 1, 1, nf, nk),
        "iv4": sysid.iv4(data, na, nb, nk),
    }
    subspace = {"okid": sysid.okid(data, 2, p=20), "n4sid": sysid.n4sid(data, 2)}
    subspace["pem_ss"] = sysid.pem_ss(data, subspace["n4sid"])
    result: dict[str, object] = {
        name: {
            "parameters": estimate.parameters,
            "covariance": estimate.covariance,
            "noise_variance": estimate.noise_variance,
            "residuals": float(np.sum(estimate.residuals[0] ** 2)),
        }
        for name, estimate in polynomial.items()
    }
    for name, estimate in subspace.items():
        bandwidth = estimate.bandwidth()
        result[name] = {
            "response": estimate.model.frequency_response(frequencies),
            "noise_variance": estimate.noise_variance,
            "bandwidth": bandwidth.hz,
            "interval": bandwidth.ci95,
        }
    for estimator in (sysid.etfe, sysid.spa, sysid.welch):
        response = estimator(data).response
        result[estimator.__name__] = response[:: max(1, len(response) // 20)]
    for recursive, orders in (
        (sysid.rarx, (na, nb, nk)),
        (sysid.rarmax, (na, nb, nc, nk)),
        (sysid.roe, (nb, nf, nk)),
    ):
        result[recursive.__name__] = recursive(data, *orders).parameters[-1]
    model = polynomial["armax"].model
    result["era"] = sysid.era(model.markov(60), 2, dt=data.dt).model.frequency_response(frequencies)
    result["cra"] = sysid.cra(data).response
    result["delayest"] = [sysid.delayest(data).arx, sysid.delayest(data).correlation]
    tests = sysid.resid(polynomial["armax"], data)
    result["resid"] = [tests.whiteness_p, tests.independence_p]
    fit = sysid.compare(polynomial["armax"], data)[0]
    result["compare"] = [fit.simulation, fit.one_step]
    return result


CASES: dict[str, Callable[[], object]] = {
    **{f"estimators-{name}": partial(estimators, name) for name in ("p1", "p2", "p3")},
    **{f"truth-{name}": partial(truth, name) for name in ("nominal", "published", "flight")},
    "bandwidth": partial(hmtb, "bandwidth"),
    **{f"dataset-{name}": partial(dataset, f"hmtb-{name}-v1") for name in ("siso", "mimo", "nonlinear")},
    "verify": verify,
    "thesis": thesis,
}
"""What is recorded, by name: from seconds for the first seven cases to minutes for the study."""


def numbers(case: str) -> Numbers:
    """The numbers of a case by name."""
    return dict(flatten(CASES[case]()))


def differences(expected: Numbers, actual: Numbers, tolerance: float) -> list[str]:
    """Numbers that are missing or differ by more than a part of their size; new ones are no difference."""
    lines = []
    for name, value in expected.items():
        if name not in actual:
            lines.append(f"{name}: missing, expected {value}")
            continue
        other = actual[name]
        same = value == other
        if not same and isinstance(value, float) and isinstance(other, float):
            same = math.isclose(value, other, rel_tol=tolerance, abs_tol=1e-9 * tolerance) or (value != value != other)
        if not same:
            lines.append(f"{name}: {other}, expected {value}")
    return lines


def one_line_per_case(cases: Mapping[str, Numbers]) -> str:
    """JSON in which a change of one case is a change of one line."""
    lines = ",\n".join(f"{json.dumps(name)}: {json.dumps(entry)}" for name, entry in cases.items())
    return f"{{\n{lines}\n}}\n"


def main() -> int:
    """Record or compare."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("action", choices=("record", "compare"))
    parser.add_argument("file", type=Path)
    parser.add_argument("cases", nargs="*", default=list(CASES))
    parser.add_argument("--tolerance", type=float, default=0.0)
    options = parser.parse_args()
    if options.action == "record":
        kept = json.loads(options.file.read_text()) if options.file.exists() else {}
        for case in options.cases:
            kept[case] = numbers(case)
            print(f"{case}: {len(kept[case])} numbers")
            options.file.write_text(one_line_per_case(kept), encoding="utf-8")
        return 0
    recorded = json.loads(options.file.read_text(encoding="utf-8"))
    wrong = 0
    for case in options.cases:
        lines = differences(recorded[case], numbers(case), options.tolerance)
        print(f"{case}: {len(recorded[case])} numbers, {len(lines)} differ")
        for line in lines[:20]:
            print(f"  {line}")
        wrong += len(lines)
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
