"""`hmtb`, also as `python -m scenarios`: the command line, which Ctrl-C ends in one line at any moment."""

import os
import shlex
import signal
import sys
from types import FrameType

ENDS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
"""Ctrl-C, a batch system, a terminal that is closed."""


def run() -> int:
    """Run the command line with the words of the process; see `scenarios.commands.cli.main`."""
    for number in ENDS:
        if signal.getsignal(number) is not signal.SIG_IGN:  # else the caller ignores it, as nohup
            signal.signal(number, _interrupt)
    for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
        # the matrices are small: threads that wait for each other cost up to fifty times what they give
        os.environ.setdefault(name, "1")
    for name in ("MPLBACKEND", "SOURCE_DATE_EPOCH"):  # figures are files without a date, whatever these hold
        os.environ.pop(name, None)
    try:
        from scenarios.commands.cli import main

        code = main()
        _discard_unwritable()
        return code
    except KeyboardInterrupt:
        _leave()
        raise
    finally:
        for number in ENDS:  # a second one would end the process before it has closed what is open
            signal.signal(number, signal.SIG_IGN)


def _discard_unwritable() -> None:
    """Discard what stdout and stderr cannot write, of which `main` has spoken.

    Python flushes them once more at its end, and would replace the exit code by 120 and print lines of its own.
    """
    for stream in (sys.stdout, sys.stderr):
        try:
            stream.flush()
        except OSError:
            null = os.open(os.devnull, os.O_WRONLY)
            os.dup2(null, stream.fileno())


def _interrupt(_: int, frame: FrameType | None) -> None:
    # Compiled modules turn a KeyboardInterrupt during their import into errors of their own, or lose it.
    while frame is not None:
        if frame.f_code.co_filename.startswith("<frozen importlib"):
            _leave()
        frame = frame.f_back
    raise KeyboardInterrupt


def _leave() -> None:
    line = f"hmtb: interrupted; run the command again: {shlex.join(['hmtb', *sys.argv[1:]])}"
    if os.isatty(2):
        os.write(2, b"\r\x1b[K\x1b[?25h")  # the line of progress goes, the cursor that it hides comes back
    os.write(2, f"{''.join(c if c.isprintable() else '?' for c in line)}\n".encode())
    os._exit(130)


if __name__ == "__main__":
    sys.exit(run())
