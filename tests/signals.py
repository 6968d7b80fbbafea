"""Signals of child processes: those of a terminal, whatever the caller of the tests ignores (`nohup`, `trap ''`)."""

import signal
import subprocess

ENDS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
LIMIT = 60.0
"""Seconds that a child may take to end after a signal, before it is killed."""


def default_signals() -> None:
    """Restore the default handlers: `preexec_fn` of a child that is sent a signal, since it inherits ignored ones."""
    for number in ENDS:
        signal.signal(number, signal.SIG_DFL)


def end(process: "subprocess.Popen[str]", number: signal.Signals) -> tuple[str, str]:
    """Send a signal to a child and return what it still prints; kill it when it does not end."""
    process.send_signal(number)
    try:
        return process.communicate(timeout=LIMIT)
    except subprocess.TimeoutExpired:
        # Leaving `with Popen` waits without a limit: a child that goes on would hold up all tests.
        process.kill()
        raise
