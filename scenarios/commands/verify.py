"""`hmtb verify`: any estimator on the test bench; `hmtb leaderboard`: results of several, compared."""

from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import tyro

from scenarios.commands.output import (
    check_files,
    cluster_executor,
    output_folder,
    print_json,
    print_table,
    progress,
    say,
    say_beside_bar,
    say_each,
    say_next,
)
from scenarios.files.errors import ScenarioError

if TYPE_CHECKING:
    from scenarios.bench.leaderboard import Leaderboard
    from scenarios.bench.result import Result
    from scenarios.bench.verify import BenchPlan
    from scenarios.jobs.executor import Executor

MOST_GIB = 2.0**20
"""Largest memory limit accepted, GiB."""

SECONDS, MEMORY_GIB = 30.0, 2.0
"""Usual limits of an answer."""


def verify(
    estimators: Annotated[tuple[str, ...], tyro.conf.Positional, tyro.conf.arg(metavar="ESTIMATOR")] = (),
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
    seconds: float = SECONDS,
    memory_gib: float = MEMORY_GIB,
    workers: int | None = None,
    cluster: str | None = None,
    patience: float = 300.0,
    list: bool = False,
    verbose: bool = False,
    overwrite: bool = False,
    json: bool = False,
) -> int:
    """Test an estimator on problems with known truth: 13 figures.

    An estimator is a function that takes a record and a task and returns a model, or a program in any language that
    reads a file and writes one (docs/your-estimator.md). It runs in a process of its own with limits of time and
    memory: errors, crashes, hangs, NaN and unstable models are counted and never end the bench. Ten figures judge the
    model, two judge failures and time, and one, the bandwidth, is only shown.

      hmtb verify my_module:my_estimator --quick           a function of a module in this folder
      hmtb verify my_file.py:my_estimator --structure oe   of a file; its models are output-error models
      hmtb verify --command "octave-cli my.m {mat} {task} {model}" --name mine
      hmtb verify my_module:my_estimator our-oe our-n4sid  beside others, on the same records, at the same time
      hmtb verify --list                                   the estimators that the bench knows

    Most tasks tell the estimator the true orders and delay (in the structure of --structure, otherwise in that of the
    system); some ask it to choose them. With --structure and --method the estimator is judged by what theory expects of
    them; without, every figure is expected to pass. An estimator as good as the Cramér-Rao bound allows has at least
    one failing verdict in at most one of 200 runs.

    After ten hangs in a row an estimator gets no more requests: the rest of its trials count as hung.

    Finished trials are saved in OUT/journals. Run the command again to resume an interrupted run; the full bench also
    resumes from --quick, which is a part of it. Trials start afresh if the file of the estimator has changed, or a file
    of its folder that it imports.

    Exit code 1: an estimator fails a figure that theory expects it to pass.

    Args:
        estimators: MODULE:FUNCTION, FILE.py:FUNCTION, or names of --list.
        command: A program instead; {mat}, {data} (NetCDF) or {csv} becomes the file of the record, {task} the file of
            the task, {model} the file of the answer.
        stays: Start the program once; it receives each task on its standard input.
        name: Name of your estimator in tables and files; by default that of its function or program.
        structure: Structure of its models; when not given, that of each system.
        method: Kind of its method: what theory expects depends on it.
        quick: A tenth of the records and fewer problems: takes minutes, and its limits are wider.
        records: Most records of each problem, for an estimator that takes seconds: limits are wider still, and below 11
            there is no verdict on bias.
        seed: Seed of the records. Without it, it is drawn once the files of the estimators have been hashed, so that
            nobody can know the records in advance; the result states it.
        out: Folder for results, one file for each estimator, NAME.json; hmtb leaderboard makes a page of them. A run
            with fewer figures or records never replaces a result there; it needs another folder.
        figures: Names of figures: only these are computed.
        seconds: Time limit of an answer, s; a process that takes longer is ended, and its trial counts as a hang.
        memory_gib: Memory limit, GiB.
        workers: Processes for trials; all processors by default. Only times depend on it.
        cluster: Address of a Dask scheduler, tcp://HOST:8786, whose workers run the trials with this package.
        patience: How long to wait for a lost scheduler or for missing workers, s.
        list: List the estimators that the bench knows, and whether they can run here.
        verbose: Print all that a verdict rests on, and every part that fails; result files and pages have all parts.
        overwrite: Replace files that exist, without a question.
        json: Print JSON.
    """
    # Before the imports below: the list does not need the bench.
    if list:
        return _listed(json=json)
    from scenarios.bench.estimator_files import EstimatorOptions, parse_estimators
    from scenarios.bench.metrics import metrics_named
    from scenarios.bench.verify import BenchPlan
    from scenarios.commands.verify_output import record, show
    from scenarios.estimators.estimator import Limits
    from scenarios.estimators.known_estimators import KNOWN
    from scenarios.jobs.executor import LocalProcesses

    commands = parse_estimators(estimators, command, EstimatorOptions(name, structure, method, stays))
    if not 0.0 < memory_gib <= MOST_GIB:
        raise ScenarioError(f"--memory-gib {memory_gib:g} given, expected more than 0 and at most {MOST_GIB:.0f} GiB")
    # The command that repeats the result, with the options on which it depends.
    words = _result_options(quick=quick, records=records, figures=figures, seconds=seconds, memory_gib=memory_gib)
    repeated = {estimator.name: " ".join(("hmtb verify", word, *words)) for estimator, word in commands.items()}
    plan = BenchPlan(
        tuple(commands),
        "quick" if quick else "full",
        seed,
        Limits(seconds, round(memory_gib * 2**30)),
        metrics_named(figures),
        KNOWN["referee"].estimator,
        repeated,
        records,
    )
    if cluster is None:
        executor: Executor[Any] = LocalProcesses(workers, say_beside_bar)
    else:
        executor = cluster_executor(cluster, patience, workers)
    with output_folder(out) as folder:
        results = _run(plan, folder, executor, partial(check_files, overwrite=overwrite))
    if json:
        print_json(record(results, out))
    else:
        show(results, out, verbose=verbose)
        say_next("leaderboard", out, "--out", out)
    return 0 if all(result.passed for result in results) else 1


