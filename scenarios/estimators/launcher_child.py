"""The process that starts programs for `Launcher`. It loads little, so that it starts soon."""

import os
import socket
import subprocess
import sys
from functools import partial
from typing import Any

from scenarios.estimators.launcher_messages import receive, send
from scenarios.estimators.parent_death import die_with_parent, take_orphans
from scenarios.estimators.process_tree import end_all, family


def serve(control: socket.socket) -> None:
    """Start programs and wait for them until there is no more to do.

    Args:
        control: Over which requests come: a command with its pipes, or the number of a process to wait for.
    """
    take_orphans()
    send(control, {})
    started: dict[int, subprocess.Popen[bytes]] = {}
    while True:
        try:
            asked, ends = receive(control)
        except (OSError, ValueError):
            # The bench is gone: so is everything here.
            end_all(lambda: set(family(os.getpid())) - {os.getpid()}, 0)
            return
        if "wait" in asked:
            send(control, waited(asked["wait"], started))
            continue
        try:
            process = launch(asked, ends)
        except OSError as error:
            send(control, {"error": error.strerror})
        else:
            started[process.pid] = process
            send(control, {"pid": process.pid})
        for end in ends:
            os.close(end)


def launch(asked: dict[str, Any], ends: list[int]) -> "subprocess.Popen[bytes]":
    """Start a program.

    Args:
        asked: `command`, `folder`, `environment`.
        ends: Standard input, output and error; or one for both of the latter.

    Raises:
        OSError: It cannot be started.
    """
    request, reply, printed = ends if len(ends) > 1 else (subprocess.DEVNULL, ends[0], ends[0])
    return subprocess.Popen(
        asked["command"],
        stdin=request,
        stdout=reply,
        stderr=printed,
        cwd=asked["folder"],
        env=asked["environment"],
        start_new_session=True,
        preexec_fn=partial(die_with_parent, os.getpid()),
    )


def waited(pid: int, started: "dict[int, subprocess.Popen[bytes]]") -> dict[str, Any]:
    """Status and processor time of a program that has ended, that of the children that it waited for included."""
    _, status, usage = os.wait4(pid, 0)
    process = started.pop(pid)
    process.returncode = os.waitstatus_to_exitcode(status)
    while not started:
        try:
            # What it left has been ended with it; this forgets it.
            if os.waitpid(-1, os.WNOHANG)[0] == 0:
                break
        except ChildProcessError:
            break
    return {"status": status, "seconds": usage.ru_utime + usage.ru_stime}


if __name__ == "__main__":
    with socket.socket(fileno=int(sys.argv[1])) as bench:
        serve(bench)
