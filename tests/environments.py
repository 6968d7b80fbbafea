"""Run the tests as other people start them: `python tests/environments.py [NAME ...]`, all where no name is given.

Another shell, another language, another time zone, another order and ignored signals must change no verdict. Each run
is `make test`, with the arguments after `--` for pytest.
"""

import os
import shlex
import signal
import subprocess
import sys
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path

ROOT = Path(__file__).parents[1]

# Of the environment that this runs in: none is made anew.
COMMAND = ("make", f"VENV={sys.prefix}", "test")


def ignore_signals() -> None:
    """Ignore what `nohup` and shell scripts ignore; children inherit it."""
    for number in (signal.SIGINT, signal.SIGHUP, signal.SIGTERM):
        signal.signal(number, signal.SIG_IGN)


@dataclass(frozen=True)
class Environment:
    """How the tests are started.

    Attributes:
        variables: Variables of the environment that are set.
        bare: Whether no other variables are set, as under `env -i`.
        prepare: Called in the child before it starts.
        arguments: Further arguments of pytest.
    """

    variables: Mapping[str, str] = field(default_factory=dict)
    bare: bool = False
    prepare: Callable[[], object] | None = None
    arguments: tuple[str, ...] = ()


def private_files() -> None:
    """Nobody else may read what is written."""
    os.umask(0o077)


ENVIRONMENTS = {
    "bare": Environment(bare=True),
    "private": Environment(prepare=private_files),
    "language": Environment({"LC_ALL": "C"}),
    "time-zone": Environment({"TZ": "Asia/Kathmandu"}),
    "order": Environment(arguments=("--shuffle", "1")),
    "signals": Environment(prepare=ignore_signals),
}


def run(environment: Environment, arguments: list[str]) -> int:
    """Run the tests in an environment: the exit code of make."""
    inherited = {} if environment.bare else dict(os.environ)
    command = [*COMMAND, f"OPTIONS={shlex.join([*environment.arguments, *arguments])}"]
    variables = {**inherited, **environment.variables}
    return subprocess.run(command, cwd=ROOT, env=variables, preexec_fn=environment.prepare).returncode


def main() -> int:
    """Run the environments that are named, or all: 1 if tests fail in one of them, 2 for an unknown name."""
    words = sys.argv[1:]
    end = words.index("--") if "--" in words else len(words)
    names, arguments = words[:end] or list(ENVIRONMENTS), words[end + 1 :]
    unknown = [name for name in names if name not in ENVIRONMENTS]
    if unknown:
        print(f"unknown environment {', '.join(unknown)}; there are {', '.join(ENVIRONMENTS)}", file=sys.stderr)
        return 2
    codes = {}
    for name in names:
        print(f"==> {name}", flush=True)
        codes[name] = run(ENVIRONMENTS[name], arguments)
    failed = [name for name, code in codes.items() if code]
    print(f"failed in: {', '.join(failed)}" if failed else f"passed in: {', '.join(codes)}")
    return int(bool(failed))


if __name__ == "__main__":
    sys.exit(main())
