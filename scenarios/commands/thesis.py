"""`hmtb thesis`: the whole study, from simulation to report."""

from collections.abc import Mapping, Sequence
from contextlib import ExitStack
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from scenarios.commands.output import json_text, output_folder, print_json, print_tables, say, say_each, say_next

if TYPE_CHECKING:
    from scenarios.experiments.campaign import Condition
    from scenarios.thesis.answer import Answer
    from scenarios.thesis.comparison import Comparison
    from scenarios.thesis.findings import Finding
    from scenarios.thesis.monte_carlo import Tally

QUICK = 40.0
"""Length of the records of a preview, s."""


def thesis(
    *,
    out: Path = Path("thesis-report"),
    seed: int | None = None,
    seeds: int = 1,
    quick: bool = False,
    threads: int | None = None,
    figures: bool = False,
    motion: Path | None = None,
    logs: bool = False,
    overwrite: bool = False,
    json: bool = False,
) -> int:
    """Run the whole study and write its report, report.html.

    All tests in the two tables of the thesis and the exchange of the replacement unit are simulated on the nominal arm;
    those that the report compares, also without friction and on the published arm. Each joint is identified with the
    methods of chapters III to V and judged on other records. The models are compared with the true dynamics and with
    the published models, and each of the thesis' findings gets a verdict.

    Args:
        out: Folder for report.html, results.json and the folder tables with the long tables as CSV.
        seed: Seed of the noise; when not given, each scenario has its own.
        seeds: Repeat the study on the nominal arm with so many seeds, counted from --seed or from 1, and report how
            often each verdict is reached and how far numbers vary. A seed takes some minutes on two processors; it is
            saved in the folder seeds when it ends, and an interrupted run resumes there. With 1, the report states
            how often each verdict came out in the repetition that this version ships with.
        quick: A preview within about a minute: records of 40 s instead of 240 s, on the nominal arm alone, without the
            searches for orders and the disturbed records. The answer says how sure it is.
        threads: Threads of the simulation; the results do not depend on it.
        figures: Keep every figure too, as SVG and PNG and its values as CSV in the folder figures.
        motion: A motion.json of hmtb motion for the section on how far the arm moved; when not given, that of the whole
            campaign, which comes with this version.
        logs: Keep the logs too, as NetCDF4.
        overwrite: Replace files that exist, without a question.
        json: Print the results as JSON.
    """
    from hmtb_twin.files.atomic_write import write_whole
    from scenarios.experiments.waveform import seed_range
    from scenarios.files.data_file import write_log
    from scenarios.thesis.answer import answer_texts
    from scenarios.thesis.campaign import CONDITIONS
    from scenarios.thesis.monte_carlo import recorded
    from scenarios.thesis.motion_section import read_motion
    from scenarios.thesis.results import results

    motion_results = read_motion(motion)
    first_seed = 1 if seed is None else seed
    repeated = seed_range(seeds, first_seed)
    duration, conditions = (QUICK, CONDITIONS[:1]) if quick else (None, CONDITIONS)
    with ExitStack() as stack:
        files = _replaced_files(out, figures=figures, logs=logs)
        folder = stack.enter_context(output_folder(out, *files, overwrite=overwrite))
        pictures = folder / "figures" if figures else None
        if pictures is not None:
            stack.enter_context(output_folder(pictures))
        conclusions: Tally | None
        if seeds > 1:
            # First, because each seed is saved as it ends: an interruption later costs none of them.
            seed_folder = stack.enter_context(output_folder(folder / "seeds"))
            conclusions = _run(repeated, duration, threads, seed_folder)
        else:
            conclusions = None if quick else recorded()  # nothing is recorded of short records
        comparison, verdicts, answer, report = _study(
            folder / "report.html",
            conclusions,
            motion_results,
            pictures,
            seed=seed,
            duration=duration,
            conditions=conditions,
            threads=threads,
        )
        *sentences, certainty = answer_texts(answer, motion_results)
        record = {**results(comparison, verdicts, report, conclusions), "answer": " ".join(sentences)}
        record |= {"certainty": certainty, "responses": answer.record()}
        # Before the logs: a disk that is full with them costs no conclusion.
        write_whole(folder / "results.json", json_text(record))
        if logs:
            for log in comparison.logs.values():
                write_log(log, folder / f"{log.name}.nc")
    failures = _failures(comparison.failed, conclusions)
    if json:
        print_json(record)
        return 1 if failures else 0
    _print(record, conclusions, seed)
    say_each("", (*sentences, certainty))
    say_each("failed: ", failures)
    say(f"Report: {report}, a page for a browser")
    next_words = ("thesis", "--out", f"{out}-whole") if quick else ("motion",)
    say_next(*next_words)
    return 1 if failures else 0


