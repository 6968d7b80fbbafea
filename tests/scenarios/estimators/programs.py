"""A program of every kind of behaviour, chosen by the seed of the task."""

import json
import os
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

GOOD = {"dt": 0.02, "num": [0.0, 0.2], "den": [1.0, -0.8]}
KINDS = (
    "good",
    "refuses",
    "fails",
    "dies",
    "hangs",
    "nothing",
    "two",
    "damaged",
    "leaves",
    "twice",
    "claims",
    "removes",
    "fails",
)


def main(task: str, model: str) -> int:
    kind = KINDS[json.loads(Path(task).read_text())["seed"]]
    if kind == "refuses":
        print("no such structure")
        return 77
    if kind == "fails":
        print("bad luck", file=sys.stderr)
        return 2
    if kind == "dies":
        os.kill(os.getpid(), signal.SIGSEGV)
    if kind == "hangs":
        signal.signal(signal.SIGTERM, signal.SIG_IGN)
        time.sleep(1000.0)
    if kind == "removes":
        shutil.rmtree(Path(model).parents[1])
        return 0
    if kind == "nothing":
        return 0
    if kind == "damaged":
        Path(f"{model}.nc").write_bytes(b"\x89HDF\r\n\x1a\n" + bytes(500))
        return 0
    if kind == "two":
        Path(f"{model}.mat").write_bytes(b"")
    if kind == "leaves":
        subprocess.Popen(["sleep", "1000.25"])
    Path(f"{model}.json").write_text(json.dumps(GOOD))
    return 0


def stay() -> None:
    print("a banner\nready 1", flush=True)
    for line in sys.stdin:
        paths = json.loads(line)
        kind = KINDS[json.loads(Path(paths["task"]).read_text())["seed"]]
        code = main(paths["task"], paths["model"])
        if kind == "claims":
            print("done -5", flush=True)
            continue
        print({0: "done", 77: "refused"}.get(code, "error"), "and so on\x1b[31m", flush=True)
        if kind == "twice":
            time.sleep(0.01)
            print("done", flush=True)


if __name__ == "__main__":
    if sys.argv[1] == "stay":
        stay()
    else:
        sys.exit(main(*sys.argv[2:4]))
