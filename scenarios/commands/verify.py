"""`hmtb verify`: any estimator on the test bench."""

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import tyro

from scenarios.commands.output import output_folder, print_json, print_table, say, say_beside_bar

if TYPE_CHECKING:
    from scenarios.bench.progress import Cost
    from scenarios.bench.result import Result
    from scenarios.bench.verify import BenchPlan
    from scenarios.jobs.executor import Executor

MOST_GIB = 2.0**20
"""More memory than there is, GiB."""


def verify(
    estimators: Annotated[tuple[str, ...], tyro.conf.Positional, tyro.conf.arg(metavar="ESTIMATOR")] = (),
    /,
    *,
    command: str | None = None,
    stays: bool = False,
    name: str = "",
    structure: Literal["arx", "armax", "oe", "bj", "ss"] | None = None,
    method: Literal["pem", "least_squares", "instrumental", "subspace", "observer"] | None = None,
    quick: bool = False,
    records: int | None = None,
    seed: int | None = None,
    out: Path = Path("results"),
    figures: tuple[str, ...] = (),
    seconds: float = 30.0,
    memory_gib: float = 2.0,
    workers: int | None = None,
    cluster: str | None = None,
    patience: float = 300.0,
    list: bool = False,
    verbose: bool = False,
    json: bool = False,
) -> int:
    """Test an estimator on problems with known truth: ten figures, each with a verdict.

    An estimator is a function that takes a record and a task and returns a model, or a program in any language that
    reads a file and writes one (docs/your-estimator.md). It runs in a process of its own with limits of time and
    memory: errors, crashes, hangs, NaN and unstable models are counted and never end the bench.

      hmtb verify my_module:my_estimator --quick           a function of a module in this folder
      hmtb verify my_file.py:my_estimator --structure oe   of a file; its models are output-error models
      hmtb verify --command "octave-cli my.m {mat} {task} {model}" --name mine
      hmtb verify my_module:my_estimator our-oe our-n4sid  beside others, on the same records, at the same time
      hmtb verify --list                                   the estimators that the bench knows

    With --structure and --method the estimator is judged by what theory expects of them. Without, it receives the
    orders of each system in its own structure, and every figure is expected to pass. The verdicts together fail an
    estimator that is as good as the Cramér-Rao bound allows in one of 200 runs at most.

    After ten hangs in a row an estimator gets no more requests: the rest of its trials count as hung.

    Finished trials are saved in OUT/journals. Run the command again to resume an interrupted run; the full bench also
    resumes from --quick, which is a part of it. If the file of the estimator has changed, or a file of its folder that
    it imports, its trials start afresh.

    Exit code 1: an estimator fails a figure that theory expects it to pass.

    Args:
        estimators: MODULE:FUNCTION, FILE.py:FUNCTION, or names of --list.
        command: A program instead; {mat}, {data} (NetCDF) or {csv} becomes the file of the record, {task} the file of
            the task, {model} the file of the answer.
        stays: The program is started once and receives each task on its standard input.
        name: Name of your estimator in tables and files; by default that of its function or program.
        structure: Structure of its models; without it, the structure of each system.
        method: Kind of its method, for what theory expects.
        quick: A tenth of the records, and fewer problems: minutes, and wider limits.
        records: At most so many records of each problem, for an estimator that takes seconds: wider limits still, and
            below 11 no verdict on bias.
        seed: Seed of the records. Without it, it is drawn once the files of the estimators have been hashed, so that
            nobody can know the records in advance; the result states it.
        out: Folder for results, one file for each estimator, NAME.json; hmtb leaderboard makes a page of them. A run
            with fewer figures or records never replaces a result there; it needs another folder.
        figures: Only these.
        seconds: Time limit of an answer, s; then the process is ended, and the trial is a hang.
        memory_gib: Memory limit, GiB.
        workers: Processes for trials; all processors by default. Only times depend on it.
        cluster: Address of a Dask scheduler, tcp://HOST:8786, whose workers run the trials with this package.
        patience: How long to wait for a lost scheduler or for missing workers, s.
        list: List the estimators that the bench knows, and whether they can run here.
        verbose: Print everything that a verdict rests on, and every part that fails; files and pages have all parts.
        json: Print JSON.
    """
    if list:
        return _listed(json=json)
    from scenarios.bench.estimator_files import EstimatorOptions, parse_estimators
    from scenarios.bench.metrics import metrics_named
    from scenarios.bench.verify import BenchPlan
    from scenarios.commands.verify_output import record, show
    from scenarios.estimators.estimator import Limits
    from scenarios.estimators.known_estimators import KNOWN
    from scenarios.files.errors import ScenarioError

    commands = parse_estimators(estimators, command, EstimatorOptions(name, structure, method, stays))
    effort = "quick" if quick else "full"
    if not 0.0 < memory_gib <= MOST_GIB:
        raise ScenarioError(f"--memory-gib {memory_gib:g} given, expected more than 0 and at most {MOST_GIB:.0f} GiB")
    limits = Limits(seconds, round(memory_gib * 2**30))
    options = _options(quick, records, figures, seconds, memory_gib)
    plan = BenchPlan(
        tuple(commands),
        effort,
        seed,
        limits,
        metrics_named(figures),
        KNOWN["referee"].estimator,
        {contestant.name: f"hmtb verify {words}{options}" for contestant, words in commands.items()},
        records,
    )
    executor = _executor(workers, cluster, patience)
    with output_folder(out) as folder:
        results = _run(plan, folder, executor)
    if json:
        print_json(record(results, out))
    else:
        show(results, out, verbose=verbose)
    return 0 if all(result.passed for result in results) else 1


