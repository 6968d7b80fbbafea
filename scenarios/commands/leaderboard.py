"""`hmtb leaderboard`: results of the test bench side by side."""

from pathlib import Path
from typing import Annotated

import tyro

from scenarios.commands.output import output_folder, print_json, print_table, say


def leaderboard(
    results: Annotated[tuple[Path, ...], tyro.conf.Positional],
    /,
    *,
    out: Path = Path("."),
    json: bool = False,
) -> int:
    """Lay results of estimators on the test bench side by side.

    hmtb leaderboard results/*.json

    Results are the files that hmtb verify writes, or folders of them. The page leaderboard.html needs no network; the
    same tables stand in leaderboard.md. Rows are ordered by the number of figures that fail where theory expects
    them to pass, the fewest first, then by figures without a verdict, then by figures passed, then by efficiency; no
    score is made of several figures. The response error is the median over the problems that all rows were asked; a
    row that did not answer them all has none. Where rows are not comparable, because seed, effort, limits, protocol or
    machine differ, or an estimator refused requests, the page says so.

    Args:
        results: Files, or folders whose *.json are taken.
        out: Folder for both pages.
        json: Print JSON.
    """
    from scenarios.bench.leaderboard_comparable import notes
    from scenarios.bench.leaderboard_page import write_leaderboard
    from scenarios.bench.leaderboard_ranking import RULE, ranked
    from scenarios.bench.leaderboard_response_error import compared, median_error
    from scenarios.bench.leaderboard_tables import standing
    from scenarios.bench.leaderboard_verdict import count, judged_figures, verdict

    entries = ranked(results)
    with output_folder(out):
        page, text = write_leaderboard(entries, out)
    if json:
        judged, problems = judged_figures(entry.result for entry in entries), compared(entries)
        print_json(
            {
                "page": page,
                "markdown": text,
                "rows": [
                    {
                        "number": entry.number,
                        "name": entry.name,
                        "file": entry.path,
                        "passed": entry.result.passed,
                        "counts": {v.word: n for v, n in count(map(entry.figure, judged)).items()},
                        "response_error_percent": median_error(entry, problems),
                        "verdicts": {name: verdict(f).word for name, f in entry.result.figures.items()},
                        "values": {name: f.value for name, f in entry.result.figures.items()},
                        "failures": entry.result.outcomes,
                        "refused": entry.result.refused,
                    }
                    for entry in entries
                ],
                "notes": notes(entries),
            }
        )
        return 0
    table = standing(entries)
    rows = [tuple(f"{c.text} {c.verdict.sign}" if c.verdict else c.text for c in row) for row in table.rows]
    print_table(table.caption, table.columns, rows)
    for note in notes(entries):
        say(f"note: {note}")
    say(RULE)
    say(f"{page} and {text} written")
    return 0