def _study(
    page: Path,
    conclusions: "Tally | None",
    motion_results: "Mapping[str, Any]",
    pictures: Path | None,
    *,
    seed: int | None,
    duration: float | None,
    conditions: "Sequence[Condition]",
    threads: int | None,
) -> "tuple[Comparison, Sequence[Finding], Answer, Path]":
    """Run the study, answer its questions, judge the findings, and write the report."""
    from scenarios.jobs.progress import Progress, show_progress
    from scenarios.thesis.answer import measure_answer
    from scenarios.thesis.findings import findings
    from scenarios.thesis.report import write_report
    from scenarios.thesis.study import planned_steps, run_study

    thorough = duration is None  # a preview leaves out the searches for orders and the disturbed records
    with show_progress("study") as show:
        steps = planned_steps(
            conditions,
            duration,
            thorough=thorough,
            afterwards=("answer", "findings", "report"),
            report=lambda step, done, total: show(Progress(step, done, total, weighted=True)),
        )
        comparison = run_study(
            seed=seed, duration=duration, conditions=conditions, thorough=thorough, threads=threads, steps=steps
        )
        with steps.step("answer") as bar:
            answer = measure_answer(comparison, threads=threads, progress=bar)
        with steps.step("findings"):
            verdicts = findings(comparison)
        # The report states what the study has cost so far; its own cost is known afterwards.
        judged_s = steps.seconds["answer"] + steps.seconds["findings"]
        comparison = replace(comparison, cost=comparison.cost.later(judged_s))
        with steps.step("report") as bar:
            report = write_report(
                comparison, verdicts, answer, page, conclusions, figures=pictures, motion=motion_results, progress=bar
            )
        comparison = replace(comparison, cost=comparison.cost.later(steps.seconds["report"], report=True))
    return comparison, verdicts, answer, report


def _replaced_files(out: Path, *, figures: bool, logs: bool) -> list[str]:
    """Names of the files that the study may replace, relative to its folder."""
    from scenarios.thesis.campaign import EVERY_TEST

    files = ["report.html", "results.json"]
    if logs:
        files += [f"{test}.nc" for test in EVERY_TEST]
    # Which tables and figures there will be, only the study knows: those of an earlier one stand for them.
    patterns = ["tables/*.csv"]
    if figures:
        patterns += ["figures/*.svg", "figures/*.png", "figures/*.csv"]
    for pattern in patterns:
        files += [str(path.relative_to(out)) for path in sorted(out.glob(pattern))]
    return files


def _failures(failed: Mapping[str, str], conclusions: "Tally | None") -> list[str]:
    """What failed in the study, and in the repetition with other seeds if it ran now."""
    failures = [f"{name}: {why}" for name, why in failed.items()]
    if conclusions is None or conclusions.recorded:
        return failures
    failures += [f"seed {seed}: {why}" for seed, why in conclusions.failed.items()]
    for outcome in conclusions.outcomes:
        failures += [f"seed {outcome.seed}, {name}: {why}" for name, why in outcome.failed.items()]
    return failures


def _print(record: Mapping[str, Any], conclusions: "Tally | None", seed: int | None) -> None:
    from scenarios.thesis.frequencies import source_text
    from scenarios.thesis.results import result_tables

    print_tables(result_tables(record))
    if conclusions:
        say(source_text(conclusions, seed))


def _run(seeds: range, duration: float | None, threads: int | None, folder: Path) -> "Tally":
    """Conclusions of many seeds, computed now."""
    from scenarios.jobs.progress import Progress, show_progress
    from scenarios.thesis.monte_carlo import tally

    with show_progress(f"{len(seeds)} seeds") as show:

        def report(seed: int, before: int, step: str, done: int, steps: int) -> None:
            name = f"seed {seed}, {before + 1} of {len(seeds)}: {step}"
            show(Progress(name, before * steps + done, len(seeds) * steps, weighted=True))

        try:
            return tally(seeds, folder, duration=duration, threads=threads, progress=report)
        except KeyboardInterrupt:
            raise KeyboardInterrupt(f"finished seeds are saved in {folder}") from None
