"""Renew the measured tables of `docs` and `docs/measured`. Run by `make verification`, or with words to choose by.

A table begins with a comment that names its command and ends with another; what the command prints replaces the text
between them. The sentences of the pages that quote a table are not renewed: correct them by hand. A command that fails
leaves its table as it was, and so does one that needs the FOLDER of measured data where none is given.
"""

import argparse
import re
import shlex
import subprocess
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[2]))

from tests.benchmarks.tables import ROOT, environment

BLOCK = re.compile(r"<!-- measured by: (?P<command>.+?) -->\n.*?<!-- end -->", re.DOTALL)

FOLDER = "FOLDER"  # word of a command that stands for where the measured data are, which this repository does not hold

TALK = re.compile(r"=|\.+$|\(\d+ durations|\d+ passed|[\d.]+s (call|setup|teardown)")
"""What the test runner says of itself."""


def measured(command, folder):
    """Run a command at the root of the project and return its output as Markdown.

    Raises:
        RuntimeError: The command failed.
    """
    words = [str(folder) if word == FOLDER else word for word in shlex.split(command)]
    words[0] = sys.executable if words[0] == "python" else words[0]
    run = subprocess.run(words, cwd=ROOT, capture_output=True, text=True, check=False, env=environment())
    if run.returncode:
        lines = (run.stderr.strip() or run.stdout.strip() or "nothing").splitlines()
        raise RuntimeError(f"exit {run.returncode}, said at last: {lines[-1]}")
    lines = [line for line in run.stdout.splitlines() if not TALK.match(line)]
    if any(line.startswith("|---") for line in lines):
        # a table begins behind an empty line
        return "\n".join(lines).strip("\n ")
    return "\n".join(("```text", *filter(str.strip, lines), "```"))


def main():
    """Renew the blocks whose command holds one of the words given, or all."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("words", nargs="*", help="of the commands to run; all when none is given")
    parser.add_argument("--data", type=Path, help="folder with the measured data")
    asked = parser.parse_args()
    folder = asked.data.resolve() if asked.data else None
    return 1 if sum(_renew(page, asked.words, folder) for page in sorted((ROOT / "docs").rglob("*.md"))) else 0


def _renew(path, words, folder):
    """Renew the blocks of a page and return how many could not be."""
    page, failed = path.read_text(encoding="utf-8"), 0
    for block in list(BLOCK.finditer(page)):
        command = block["command"]
        if words and not any(word in command for word in words):
            continue
        if folder is None and FOLDER in shlex.split(command):
            print(f"==> {command}\n    left as it was: make verification DATA=... names the folder", flush=True)
            continue
        print(f"==> {command}", flush=True)
        try:
            renewed = f"<!-- measured by: {command} -->\n{measured(command, folder)}\n<!-- end -->"
        except RuntimeError as error:
            failed += 1
            print(f"    left as it was: {error}", flush=True)
            continue
        page = page.replace(block[0], renewed)
        path.write_text(page, encoding="utf-8")
    return failed


if __name__ == "__main__":
    sys.exit(main())
