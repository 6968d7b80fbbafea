"""`hmtb dataset build`: a data set from its spec."""

import sys
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import tyro

from scenarios.commands.build_progress import How, build_progress
from scenarios.commands.output import print_json, say

MOST_REASONS = 20
"""Reasons of failures that are told."""

if TYPE_CHECKING:
    from scenarios.datasets.build_progress import Progress
    from scenarios.datasets.executor import Executor


def build(
    spec: Annotated[str | None, tyro.conf.Positional, tyro.conf.arg(metavar="SPEC")] = None,
    /,
    *,
    out: Path = Path("."),
    hide_truth: Annotated[Path | None, tyro.conf.arg(metavar="KEYFILE")] = None,
    students: Annotated[Path | None, tyro.conf.arg(metavar="ROSTER")] = None,
    key: Annotated[Path | None, tyro.conf.arg(metavar="KEYFILE")] = None,
    workers: int | None = None,
    rows: int | None = None,
    cluster: str | None = None,
    patience: float = 300.0,
    progress: How = "auto",
    json: bool = False,
) -> int:
    """Build a data set into a folder of its own, or go on with a build that was interrupted.

    Nothing is lost if a build is interrupted, killed or out of disk: the same command goes on from there and ends in
    the same bytes. An experiment that fails is noted with its reason; the rest goes on, and the exit code is 1.

    With --hide-truth what is made holds nothing from which the truth can be computed: the outputs of scored records
    behind the window, the truth and every seed go into a key file, which grades what is handed in.

      hmtb dataset build class.toml --hide-truth class.key --students roster.txt

    Args:
        spec: One that comes with the package (hmtb dataset list) or a TOML file.
        out: Folder in which that of the data set is made.
        hide_truth: Keep the truth apart, in this file; it must not be there, or be that of the build to go on with.
        students: A data set for each student, with arms, noise and waveforms of its own: a text file, one id per line.
        key: Instead of SPEC: build the data sets of a key file again, with the same bits.
        workers: Threads for the physics, all processors by default; the data do not depend on it.
        rows: Experiments that run side by side at most: fewer need less memory; the data do not depend on it.
        cluster: Address of a Dask scheduler, tcp://HOST:8786, whose workers run the experiments with this package.
        patience: How long a scheduler that has gone, or workers that are not there, are waited for, s.
        progress: How stderr shows how far the build is; auto is a bar on a terminal, else a line now and then.
        json: Print JSON.
    """
    from scenarios.datasets.build import build as build_data_set
    from scenarios.datasets.chunk import MOST_ROWS
    from scenarios.datasets.layout import UNFINISHED
    from scenarios.datasets.spec import load_spec
    from scenarios.files.errors import ScenarioError

    if workers is not None and workers < 1:
        raise ScenarioError(f"workers must be 1 or more, given {workers}")
    executor = None
    if cluster is not None:
        from scenarios.datasets.cluster import ROWS, Cluster

        if workers is not None:
            raise ScenarioError("--workers and --cluster given; expected one: Dask's workers have threads of their own")
        executor, usual = Cluster(cluster, patience=patience, said=_said), ROWS
    else:
        usual = MOST_ROWS
    if students is not None and hide_truth is None:
        raise ScenarioError(
            "--students given without --hide-truth KEYFILE, which keeps what tells their data sets apart"
        )
    if key is not None and (spec is not None or hide_truth is not None):
        raise ScenarioError("--key given beside SPEC or --hide-truth; expected it alone: the key holds its spec")
    if spec is None and key is None:
        raise ScenarioError("missing SPEC; see hmtb dataset build --help")
    if key is not None or hide_truth is not None:
        work = Work(workers, usual if rows is None else rows, executor, progress)
        return _build_hidden(spec, out, key, hide_truth, students, work, json=json)
    read = load_spec(str(spec))
    if read.secret_seed:
        raise ScenarioError(
            f"{spec} has a secret seed, which {out / read.label} would tell; build it with --hide-truth"
        )
    latest: list[Progress] = []
    with build_progress(read.label, progress) as show:

        def told(now: "Progress") -> None:
            latest[:] = [now]
            show(now)

        try:
            built = build_data_set(
                read, out, workers=workers, rows=usual if rows is None else rows, executor=executor, progress=told
            )
        except KeyboardInterrupt:
            raise KeyboardInterrupt(_kept(latest, out / (read.label + UNFINISHED))) from None
    if json:
        print_json({"path": built.path, "experiments": built.experiments, "failed": built.failed, "hash": built.hash})
    else:
        _say_failed(built.failed)
        say(f"{built.path}: {built.experiments} experiments, {len(built.failed)} failed, hash {built.hash[:12]}")
    return 1 if built.failed else 0


@dataclass(frozen=True)
class Work:
    """How the work is done; the data do not depend on it."""

    workers: int | None
    rows: int
    executor: "Executor | None"
    progress: How


def _build_hidden(
    spec: str | None, out: Path, key: Path | None, hide: Path | None, roster: Path | None, work: Work, *, json: bool
) -> int:
    """Build data sets whose truth is kept apart, from a spec or again from a key."""
    from scenarios.datasets.challenge_build import build_again, build_hidden, private_folder
    from scenarios.datasets.challenge_key import read_key
    from scenarios.datasets.challenge_roster import read_roster
    from scenarios.datasets.spec import load_spec

    path = key or hide
    assert path is not None  # noqa: S101 - the caller has one of them
    label = read_key(path).spec.label if key is not None else load_spec(str(spec)).label
    with build_progress(label, work.progress) as show:
        try:
            if key is not None:
                made = build_again(
                    key, out, workers=work.workers, rows=work.rows, executor=work.executor, progress=show
                )
            else:
                made = build_hidden(
                    load_spec(str(spec)),
                    out,
                    path,
                    students=read_roster(roster) if roster is not None else (),
                    workers=work.workers,
                    rows=work.rows,
                    executor=work.executor,
                    progress=show,
                )
        except KeyboardInterrupt:
            raise KeyboardInterrupt(f"what was done is kept in {private_folder(path)}") from None
    if json:
        print_json({"paths": made.paths, "key": made.key, "failed": made.failed})
    else:
        _say_failed(made.failed)
        for folder in made.paths:
            say(str(folder))
        say(f"{made.key}: keep it secret and safe: without it nothing can be graded")
    return 1 if made.failed else 0


def _say_failed(failed: Mapping[str, str]) -> None:
    """What could not be made: a reason that many share is said once."""
    names: dict[str, list[str]] = {}
    for name, why in failed.items():
        # The laboratory names the experiment too; those of a student's data set are said with its label.
        names.setdefault(why.removeprefix(f"{name.rpartition(': ')[2]}: "), []).append(name)
    for why, same in list(names.items())[:MOST_REASONS]:
        say(f"failed: {same[0]}{f' and {len(same) - 1} more' if len(same) > 1 else ''}: {why}")
    if len(names) > MOST_REASONS:
        say(f"failed: {sum(map(len, list(names.values())[MOST_REASONS:]))} more, for other reasons; the index has them")


def _said(line: str) -> None:
    """A line on stderr; a bar that is there stays below it."""
    sys.stderr.write(f"{line}\n")
    sys.stderr.flush()


def _kept(latest: "list[Progress]", folder: Path) -> str:
    """What is kept of an interrupted build."""
    if not latest or not folder.is_dir():
        return ""
    (now,) = latest
    done = f"{now.done} of {now.total} experiments" if now.seconds_total else "all experiments"
    return f"{done if now.step != 'check' else 'what was done'} kept in {folder}"
