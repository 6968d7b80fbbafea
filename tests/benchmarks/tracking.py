"""Tracking of a plant that changes: coverage of the intervals, detection, false alarms.

The payload of the twin is exchanged, none -> rpcm at 60 s -> mdm at 120 s, in records of 180 s. The elbow pitch is
excited: of the studied joints its small-signal bandwidth moves most (0.927, 1.035, 0.937 Hz). Excitation: random-
phase multisine of 0.05 to 2.5 Hz, 20 mrad rms, one period of 180 s, so that no part of a record repeats another; its
rate passes 25 deg/s, where the command is limited, in 3 % of the samples.

Three problems. `linear`: the small-signal truths of the three payloads, switched in state space, and the resolver
noise; the target is the true bandwidth of the payload that is carried. `twin`: the simulated arm, all links of the
chain and dry friction; there the small-signal truth is not what data can show (docs/truth.md), the target is the best
linear approximation in the same class and amplitude of excitation: the small-signal response times its measured
departure, which is smooth, a polynomial of degree 6 in the logarithms through the lines from 0.6 to 1.5 Hz, of 96
realisations of a minute. `repeating`: the scenario `track-elbow_pitch`, whose command repeats every 10 s, with other
phases and noise in each run; its hold of three samples meets the command in the same way every 30 s. Its target is the
small-signal response times the ratio of the mean lines of 96 such commands to it, interpolated by a cubic spline
through the lines of the command, every 0.1 Hz. The bandwidth is in all cases the frequency of the gain 0.707: the gain
of a position servo at 0 Hz is one. Targets of the delay are the phase delays of the same responses there.

Criterion, written on 2026-11-24 before the runs: over 200 runs, intervals of the bandwidth cover 93 to 97 % of the
targets before (59 s), during (5, 10 and 20 s after a change) and 30 s after the changes; a missing estimate counts as
a miss. At least 95 % of the changes are detected within 10 s. In long records without a change, and in the 200 runs
outside those 10 s, at most one alarm an hour; a second alarm within the 10 s counts as false.

Changed on 2026-11-27, after 87 of these runs had missed it: the targets of the twin. Twenty realisations of 20 s and a
parabola were wrong by 0.9 ms in the delay with the multiplexer, whose departure is no parabola, and by 0.15 % in the
bandwidth without payload; a spectral estimate from records of ten minutes agrees with those of now to 0.04 %. The
estimator was changed as well, on other records (seeds from 2000), and once more after 200 runs in which intervals of
the delay, for which the criterion asks nothing, had covered 92.3 % during the changes.

Added on 2026-11-30, before any run: `repeating`, with the same criterion. The tracker of that morning, changed for
repeating commands on eight records, missed it: 71 % before a change, 84 to 89 % during, 83 % after, on 150 runs from
seed 1000. It was changed once more on 50 records from seed 2000; what stands in docs/measured/tracking.md is from seed
4000 on.

`--runs 200` continues a journal (JSON lines) where it stopped; `--quick` takes ten runs and an eighth of the hours.
"""

import json
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

import numpy as np
from scipy.interpolate import CubicSpline

import sysid
from hmtb_twin import JOINTS, linearize, load_arm, simulate
from hmtb_twin.control.experiment import PayloadChange
from scenarios import load
from scenarios.experiments.multisines import MultisineExperiment, Multisines
from scenarios.truth.best_linear import best_linear
from tests.benchmarks.tables import heading, options, percentage, row

JOINT = "elbow_pitch"
COLUMN = JOINTS.index(JOINT)
PAYLOADS = ("none", "rpcm", "mdm")
CHANGES = (60.0, 120.0)
DURATION = 180.0
MOMENTS = {
    "before a change": ((59.0, 0), (119.0, 1)),
    "5 s after": ((65.0, 1), (125.0, 2)),
    "10 s after": ((70.0, 1), (130.0, 2)),
    "20 s after": ((80.0, 1), (140.0, 2)),
    "30 s after": ((90.0, 1), (150.0, 2)),
}
WITHIN = 10.0
CLASS = Multisines(rms=0.02, f_max=2.5, period=DURATION)
UNCHANGED = 600.0
NEAR = (0.6, 1.5)
REPEATED = 30.0
REALISATIONS, BATCH = 96, 16


@dataclass(frozen=True)
class Exchange(MultisineExperiment):
    """The first period of a multisine from rest, with exchanges of the payload."""

    payload_changes: tuple[PayloadChange, ...] = ()  # type: ignore[misc]

    @property
    def duration(self):
        """One period, s."""
        return self.multisines.period

    def offsets(self):
        """Offsets of one period (N, 1), rad."""
        return super().offsets()[: self.multisines.samples]


def excitation(seed, duration=DURATION):
    """The excitation class with another seed and length."""
    return replace(CLASS, seed=seed, period=duration)


