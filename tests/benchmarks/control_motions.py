"""Model reference control on motions of 1 to 10 mrad: against the model and the simulated flight arm, and intervals.

Of each of twenty seeds the ground arm and the flight arm are identified from four minutes each and `following` is
designed. Multisines of 1, 2, 5 and 10 mrad (rms, 0.025 to 3 Hz, two minutes, all six joints at once) and the operator's
motion `reach` are then played without control, with it, by the flight arm, and by the flight arm without dry friction.

- `factors`: error without control over that with it, root mean square over joints and ticks, against the identified
  flight model, the simulated flight arm, that arm but for its wrist roll, and that arm without dry friction.
- `gains`: gain at 0 Hz of the identified ground arm over that of the true linear one, joint by joint: mean over the
  seeds and standard deviation. A record with dry friction shows less gain.
- `responses`: gains at 0.5, 1 and 2 Hz that the operator sees, from the multisine of 10 mrad. Their 95 % intervals
  count as holding where they contain the gain of the mean response over the seeds, whose phases differ: the best linear
  one.

Results are kept in a file as they end, so that an interrupted run resumes.
"""

import json
import sys
import warnings
from dataclasses import replace
from pathlib import Path

import numpy as np

import sysid
from hmtb_twin import simulate
from scenarios import load
from scenarios.control.campaign import CONTROLLED, FREQUENCY_TEST, frequency_test, identify_pair
from scenarios.control.design import METHODS
from scenarios.control.runs import run_scenarios
from scenarios.control.score import FREQUENCIES, LAG, answer_of, request_of
from sysid import IOData, SysidWarning
from tests.benchmarks.model_reference import linear_truth, misses, rms
from tests.benchmarks.tables import heading, options, percentage, row

SEEDS = range(400, 420)
SIZES = (0.001, 0.002, 0.005, 0.01)
"""Root mean square of the motions, rad."""


def motions(seed):
    """The motions by what they are called."""
    tests = {f"{1e3 * size:g} mrad": replace(FREQUENCY_TEST, rms=size, seed=seed) for size in SIZES}
    played = {name: replace(frequency_test(seed), multisines=multisines) for name, multisines in tests.items()}
    return {**played, "`reach`": replace(load("reach"), seed=seed)}


def seen(log):
    """Gains (3, 6) that the operator sees, real and imaginary parts, and the ends of their 95 % intervals."""
    data = IOData(request_of(log), answer_of(log), log.dt)[LAG:].detrend(1)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", SysidWarning)
        spectra = sysid.spa(data, lag=LAG, window=np.bartlett, frequencies=FREQUENCIES)
    low, high = (np.einsum("fii->fi", end).tolist() for end in spectra.magnitude_ci95())
    response = np.einsum("fii->fi", spectra.response)
    return {"real": response.real.tolist(), "imaginary": response.imag.tolist(), "low": low, "high": high}


def measured(seed):
    """Errors of each motion, gains of the identified arm, and responses that the operator sees, of one seed."""
    pair = identify_pair(seed)
    played = motions(seed)
    runs = run_scenarios(list(played.values()), {"with": METHODS["following"](pair)})
    smooth = [replace(m, variant="flight", chain=replace(m.chain, friction=False)) for m in played.values()]
    without_friction = simulate([replace(m, name=f"smooth-{k}") for k, m in enumerate(smooth)])
    errors, responses = {}, {}
    for name, run, smooth_log in zip(played, runs, without_friction, strict=True):
        flight = run.logs["reference"]
        for law in ("without", "with"):
            log = run.logs[law]
            of_arm = 1e3 * (answer_of(log) - answer_of(flight))
            errors[f"{name} {law}"] = {
                "model": rms(misses(log, pair.reference)),
                "arm": rms(of_arm),
                "arm but wrist roll": rms(of_arm[:, :-1]),
                "arm without friction": rms(1e3 * (answer_of(log) - answer_of(smooth_log))),
            }
            if name == "10 mrad":
                responses[law] = seen(log)
    gains = np.diag(pair.ground.dc_gain()) / np.diag(linear_truth().dc_gain())
    return {"errors": errors, "gains": gains.tolist(), "responses": responses}


def show(results):
    """Print the three tables."""
    kinds = {
        "model": "identified flight model",
        "arm": "simulated flight arm",
        "arm but wrist roll": "the same without the wrist roll",
        "arm without friction": "simulated flight arm without dry friction",
    }
    heading("motion", "reference", "without control / mrad", "with it / mrad", "factor", "least and largest of a seed")
    for name in motions(0):
        for kind, words in kinds.items():
            pairs = [[entry["errors"][f"{name} {law}"][kind] for law in ("without", "with")] for entry in results]
            without, controlled = np.array(pairs).T
            ratios = without / controlled
            means = without.mean(), controlled.mean()
            ends = f"{ratios.min():.3g}, {ratios.max():.3g}"
            row(name, words, *(f"{mean:.3g}" for mean in means), f"{means[0] / means[1]:.3g}", ends)
    print()
    gains = np.array([entry["gains"] for entry in results])
    heading("gain at 0 Hz over the true one", *CONTROLLED)
    row("mean", *(f"{value:.4f}" for value in gains.mean(axis=0)))
    row("standard deviation", *(f"{value:.4f}" for value in gains.std(axis=0, ddof=1)))
    print()
    heading("response", "frequency / Hz", "intervals that hold / %", "largest scatter over stated deviation")
    for law in ("without", "with"):
        responses = [entry["responses"][law] for entry in results]
        parts = {key: np.array([response[key] for response in responses]) for key in responses[0]}
        response = parts["real"] + 1j * parts["imaginary"]
        best = np.abs(response.mean(axis=0))
        holds = (parts["low"] <= best) & (best <= parts["high"])
        deviation = (parts["high"] - parts["low"]) / 4.0
        scatter = np.abs(response).std(axis=0, ddof=1) / np.sqrt((deviation**2).mean(axis=0))
        for k, frequency in enumerate(FREQUENCIES):
            share = percentage(int(holds[:, k].sum()), holds[:, k].size)
            row(f"{law} control", f"{frequency:g}", share, f"{scatter[k].max():.2f}")


def main():
    parser = options(__doc__)
    parser.add_argument("--count", type=int, help="of seeds, the first ones")
    parser.add_argument("--out", type=Path, default=Path("build/control_motions.jsonl"), help="file of the results")
    asked = parser.parse_args()
    seeds = SEEDS[: asked.count]
    asked.out.parent.mkdir(parents=True, exist_ok=True)
    asked.out.touch()
    kept = {seed: entry for seed, entry in map(json.loads, asked.out.read_text().splitlines())}
    for seed in seeds:
        if seed not in kept:
            text = json.dumps([seed, measured(seed)])
            with asked.out.open("a") as file:
                file.write(text + "\n")
            kept[seed] = json.loads(text)[1]
            print(f"seed {seed} done", file=sys.stderr)
    show([kept[seed] for seed in seeds])


if __name__ == "__main__":
    main()