def _result_options(
    *, quick: bool, records: int | None, figures: tuple[str, ...], seconds: float, memory_gib: float
) -> list[str]:
    """Options on which the result depends, where they are not the usual ones."""
    words = []
    if quick:
        words.append("--quick")
    if records is not None:
        words.append(f"--records {records}")
    if figures:
        words.append(f"--figures {' '.join(figures)}")
    if seconds != SECONDS:
        words.append(f"--seconds {seconds:g}")
    if memory_gib != MEMORY_GIB:
        words.append(f"--memory-gib {memory_gib:g}")
    return words


def _run(
    plan: "BenchPlan", folder: Path, executor: "Executor[Any]", replaces: Callable[[Path], None]
) -> "list[Result]":
    from scenarios.bench.verify import JOURNALS, verify
    from scenarios.jobs.progress import Progress, show_progress

    latest = Progress("", 0, 0)

    with show_progress("hmtb verify") as report:

        def keep_and_report(progress: Progress) -> None:
            nonlocal latest
            if progress.items:  # requests, not simulated records
                latest = progress
            report(progress)

        try:
            return verify(plan, folder, executor, replaces=replaces, report=keep_and_report, notify=say_beside_bar)
        except KeyboardInterrupt:
            kept = f"{latest.done} of {latest.total} trials kept in {folder / JOURNALS}"
            raise KeyboardInterrupt(kept) from None


def _listed(*, json: bool) -> int:
    """Print the estimators that the bench knows."""
    from scenarios.estimators.known_estimators import KNOWN

    records, cells = {}, []
    for name, known in KNOWN.items():
        why = known.missing()
        # The version is asked of the software itself, which must be there.
        estimator = known.estimator if why else known.versioned()
        fields = {key: getattr(estimator, key) for key in ("structure", "method", "version", "settings")}
        records[name] = {**fields, "available": not why, "why": why}
        here = "no" if why else estimator.version or "yes"
        cells.append((name, estimator.structure or "any", estimator.method or "", here, estimator.settings))
    if json:
        print_json({"estimators": records})
        return 0
    print_table("Estimators that the bench knows", ("", "structure", "method", "here", "settings"), cells)
    say_each("", (record["why"] for record in records.values() if record["why"]))
    return 0


def leaderboard(
    results: Annotated[tuple[Path, ...], tyro.conf.Positional],
    *,
    out: Path = Path("."),
    overwrite: bool = False,
    json: bool = False,
) -> int:
    """Compare results of hmtb verify on a page and in tables.

    Results are the files that hmtb verify writes, or folders of them. The page leaderboard.html needs no network; the
    same tables stand in leaderboard.md. Rows are ordered by the number of figures that fail where theory expects
    them to pass, the fewest first, then by figures without a verdict, then by figures passed, then by efficiency;
    figures are never combined into one score. The response error is the median over the problems that all rows were
    given; a row that did not answer them all has none. Where rows are not comparable, because seed, effort,
    limits, protocol or machine differ, or an estimator refused requests, the page says so.

      hmtb leaderboard results/*.json

    Args:
        results: Files, or folders whose *.json are taken.
        out: Folder for both pages.
        overwrite: Replace files that exist, without a question.
        json: Print JSON.
    """
    from scenarios.bench.leaderboard import ranked
    from scenarios.bench.leaderboard_notes import notes
    from scenarios.bench.leaderboard_page import write_leaderboard
    from scenarios.bench.leaderboard_tables import standing
    from scenarios.bench.leaderboard_words import RULE

    board = ranked(results)
    with output_folder(out, "leaderboard.html", "leaderboard.md", overwrite=overwrite), progress("leaderboard"):
        page, text = write_leaderboard(board, out)
    if json:
        print_json({"page": page, "markdown": text, "rows": _ranked_records(board), "notes": notes(board)})
        return 0
    print_table(*standing(board).as_text())
    say_each("note: ", notes(board))
    say(RULE)
    say(f"{page} and {text} written")
    say_next("verify", "--list")
    return 0


def _ranked_records(board: "Leaderboard") -> list[dict[str, object]]:
    """Rows of the leaderboard as JSON, in their sequence."""
    from scenarios.bench.metric import Verdict

    records: list[dict[str, object]] = []
    for row in board.rows:
        counts = row.verdicts(board.judged)
        metrics = row.result.metrics
        records.append(
            {
                "number": row.number,
                "name": row.name,
                "file": row.path,
                "passed": row.result.passed,
                "counts": {verdict.word: counts[verdict] for verdict in Verdict},
                "response_error_percent": row.median_error(board.problems),
                "verdicts": {name: metric.verdict.word for name, metric in metrics.items()},
                "values": {name: metric.value for name, metric in metrics.items()},
                "failures": row.result.outcomes,
                "refused": row.result.refused,
            }
        )
    return records