def linear_record(truths, seed, changes, duration=DURATION, first=0):
    """Record of the small-signal truths, one after the other in state space."""
    offsets = excitation(seed, duration).offsets(0)[: round(duration * 50), 0]
    x, y = np.zeros(truths[0].model.order), np.empty(len(offsets))
    for t, u in enumerate(offsets):
        model = truths[first + sum(t >= 50 * change for change in changes)].model
        y[t] = model.C[COLUMN] @ x
        x = model.A @ x + model.B[:, COLUMN] * u
    noise = np.sqrt(truths[0].disturbances.resolvers[0, 0]) * np.random.default_rng([seed, 1]).standard_normal(len(y))
    return sysid.IOData(offsets, y + noise, 0.02)


def twin_record(_, seed, changes, duration=DURATION, first=0):
    """Record of the simulated arm."""
    changed = tuple(PayloadChange(t, p) for t, p in zip(changes, PAYLOADS[1:], strict=False))
    settings = {"payload": PAYLOADS[first], "seed": seed, "payload_changes": changed}
    return simulate([Exchange("exchange", (JOINT,), excitation(seed, duration), **settings)])[0].iodata(JOINT)


def repeating_scenario(seed, payload, changes, duration):
    """The scenario whose command repeats, with the phases and the noise of a seed."""
    scenario = load(f"track-{JOINT}")
    (entry,) = scenario.excitation
    return replace(
        scenario,
        name=f"repeating-{payload}-{seed}",
        seed=seed,
        duration=duration,
        payload=payload,
        payload_changes=changes,
        excitation=(replace(entry, parameters={**entry.parameters, "seed": seed}),),
    )


def repeating_record(_, seed, changes, duration=DURATION, first=0):
    """Record of the simulated arm under a command that repeats."""
    changed = tuple(PayloadChange(t, p) for t, p in zip(changes, PAYLOADS[1:], strict=False))
    return simulate([repeating_scenario(seed, PAYLOADS[first], changed, duration)])[0].iodata(JOINT)


RECORDS = {"linear": linear_record, "twin": twin_record, "repeating": repeating_record}


def crossing(model, departure=lambda f: 0.0 * f):
    """Bandwidth and phase delay at the gain 0.707 of a model times exp(departure), which is a function of frequency."""
    f = np.geomspace(*NEAR, 20001)
    response = np.log(np.abs(g := model.frequency_response(f)[:, 0, 0])) + 1j * np.unwrap(np.angle(g)) + departure(f)
    above = response.real - np.log(np.sqrt(0.5))
    k = int(np.argmax(above < 0.0))
    hz = np.interp(0.0, -above[k - 1 : k + 1], f[k - 1 : k + 1])
    return float(hz), float(-np.interp(hz, f, response.imag) / (2 * np.pi * hz))


