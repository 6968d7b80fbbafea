"""Starts a process of ours in a session of its own, supervised."""

import os
import subprocess
import uuid
from collections.abc import Mapping, Sequence
from functools import partial
from pathlib import Path

from scenarios.estimators import process_tree
from scenarios.estimators.parent_death import die_with_parent
from scenarios.estimators.pipes import Pipes
from scenarios.estimators.supervised import Supervised

ONE_THREAD = {
    name: "1"
    for name in (
        *("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "BLIS_NUM_THREADS"),
        *("NUMEXPR_NUM_THREADS", "VECLIB_MAXIMUM_THREADS"),
    )
}
"""With one thread each, times of estimators compare."""


def start(command: Sequence[str], *, folder: Path, environment: Mapping[str, str]) -> Supervised:
    """Start a process.

    Args:
        command: Program and arguments; `{request}` and `{reply}` become the numbers of its pipes.
        folder: In which it runs.
        environment: Added to this process's own.

    Raises:
        OSError: It cannot be started.
    """
    mark = uuid.uuid4().hex
    pipes = Pipes.open(channel=True)
    request, reply, printed = pipes.theirs
    numbers = {"{request}": str(request), "{reply}": str(reply)}
    try:
        process = subprocess.Popen(
            [numbers.get(word, word) for word in command],
            stdin=subprocess.DEVNULL,
            stdout=printed,
            stderr=printed,
            cwd=folder,
            env=child_environment(environment, mark),
            pass_fds=(request, reply),
            start_new_session=True,
            # It sets a flag and takes no lock, whatever other threads hold.
            preexec_fn=partial(die_with_parent, os.getpid()),
        )
    except BaseException:
        pipes.close()
        raise
    pipes.hand_over()

    def members() -> list[int]:
        return process_tree.family(process.pid)

    def finish() -> tuple[int, float]:
        # Until it is waited for its number stays its own, and its exit code what it was if it has ended by itself.
        process_tree.end_all(lambda: {*members(), *process_tree.marked(mark)}, process.pid)
        _, status, usage = os.wait4(process.pid, 0)
        process.returncode = os.waitstatus_to_exitcode(status)
        return process.returncode, usage.ru_utime + usage.ru_stime

    return Supervised(process.pid, pipes, members, finish)


def child_environment(added: Mapping[str, str], mark: str) -> dict[str, str]:
    """The environment of a process of an estimator: one thread, and a mark by which it is known."""
    return {**os.environ, **ONE_THREAD, **added, process_tree.MARK: mark}
