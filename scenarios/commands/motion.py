"""`hmtb motion`: how far did the arm of the thesis move, and against what friction?"""

from pathlib import Path

from scenarios.commands.output import draw, json_text, output_folder, print_json, progress, say, say_each, say_next
from scenarios.files.errors import ScenarioError

FILES = ("motion.json", "motion.csv", "motion.png", "motion.svg")
"""Files of --out beside the journal."""


def motion(
    *,
    out: Path = Path("motion"),
    quick: bool = False,
    workers: int | None = None,
    overwrite: bool = False,
    json: bool = False,
) -> int:
    """How far did the arm of the thesis move, against what friction?

    The thesis prints neither the unit of the hand controller's gain nor friction, servo, valves, noise and drift. Every
    setting of these is tried on the three joints with 10 binary sequences; the models that the thesis' methods recover
    are scored against everything that it prints. The answer: which settings explain it, whether one arm explains all
    joints, and the map of recovered bandwidth over motion and friction.

    It takes two and a half hours of two free processors. Finished settings are saved; an interrupted run resumes.

    Args:
        out: Folder for motion.json, motion.csv (a row for every cell), the map, motion.png and .svg, and the journal.
        quick: A coarse look of some two minutes, no result: one servo, few levels, two seeds.
        workers: Processes; all processors when not given. The results do not depend on it.
        overwrite: Replace the results of another campaign in the folder, without a question.
        json: Print JSON.
    """
    from hmtb_twin.files.atomic_write import write_whole
    from scenarios.datasets.tables import table_text
    from scenarios.jobs.executor import LocalProcesses
    from scenarios.thesis.motion import JOURNAL, MotionCampaign, run_campaign
    from scenarios.thesis.motion_answer import motion_record, motion_texts
    from scenarios.thesis.motion_score import cells
    from scenarios.thesis.motion_section import motion_map

    campaign = MotionCampaign.quick() if quick else MotionCampaign()
    # A journal takes no other campaign: the files beside it are those of this one.
    resumes = (out / JOURNAL).exists()
    with (
        output_folder(out, *FILES, overwrite=overwrite or resumes) as folder,
        progress("settings", lines=True) as bar,
    ):
        try:
            with LocalProcesses(workers) as executor:
                results = run_campaign(campaign, executor, folder, bar)
        except KeyboardInterrupt:
            raise KeyboardInterrupt(f"finished settings are saved in {folder}") from None
        failed = []
        for setting, rows in results.items():
            failed += [f"{setting}, {row['failed']}" for row in rows if "failed" in row]
        scored = cells(results)
        if not scored:
            reason = failed[0] if failed else "without a reason"
            raise ScenarioError(f"every experiment failed, the first: {reason}")
        record = motion_record(campaign, scored, failed)
        table = [cell.record() for cell in scored]
        columns: dict[str, None] = {}  # in the sequence in which they come first: cells differ in what they know
        for row in table:
            columns |= dict.fromkeys(row)
        files = [folder / "motion.json", folder / "motion.csv"]
        write_whole(files[0], json_text(record))
        write_whole(files[1], table_text(columns, table))
        files += draw(lambda: motion_map(record["map"]), folder / "motion.png", folder / "motion.svg")
    if json:
        print_json({**record, "files": files})
    else:
        if quick:
            say("A coarse look at few arms, which decides nothing: without --quick the campaign is run.")
        say_each("", motion_texts(record))
        say_each("failed: ", failed)
        say_each("written: ", files)
        say_next("thesis", "--motion", files[0])
    return 1 if failed else 0