def departure(payload, model):
    """Logarithm of the best linear response under commands that repeat over a small-signal one: f in Hz to complex."""
    spectra = []
    for seed in range(2 * 10**6, 2 * 10**6 + REALISATIONS, BATCH):
        runs = [repeating_scenario(seed + k, payload, (), 2.0 * REPEATED) for k in range(BATCH)]
        for log in simulate(runs):
            data = log.iodata(JOINT)
            # the last whole period of command and hold: the arm has settled
            last = data[len(data) // 2 :]
            spectra.append([np.fft.rfft(last.u[:, 0]), np.fft.rfft(last.y[:, 0])])
    u, y = np.moveaxis(np.array(spectra), 1, 0)
    # the command has lines at every third of those of 30 s
    f = np.fft.rfftfreq(round(REPEATED * 50), 0.02)[::3]
    response = (np.sum(y * u.conj(), axis=0) / np.sum(np.abs(u) ** 2, axis=0))[::3]
    near = (f > NEAR[0] - 0.25) & (f < NEAR[1] + 0.25)
    ratio = np.log(response[near] / model.frequency_response(f[near])[:, 0, 0])
    real, imaginary = CubicSpline(np.log(f[near]), ratio.real), CubicSpline(np.log(f[near]), ratio.imag)
    return lambda f: real(np.log(f)) + 1j * imaginary(np.log(f))


def targets(problem, truths):
    """Bandwidth and delay of each payload (3, 2)."""
    models = [truth.joint(JOINT).model for truth in truths]
    if problem == "linear":
        return [crossing(model) for model in models]
    if problem == "repeating":
        return [crossing(model, departure(payload, model)) for payload, model in zip(PAYLOADS, models, strict=True)]
    out = []
    for payload, model in zip(PAYLOADS, models, strict=True):
        setting = MultisineExperiment("target", (JOINT,), payload=payload, seed=7)
        # six parts of 16 realisations: less memory
        classes = (replace(CLASS, period=61.2, realisations=16, seed=2 * 10**6 + k) for k in range(6))
        parts = [best_linear(setting, one).servo.response for one in classes]
        f, response = parts[0].frequencies, sum(part.response[:, 0, 0] for part in parts) / len(parts)
        near = (f > NEAR[0]) & (f < NEAR[1])
        ratio = np.log(response[near] / model.frequency_response(f[near])[:, 0, 0])
        curve = np.polynomial.polynomial.polyfit(np.log(f[near]), ratio, 6)
        out.append(crossing(model, lambda f, curve=curve: np.polynomial.polynomial.polyval(np.log(f), curve)))
    return out


def outcome(record):
    """Intervals at the moments, NaN behind the end, and alarms of one run."""
    found = sysid.track(record, nk=2, gain=1.0)
    ends = {}
    for name, entries in MOMENTS.items():
        for second, payload in entries:
            k = min(round(second * 50), len(record) - 1)
            ends.setdefault(name, []).append([payload, *found.bandwidth_ci95[k], *found.delay_ci95[k]])
    return {"moments": ends, "alarms": [change.detected for change in found.changes]}


def report(problem, runs, hours, truth):
    """Print the tables of a problem."""
    print(f"\n`{problem}`, {len(runs)} runs\n")
    heading("intervals that contain the target, %", "bandwidth", "delay", "median width of the bandwidth's, mHz")
    truth = np.array(truth)
    entries = {}
    for name in MOMENTS:
        values = np.array([e for r in runs for e in r["moments"][name]])
        true = truth[values[:, 0].astype(int)]
        hits = [(values[:, 2 * k + 1] <= true[:, k]) & (true[:, k] <= values[:, 2 * k + 2]) for k in (0, 1)]
        entries[name] = np.column_stack((*hits, values[:, 2] - values[:, 1]))
    during = np.vstack([entries[name] for name in ("5 s after", "10 s after", "20 s after")])
    for name, values in {**entries, "during, all three": during}.items():
        counts = (percentage(int(values[:, k].sum()), len(values)) for k in (0, 1))
        row(name, *counts, f"{1e3 * np.nanmedian(values[:, 2]):.2f}")
    alarms = [r["alarms"] for r in runs]
    delays = [min((a - c for a in run if a >= c), default=np.inf) for run in alarms for c in CHANGES]
    within = sum(d <= WITHIN for d in delays)
    false = sum(len(run) - sum(any(0.0 <= a - c <= WITHIN for a in run) for c in CHANGES) for run in alarms)
    print()
    heading("changes detected within 10 s, %", "median delay, s", "95 % of them, s", "false alarms, hours at risk")
    at_risk = len(runs) * (DURATION - 30.0) / 3600.0
    quantiles = (f"{np.quantile(delays, q):.2f}" for q in (0.5, 0.95))
    row(percentage(within, len(delays)), *quantiles, f"{false} in {at_risk:.1f}")
    if hours:
        total = sum(one["hours"] for one in hours)
        print(f"\nWithout a change: {sum(one['alarms'] for one in hours)} alarms in {total:.2f} hours.", flush=True)


def measure(problem, runs, unchanged, path, first):
    """Print the tables of a problem from so many runs and unchanged records; outcomes are kept in a journal."""
    done = dict(json.loads(line) for line in path.read_text().splitlines()) if path.exists() else {}

    def once(key, work, *arguments):
        if key not in done:
            done[key] = work(*arguments)
            with path.open("a") as file:
                file.write(json.dumps([key, done[key]]) + "\n")
        return done[key]

    truths = [linearize(load_arm(payload=payload), amplitudes=()) for payload in PAYLOADS]
    draw = partial(RECORDS[problem], truths)

    def count(k):
        record = draw(10**5 + k, (), UNCHANGED, k % 3)
        return {"alarms": len(outcome(record)["alarms"]), "hours": (UNCHANGED - 30.0) / 3600.0}

    truth = once("targets", targets, problem, truths)
    print(f"{problem}: targets, Hz and s: {np.round(truth, 4).tolist()}", flush=True)
    results = [once(f"run {first + k}", lambda seed: outcome(draw(seed, CHANGES)), first + k) for k in range(runs)]
    report(problem, results, [once(f"unchanged {k}", count, k) for k in range(unchanged)], truth)


def main():
    parser = options(__doc__)
    parser.add_argument("--runs", type=int, default=200)
    parser.add_argument("--first", type=int, default=1000, help="seed of the first run")
    parser.add_argument("--quick", action="store_true")
    parser.add_argument("--problems", nargs="*", default=[*RECORDS], choices=RECORDS)
    parser.add_argument("--unchanged", type=int, default=16, help="unchanged records of ten minutes per problem")
    parser.add_argument("--journal", type=Path, default=Path("tracking-{}.jsonl"))
    asked = parser.parse_args()
    runs, unchanged = (10, 2) if asked.quick else (asked.runs, asked.unchanged)
    for problem in asked.problems:
        measure(problem, runs, unchanged, Path(str(asked.journal).format(problem)), asked.first)


if __name__ == "__main__":
    main()
