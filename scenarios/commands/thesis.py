"""`hmtb thesis`: the whole study."""

from pathlib import Path

from scenarios.commands.output import json_text, output_folder, print_json, print_table, progress, say


def thesis(
    *,
    out: Path = Path("thesis-report"),
    seed: int | None = None,
    quick: bool = False,
    threads: int | None = None,
    logs: bool = False,
    json: bool = False,
) -> int:
    """Run the whole study and write report.html: simulate, identify, compare with the truth, report.

    24 single-joint tests of 240 s on three joints are simulated; each joint is identified from its PRBS test with the
    thesis' structures (ARMAX, output error, OKID) and validated on the other seven; the models are laid beside the
    true dynamics and beside the published ones.

    Args:
        out: Folder for report.html and results.json; those of an earlier run are replaced.
        seed: Draw other noise; without it the scenarios' own seeds are used.
        quick: Records of 40 s instead of 240 s: a look, not a result.
        threads: Threads of the simulation; the results do not depend on it.
        logs: Keep the logs too, as NetCDF4.
        json: Print the results as JSON.
    """
    from scenarios.datafile import write_log
    from scenarios.errors import ScenarioError

    if threads is not None and threads < 1:
        raise ScenarioError(f"threads must be 1 or more, given {threads}")
    if seed is not None and seed < 0:
        raise ScenarioError(f"seed must be 0 or more, given {seed}")
    with output_folder(out) as folder:
        from scenarios.thesis.findings import findings
        from scenarios.thesis.report import write_report
        from scenarios.thesis.results import answer, results
        from scenarios.thesis.study import run_study
        from scenarios.whole_file import check_place, write_whole

        for name in ("report.html", "results.json"):
            check_place(folder / name)
        with progress("study") as bar:
            comparison = run_study(
                seed=seed,
                duration=40.0 if quick else None,
                threads=threads,
                progress=lambda step, done, total: bar(done, total),
            )
        found = findings(comparison)
        report = write_report(comparison, found, folder / "report.html")
        record = results(comparison, found, report)
        if logs:
            for log in comparison.logs.values():
                write_log(log, folder / f"{log.name}.nc")
        write_whole(folder / "results.json", json_text(record))
    if json:
        print_json(record)
        return 1 if comparison.failed else 0
    for name, entry in comparison.joints.items():
        rows = [
            (
                model.label + (" *" if model.chosen else ""),
                f"{model.bandwidth_hz:.3f}",
                f"{model.ci95[0]:.3f} to {model.ci95[1]:.3f}",
                "yes" if model.covers else "no",
            )
            for model in entry.models.values()
        ]
        rows += [(f"published {model.label}", f"{model.bandwidth_hz:.3f}", "", "") for model in entry.published]
        title = f"{name}: true bandwidth {entry.truth.bandwidth_hz:.3f} Hz"
        print_table(title, ("model (* chosen by the thesis)", "Hz", "95 % interval", "holds the truth"), rows)
    print_table("Findings", ("", "verdict", "claim"), [(entry.key, entry.verdict, entry.claim) for entry in found])
    say(answer(comparison))
    say(f"Report: {report}")
    for name, reason in comparison.failed.items():
        say(f"failed: {name}: {reason}")
    return 1 if comparison.failed else 0
