"""Monte Carlo repetition of the study over seeds: verdicts counted, numbers and bandwidths with their ranges."""

import json
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache, partial
from hashlib import sha256
from importlib import resources
from pathlib import Path
from time import perf_counter

import numpy as np

from hmtb_twin import TwinError
from hmtb_twin.files.atomic_write import write_whole
from scenarios.experiments.campaign import NOMINAL
from scenarios.files.codec import Extended, plain_numbers, structure, unstructure
from scenarios.files.errors import ScenarioError
from scenarios.files.provenance import fingerprint, versions
from scenarios.identification.recovered_bandwidth import near_1_hz
from scenarios.jobs.journal import Journal
from scenarios.thesis.comparison import Comparison, Cost
from scenarios.thesis.finding import Finding, Verdict
from scenarios.thesis.findings import findings
from scenarios.thesis.study import planned_steps, run_study
from sysid import SysidError

Progress = Callable[[int, int, str, int, int], None]
"""Progress callback: seed, number of finished seeds, step, work done in the step, total work of the step."""

JOURNAL = "seeds.sqlite"
"""Name of the file of finished seeds."""

FILE = "findings.json"
"""File among the package's data; tests/benchmarks/findings.py writes it."""


@dataclass(frozen=True)
class MethodBandwidth:
    """The bandwidth that one method recovered.

    Attributes:
        hz: Bandwidth, Hz.
        ci95: Its 95 % interval, Hz.
        covers: Whether it agrees with the best linear truth, see `ModelResult.covers`.
        half_power_hz: Frequency at which the gain is 0.707, whatever it is at 0 Hz, Hz.
    """

    hz: Extended
    ci95: tuple[Extended, Extended]
    covers: bool
    half_power_hz: Extended


@dataclass(frozen=True, kw_only=True)
class SeedOutcome:
    """Conclusions of a study with one seed, without the records.

    Attributes:
        seed: Of the study, None for the scenarios' own seeds.
        duration: Length of the records where it was shortened, s; None for the thesis' 240 s.
        verdicts: By finding.
        numbers: By finding the numbers that its verdict rests on, by name.
        true_hz: Small-signal bandwidth by joint, Hz.
        recovered: Recovered bandwidths by joint and method.
        failed: Experiments that failed, with the reason.
        cost: Time spent.
        versions: Of what it was made with.
    """

    seed: int | None = None
    duration: float | None = None
    verdicts: Mapping[str, Verdict]
    numbers: Mapping[str, Mapping[str, Extended]]
    true_hz: Mapping[str, float]
    recovered: Mapping[str, Mapping[str, MethodBandwidth]]
    failed: Mapping[str, str]
    cost: Cost
    versions: Mapping[str, str]


def outcome(study: Comparison, findings: Sequence[Finding]) -> SeedOutcome:
    """Return the conclusions of a study and of its decided findings."""
    return SeedOutcome(
        seed=study.seed,
        duration=study.duration,
        verdicts={entry.key: entry.verdict for entry in findings},
        numbers={entry.key: {name: float(x) for name, x in entry.value.items()} for entry in findings},
        true_hz={name: float(entry.truth.bandwidth_hz) for name, entry in study.joints.items()},
        recovered={
            name: {
                model.method: MethodBandwidth(model.bandwidth_hz, model.ci95, model.covers, model.half_power_hz)
                for model in entry.models.values()
            }
            for name, entry in study.joints.items()
        },
        failed=dict(study.failed),
        cost=study.cost,
        versions=dict(study.provenance),
    )


@dataclass(frozen=True)
class Spread:
    """Distribution of a number over the seeds: its median, smallest and largest value, and how many seeds have it."""

    median: float
    low: float
    high: float
    seeds: int


def spread(values: Sequence[float]) -> Spread:
    """Distribution of a number, one value for each seed; where one is not a number, nothing is."""
    with np.errstate(invalid="ignore"):
        return Spread(float(np.median(values)), float(np.min(values)), float(np.max(values)), len(values))


@dataclass(frozen=True)
class Frequency:
    """Number of seeds that reached each verdict of a finding, the most frequent first."""

    counts: Mapping[Verdict, int]

    @property
    def seeds(self) -> int:
        """Number of seeds that decided the finding."""
        return sum(self.counts.values())

    @property
    def usual(self) -> Verdict:
        """The verdict that most seeds share."""
        return next(iter(self.counts))

    def depends_on_seed(self, verdict: Verdict) -> bool:
        """Whether some seed reaches another verdict."""
        return self.counts.get(verdict, 0) < self.seeds

    def against(self, verdict: Verdict) -> bool:
        """Whether more seeds reached another verdict than this one."""
        return self.counts.get(verdict, 0) < self.counts[self.usual]


@dataclass(frozen=True)
class BandwidthCoverage:
    """One method's bandwidth on one joint over the seeds.

    Attributes:
        hz: Bandwidth, Hz.
        half_power_hz: Frequency of the gain 0.707, Hz.
        ci95_width: Width of the 95 % intervals, Hz.
        covers: Number of seeds that agree with the best linear truth.
        near_1_hz: Number of seeds with a bandwidth of about 1 Hz.
    """

    hz: Spread
    half_power_hz: Spread
    ci95_width: Spread
    covers: int
    near_1_hz: int