def _executor(workers: int | None, cluster: str | None, patience: float) -> "Executor[Any]":
    from scenarios.files.errors import ScenarioError
    from scenarios.jobs.executor import LocalProcesses

    if cluster is None:
        return LocalProcesses(workers, say_beside_bar)
    if workers is not None:
        raise ScenarioError("--workers and --cluster given; expected one: the cluster has workers of its own")
    from scenarios.jobs.cluster import Cluster

    return Cluster(cluster, patience, say_beside_bar)


def _options(quick: bool, records: int | None, figures: Sequence[str], seconds: float, memory_gib: float) -> str:
    """Options on which a result depends, as the command line has them where they are not the usual ones."""
    words = ["--quick"] * quick + [f"--records {records}"] * (records is not None)
    words += [f"--figures {' '.join(figures)}"] * bool(figures)
    words += [f"--seconds {seconds:g}"] * (seconds != 30.0) + [f"--memory-gib {memory_gib:g}"] * (memory_gib != 2.0)
    return "".join(f" {word}" for word in words)


def _run(plan: "BenchPlan", folder: Path, executor: "Executor[Any]") -> "list[Result]":
    from scenarios.bench.verify import JOURNALS, verify
    from scenarios.jobs.progress import Progress, show_progress

    latest = (0, 0)

    def announce(cost: "Cost") -> None:
        if cost.requests:
            say_beside_bar(f"hmtb verify: still to do, of {_requests(plan)}: {cost}")

    with show_progress("hmtb verify") as report:

        def count(done: int, total: int, left: float | None) -> None:
            nonlocal latest
            latest = (done, total)
            # The first trials start processes: their pace says nothing of the others'.
            note = "the first of each kind" if left is None and done < total else ""
            report(Progress("", done, total, items="requests", left=left, note=note))

        try:
            return verify(plan, folder, executor, report=count, notify=say_beside_bar, announce=announce)
        except KeyboardInterrupt:
            done, total = latest
            raise KeyboardInterrupt(f"{done} of {total} trials kept in {folder / JOURNALS}") from None


def _requests(plan: "BenchPlan") -> str:
    """How many requests a run makes, and of whom."""
    counts = {contestant.name: len(plan.trials(contestant)) for contestant in plan.all_contestants()}
    own = sum(counts.pop(contestant.name) for contestant in plan.contestants)
    beside = "".join(f" and {count} to {name} for the figure of agreement" for name, count in counts.items())
    return f"{own} requests{beside}"


def _listed(*, json: bool) -> int:
    """Print the estimators that the bench knows."""
    from scenarios.estimators.known_estimators import KNOWN, available

    rows = []
    for name, entry in KNOWN.items():
        can_run, why = available(name)
        one = entry.versioned() if can_run else entry.estimator
        rows.append((one, can_run, why))
    if json:
        keys = ("structure", "method", "version", "settings")
        entries = {
            one.name: {**{key: getattr(one, key) for key in keys}, "available": can_run, "why": why}
            for one, can_run, why in rows
        }
        print_json({"estimators": entries})
        return 0
    cells = [
        (one.name, one.structure or "any", one.method or "", one.version or "yes" if can_run else "no", one.settings)
        for one, can_run, _ in rows
    ]
    print_table("Estimators that the bench knows", ("", "structure", "method", "here", "settings"), cells)
    for _, _, why in rows:
        if why:
            say(why)
    return 0
