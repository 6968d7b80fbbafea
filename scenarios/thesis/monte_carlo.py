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
    finding_numbers = {}
    for finding in findings:
        finding_numbers[finding.key] = {name: float(value) for name, value in finding.value.items()}
    recovered: dict[str, dict[str, MethodBandwidth]] = {}
    for joint, result in study.joints.items():
        recovered[joint] = {}
        for model in result.models.values():
            bandwidth = MethodBandwidth(model.bandwidth_hz, model.ci95, model.covers, model.half_power_hz)
            recovered[joint][model.method] = bandwidth
    return SeedOutcome(
        seed=study.seed,
        duration=study.duration,
        verdicts={finding.key: finding.verdict for finding in findings},
        numbers=finding_numbers,
        true_hz={joint: float(result.truth.bandwidth_hz) for joint, result in study.joints.items()},
        recovered=recovered,
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
    """Distribution of a number, one value for each seed; NaN throughout where one value is NaN."""
    # A seed whose gain never falls to the limit has no bandwidth: leaving it out would show too narrow a range.
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
        # The mapping begins with the most frequent.
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
        costs = [outcome.cost for outcome in self.outcomes]
        return Cost(
            physics_s=sum(cost.physics_s for cost in costs),
            simulation_s=sum(cost.simulation_s for cost in costs),
            total_s=sum(cost.total_s for cost in costs),
        )

    def frequency(self, key: str) -> Frequency:
        """Return the frequency of each verdict of a finding, by its key."""
        counts = Counter(outcome.verdicts[key] for outcome in self.outcomes if key in outcome.verdicts)
        return Frequency(dict(counts.most_common()))

    def spread(self, key: str) -> dict[str, Spread]:
        """Return the distributions of the numbers of a finding, by its key, by name."""
        by_name: dict[str, list[float]] = {}
        for outcome in self.outcomes:
            for name, value in outcome.numbers.get(key, {}).items():
                by_name.setdefault(name, []).append(value)
        return {name: spread(values) for name, values in by_name.items()}

    def coverage(self) -> dict[str, dict[str, BandwidthCoverage]]:
        """Return the distributions of every method's bandwidth, by joint and method."""
        table: dict[str, dict[str, BandwidthCoverage]] = {}
        for joint, methods in self.outcomes[0].recovered.items():
            table[joint] = {}
            for method in methods:
                bandwidths = [outcome.recovered[joint][method] for outcome in self.outcomes]
                table[joint][method] = BandwidthCoverage(
                    hz=spread([bandwidth.hz for bandwidth in bandwidths]),
                    half_power_hz=spread([bandwidth.half_power_hz for bandwidth in bandwidths]),
                    ci95_width=spread([bandwidth.ci95[1] - bandwidth.ci95[0] for bandwidth in bandwidths]),
                    covers=sum(bandwidth.covers for bandwidth in bandwidths),
                    near_1_hz=sum(near_1_hz(bandwidth.hz) for bandwidth in bandwidths),
                )
        return table


def write_tally(tally: Tally, path: Path) -> None:
    """Write a tally as JSON, a line for each seed."""
    # One line a seed keeps differences between two versions of the file readable.
    lines = [json.dumps(plain_numbers(unstructure(outcome)), allow_nan=False) for outcome in tally.outcomes]
    seeds = ",\n".join(lines)
    failed = json.dumps({str(seed): why for seed, why in tally.failed.items()})
    write_whole(path, f'{{"failed": {failed},\n"seeds": [\n{seeds}\n]}}\n')


def read_tally(text: str, *, recorded: bool = False) -> Tally:
    """Read the JSON that `write_tally` wrote, and mark whether it came with the package."""
    record = json.loads(text)
    outcomes = tuple(structure(SeedOutcome, fields) for fields in record["seeds"])
    failed = {int(seed): why for seed, why in record["failed"].items()}
    return Tally(outcomes, failed, recorded)


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
    # Sorted, so that equal settings have equal hashes.
    setting_hash = sha256(json.dumps(setting, sort_keys=True).encode()).hexdigest()
    outcomes: list[SeedOutcome] = []
    failed: dict[int, str] = {}
    # Settings are part of the key, not of the journal's fingerprint: one folder serves studies of several lengths.
    with Journal(folder / JOURNAL, {"format": "thesis seeds"}) as journal:
        for finished, seed in enumerate(seeds):
            key = f"{setting_hash} {seed}"
            if key not in journal:
                try:
                    conclusions = _run_seed(seed, duration, threads, partial(progress, seed, finished))
                # A seed without conclusions does not end the others: it is counted as failed.
                except (ScenarioError, TwinError, SysidError) as error:
                    failed[seed] = str(error)
                    continue
                journal.add(key, unstructure(conclusions))
            # New conclusions are read back too: a resumed run gives the same numbers as one in one go.
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
    # The cost has the findings too: what a user waits for.
    return outcome(replace(study, cost=study.cost.later(perf_counter() - begin)), decided)


@cache
def recorded() -> Tally:
    """The tally that comes with the package: whole records of the nominal arm, seeds 1 to 20."""
    text = resources.files("scenarios").joinpath("data", FILE).read_text(encoding="utf-8")
    return read_tally(text, recorded=True)