@dataclass(frozen=True, eq=False)
class Tally:
    """The conclusions of many seeds.

    Attributes:
        outcomes: One for each seed that came to an end, in the order of the seeds.
        failed: Seeds that did not, with the reason.
        recorded: Whether it came with the package, made earlier, rather than in this run.
    """

    outcomes: tuple[SeedOutcome, ...]
    failed: Mapping[int, str]
    recorded: bool = False

    @property
    def duration(self) -> float | None:
        """Length of the records where it was shortened, s."""
        return self.outcomes[0].duration

    @property
    def cost(self) -> Cost:
        """Time spent on all seeds."""
        costs = [entry.cost for entry in self.outcomes]
        return Cost(*(sum(getattr(one, name) for one in costs) for name in ("physics_s", "simulation_s", "total_s")))

    def frequency(self, key: str) -> Frequency:
        """Return the frequency of each verdict of a finding (F1 to F26)."""
        counts = Counter(entry.verdicts[key] for entry in self.outcomes if key in entry.verdicts)
        return Frequency(dict(counts.most_common()))

    def spread(self, key: str) -> dict[str, Spread]:
        """Return the distributions of the numbers of a finding (F1 to F26), by name."""
        values: dict[str, list[float]] = {}
        for entry in self.outcomes:
            for name, value in entry.numbers.get(key, {}).items():
                values.setdefault(name, []).append(value)
        return {name: spread(entries) for name, entries in values.items()}

    def coverage(self) -> dict[str, dict[str, BandwidthCoverage]]:
        """Return the distributions of every method's bandwidth, by joint and method."""
        table: dict[str, dict[str, BandwidthCoverage]] = {}
        for joint, methods in self.outcomes[0].recovered.items():
            rows = {method: [entry.recovered[joint][method] for entry in self.outcomes] for method in methods}
            table[joint] = {
                method: BandwidthCoverage(
                    spread([entry.hz for entry in entries]),
                    spread([entry.half_power_hz for entry in entries]),
                    spread([entry.ci95[1] - entry.ci95[0] for entry in entries]),
                    sum(entry.covers for entry in entries),
                    sum(near_1_hz(entry.hz) for entry in entries),
                )
                for method, entries in rows.items()
            }
        return table


def write_tally(tally: Tally, path: Path) -> None:
    """Write a tally as JSON, a line for each seed."""
    lines = ",\n".join(json.dumps(plain_numbers(unstructure(entry)), allow_nan=False) for entry in tally.outcomes)
    failed = json.dumps({str(seed): why for seed, why in tally.failed.items()})
    write_whole(path, f'{{"failed": {failed},\n"seeds": [\n{lines}\n]}}\n')


def read_tally(text: str, *, recorded: bool = False) -> Tally:
    """Read the JSON that `write_tally` wrote, and mark whether it came with the package."""
    record = json.loads(text)
    outcomes = tuple(structure(SeedOutcome, entry) for entry in record["seeds"])
    return Tally(outcomes, {int(seed): why for seed, why in record["failed"].items()}, recorded)


def tally(
    seeds: Sequence[int],
    folder: Path,
    *,
    duration: float | None = None,
    threads: int | None = None,
    progress: Progress = lambda *_: None,
) -> Tally:
    """Run the study with every seed on the nominal arm and keep its conclusions.

    One seed's records are in memory at a time. The result does not depend on the number of threads.

    Args:
        seeds: The seeds.
        folder: Folder of the journal of finished seeds, from which an interrupted run resumes; seeds of other settings,
            versions or source text are run anew.
        duration: Length of every record instead of 240 s, s.
        threads: Threads of the simulation.
        progress: Called with every step.

    Raises:
        ScenarioError: Every seed failed, or the journal cannot be used.
    """
    setting = {"duration": duration, "versions": versions(), "sources": fingerprint()}
    made_with = sha256(json.dumps(setting, sort_keys=True).encode()).hexdigest()
    outcomes: list[SeedOutcome] = []
    failed: dict[int, str] = {}
    # Settings are part of the key, not of the journal's fingerprint: one folder serves studies of several lengths.
    with Journal(folder / JOURNAL, {"format": "thesis seeds"}) as journal:
        for number, seed in enumerate(seeds):
            key = f"{made_with} {seed}"
            if key not in journal:
                try:
                    conclusions = _run_seed(seed, duration, threads, partial(progress, seed, number))
                except (ScenarioError, TwinError, SysidError) as error:
                    failed[seed] = str(error)
                    continue
                journal.add(key, unstructure(conclusions))
            outcomes.append(structure(SeedOutcome, journal.get(key)))
    if not outcomes:
        raise ScenarioError(f"none of {len(seeds)} seeds came to a conclusion: {failed}")
    return Tally(tuple(outcomes), failed)


def _run_seed(
    seed: int, duration: float | None, threads: int | None, report: Callable[[str, int, int], None]
) -> SeedOutcome:
    """Run one seed from excitation to conclusions; its records are released on return."""
    arms = (NOMINAL,)
    steps = planned_steps(arms, duration, thorough=False, report=report)
    study = run_study(seed=seed, duration=duration, conditions=arms, thorough=False, threads=threads, steps=steps)
    begin = perf_counter()
    decided = findings(study)
    return outcome(replace(study, cost=study.cost.later(perf_counter() - begin)), decided)


@cache
def recorded() -> Tally:
    """The tally that comes with the package: whole records of the nominal arm, seeds 1 to 20."""
    text = resources.files("scenarios").joinpath("data", FILE).read_text(encoding="utf-8")
    return read_tally(text, recorded=True)
