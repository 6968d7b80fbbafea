"""`hmtb leaderboard`: results of several estimators on the test bench, compared."""

from pathlib import Path
from typing import Annotated

import tyro

from scenarios.commands.output import output_folder, print_json, print_table, progress, say, say_each, say_next


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
    from scenarios.bench.leaderboard_notes import notes
    from scenarios.bench.leaderboard_page import write_leaderboard
    from scenarios.bench.leaderboard_rows import RULE, common_problems, ranked
    from scenarios.bench.leaderboard_tables import standing
    from scenarios.bench.leaderboard_verdict import count, judged_metrics, verdict

    rows = ranked(results)
    with output_folder(out, "leaderboard.html", "leaderboard.md", overwrite=overwrite), progress("leaderboard"):
        page, text = write_leaderboard(rows, out)
    if json:
        judged, problems = judged_metrics(row.result for row in rows), common_problems(rows)
        entries = [
            {
                "number": row.number,
                "name": row.name,
                "file": row.path,
                "passed": row.result.passed,
                "counts": {word.word: times for word, times in count(map(row.metric, judged)).items()},
                "response_error_percent": row.median_error(problems),
                "verdicts": {name: verdict(metric).word for name, metric in row.result.metrics.items()},
                "values": {name: metric.value for name, metric in row.result.metrics.items()},
                "failures": row.result.outcomes,
                "refused": row.result.refused,
            }
            for row in rows
        ]
        print_json({"page": page, "markdown": text, "rows": entries, "notes": notes(rows)})
        return 0
    table = standing(rows)
    cells = [tuple(f"{c.text} {c.verdict.sign}" if c.verdict else c.text for c in line) for line in table.rows]
    print_table(table.caption, table.columns, cells)
    say_each("note: ", notes(rows))
    say(RULE)
    say(f"{page} and {text} written")
    say_next("verify", "--list")
    return 0
