"""Hostile files and words for every reader and command: none may end in a traceback, a signal or a hang.

    python tests/benchmarks/hostile_input.py [--cases 5000] [--seed 0] [--case N]

A case is a call that works, with one of its files damaged or exchanged, or one of its words changed. It runs in a fork
of this process, which has loaded everything, with 60 s of processor time, 180 s in all, and 4 GiB of memory; the calls
of `LONG` are interrupted after 3 s. It passes if it ends with exit code 0, 1, 2, or 130 where it is interrupted, if 2
and 130 come with one line `hmtb: ...` of at most 2000 printable characters, if no traceback and no partial file is
left. Seed and number of a case define it: `--case N` repeats one. The files of those that fail remain in the temporary
folder. The command `view` is left out, which needs a display.
"""

import inspect
import os
import re
import resource
import shutil
import signal
import sys
import tempfile
import traceback
from collections import Counter
from contextlib import redirect_stdout
from io import StringIO
from pathlib import Path

import h5py
import numpy as np
from scipy.io import savemat

from scenarios.commands.cli import PROGRAMS, _command, main
from tests.benchmarks.tables import ROOT, heading, options, row
from tests.sysid.records.test_message_logs import mcap_json, rosbag1, rosbag2

SECONDS, MEMORY, LONGEST = 60, 4 * 2**30, 2000

NUMBERS = ["nan", "inf", "-inf", "-1", "0", "1e308", "-1e308", "1e400", "1e-308", "9" * 30, "0x10", "1_0", "٣", "1,5"]
TEXTS = ["", " ", "../../etc/passwd", "/dev/null", ".", "/", "~", "--json", "-", "--", "%s%n", "{0}", "$(id)", "NaN"]
TEXTS += ["<script>", "None", "\x00", "\x1b[2J", "\u202e", "\udcff", "a\nb", "é" * 300, "x" * 10**5, "[" * 5000]
VALUES = ["null", "true", "-1", "0.5", "9" * 400, "1e999", "NaN", '""', '"../x"', "[]", "[[]]", "{}", '{"a": 1}']
VALUE = re.compile(r'"[^"]*"|-?[0-9][0-9.eE+-]*|null|true|false')

CALLS = """
compare @run.nc --models truth oe:2/2 --out @out/figure.svg
compare @table.csv --models @model.json arx:2/2 --estimation @table.mat
convert @run.nc @out/other.mat --lossy; convert @run.ch10 @out/other.csv; convert @run.mat @out/other.nc
bandwidth --data @run.nc --methods arx --no-bla; track @table.csv --calibration 5 --order 2; truth --variant nominal
simulate @scenario.toml --out @out --duration 0.2; scenarios show @scenario.toml; preview @scenario.toml --out @out
simulate siso-5-elbow_pitch --out @out --duration 0.2 --format nc,csv,1553
waveform file --path @points.txt --out @out; waveform prbs --amplitude 1 --clock 2 --out @out
waveform sine --amplitude 1 --frequency 2 --out @out; waveform white_noise --amplitude 1 --seed 1 --out @out
dataset list; dataset show @spec.toml; dataset build @spec.toml --out @out --workers 1; dataset check @data
dataset export @data --format csv,mat --out @out; dataset score @predictions --data @data
dataset baselines @data --method arx --orders 2 2; dataset grade @withheld @submissions
dataset get hmtb-siso-v1 --cache @out --workers 1; leaderboard @our-arx.json --out @out; completion bash
verify our-arx --quick --records 2 --figures efficiency --seed 1 --out @out
control reach --method @following.json --reference @model-reference.json --duration 2 --threads 1
thesis --quick --motion @motion.json --threads 1 --out @out; motion --quick --workers 1 --out @out
video @run.nc --duration 0.1 --out @out/film.gif; station --no-browser --out @out
identify @run.csv --joint elbow_pitch --method oe --orders 2 2 1
"""
LONG = ("dataset get", "verify", "control", "thesis", "motion", "video", "station")
"""Beginnings of the calls that take minutes or do not end by themselves; they are interrupted after 3 s."""

TABLES = ("run.nc", "run.mat", "run.asc", "run.ch10", "table.csv", "table.txt", "table73.mat", "table.nc")
LOGGED = "--input /cmd.data --output /joint_states.position[elbow]"
KINDS = [call.strip() for line in CALLS.strip().splitlines() for call in line.split(";")]
KINDS += [f"identify @{name} --method arx --orders 2 2 1" for name in TABLES]
KINDS += [f"identify @{name} --method oe --orders 2 2 1 {LOGGED}" for name in ("robot", "robot.mcap", "robot.bag")]
KINDS += ["identify @table.mat --method n4sid --orders 2 --save @out/model.json --out @out"]

SPEC = """name = "tiny"
version = 1
title = "Tiny"
seed = 7
baselines = {models = ["hold", "arx:2/2"]}
[[records]]
name = "test"
part = "test"
axes = ["elbow_pitch"]
duration = 4.0
draw_waveforms = true
excitation = [{kind = "white_noise", amplitude = 0.5}]
"""


def material():
    """Write the files that the calls read into the working folder."""
    rng = np.random.default_rng(0)
    t, u = np.arange(400) * 0.02, np.repeat(rng.choice([-1.0, 1.0], 100), 4)
    y = np.convolve(u, 0.1 * 0.9 ** np.arange(50))[:400] + 0.01 * rng.standard_normal(400)
    np.savetxt("points.txt", u[:100])
    np.savetxt("table.csv", np.column_stack((t, u, y)), delimiter=",", header="t,u,y", comments="")
    np.savetxt("table.txt", np.column_stack((t, u, y)), header="t u y", comments="")
    savemat("table.mat", {"u": u[:, None], "y": y[:, None], "Ts": 0.02}, do_compression=True)
    for name, block, shape in (("table73.mat", 512, (1, -1)), ("table.nc", 0, -1)):
        with h5py.File(name, "w", userblock_size=block) as file:
            for key, values in (("t", t), ("u", u), ("y", y)):
                file.create_dataset(key, data=values.reshape(shape), chunks=True, compression="gzip")
                file[key].attrs["MATLAB_class"] = np.bytes_("double")
    mcap_json(Path("robot.mcap"))
    rosbag1(Path("robot.bag"))
    rosbag2(Path("robot"), "SQLITE3")
    spec = SPEC + SPEC[SPEC.index("[[records]]") :].replace("test", "train")
    Path("spec.toml").write_text(spec)
    twins = '[truth]\nfloors = 0\n[twins]\ncount = 1\nkp = {kind = "lognormal", spread = 0.1}\n'
    Path("class.toml").write_text(spec.replace("tiny", "class") + twins)
    Path("scenario.toml").write_text(printed("scenarios show siso-5-elbow_pitch"))
    printed("simulate siso-5-elbow_pitch --duration 12 --format nc,csv,mat,ascii,1553")
    for file in Path().glob("siso-5-elbow_pitch.*"):
        file.rename(f"run{file.suffix}")
    printed("identify table.csv --method oe --orders 2 2 1 --save model.json")
    printed("control reach --duration 2 --out .")
    shutil.copy(ROOT / "scenarios/data/motion.json", ".")
    printed("dataset build spec.toml")
    Path("tiny-v1").rename("data")
    printed("dataset build class.toml --withhold withheld --out public")
    for records, answers in (("data/data/test", "predictions"), ("public/class-v1/data/test", "submissions")):
        Path(answers).mkdir()
        for record in Path(records).glob("*.nc"):
            np.savetxt(f"{answers}/{record.stem}.csv", np.zeros((200, 1)), header="elbow_pitch", comments="")
    printed("identify run.nc --method oe --orders 2 2 1 --save submissions/model-elbow_pitch.json")
    printed("verify our-arx --quick --records 2 --figures efficiency --seed 1 --out .")


def printed(words):
    """What a command prints that must succeed."""
    with redirect_stdout(StringIO()) as stream:
        assert main(words.split()) in (0, 1), words
    return stream.getvalue()


def damaged(content, rng):
    """The bytes of a file after one to three accidents, or what somebody wrote by hand."""
    for _ in range(rng.integers(1, 4)):
        start, length = (int(rng.integers(most)) for most in (len(content) + 1, 400))
        before, part, after = content[:start], content[start : start + length], content[start + length :]
        flipped = bytes([part[0] ^ 1 << rng.integers(8), *part[1:]]) if part else b"\0"
        parts = (flipped, rng.bytes(len(part)), bytes(len(part)), b"\xff" * len(part), b"", part + part)
        others = [*(before + one + after for one in parts), before, *[rewritten(content, rng)] * 3]
        content = others[int(rng.integers(len(others)))]
    return content


def rewritten(content, rng):
    """The file as text with a number, a word or a line exchanged; other bytes as they are."""
    try:
        text = content.decode()
    except UnicodeDecodeError:
        return content
    if text.startswith("{") and rng.random() < 0.7:  # JSON with one value exchanged
        start, end = rng.choice([match.span() for match in VALUE.finditer(text)] or [(0, 0)])
        return (text[:start] + str(rng.choice(VALUES)) + text[end:]).encode(errors="replace")
    lines = text.splitlines() or [""]
    at = int(rng.integers(len(lines)))
    words = lines[at].replace(",", " , ").replace("=", " = ").split() or [""]
    new = str(rng.choice(NUMBERS if rng.random() < 0.5 else TEXTS))
    words[int(rng.integers(len(words)))] = repr(new) if rng.random() < 0.2 else new
    long = str(rng.choice(["[" * 20_000, "{'a':" * 999, "\ufeff", ",,,,", ";" * 70_000, "a." * 5000 + "b=1"]))
    others = [*[[" ".join(words)]] * 3, [lines[at]] * 2, [], [long]]
    lines[at : at + 1] = others[int(rng.integers(len(others)))]
    return "\n".join(lines).encode(errors="replace")


def exchange(path, rng):
    """Replace a file by a good one that nobody expects."""
    odd = [np.zeros((0, 1)), np.zeros((400, 0)), np.zeros((20, 20, 2)), np.full(400, np.nan), np.full(400, 1j)]
    odd += [np.array(["a", "b"], object), np.array([[np.zeros((3, 3)), "x"]], object), np.ones((400, 1), np.int8)]
    odd += [np.ones(1), np.full((400, 1), 1e308), np.array("text"), np.zeros(400, bool), np.zeros((3000, 900))]
    if path.suffix == ".mat" and rng.random() < 0.7:
        cell = np.zeros((1, 1), object)
        for _ in range(int(rng.choice([0, 900]))):
            cell[0, 0], cell = cell, np.zeros((1, 1), object)
        values = {name: odd[int(rng.integers(len(odd)))] for name in ("u", "y")}
        savemat(path, {**values, "cell": cell, "dt": rng.choice([0.02, -1.0, np.nan])}, do_compression=True)
    elif path.suffix in (".nc", ".mat"):
        with h5py.File(path, "w") as file:
            length = int(rng.choice([1000, 10**6, 10**12]))  # of ones that take no room in the file
            file.create_dataset("u", (length, 1), chunks=(1000, 1), dtype=float, fillvalue=1.0)
            file["y"] = h5py.SoftLink("/y") if rng.random() < 0.5 else h5py.ExternalLink("/dev/zero", "/u")
            file["t"] = np.array([b"a", b"bc"], h5py.string_dtype())
            file.create_group("group")["self"] = h5py.SoftLink("/group")
    else:
        unit = str(rng.choice(["0,0,0\n", "1 2\n", "\0", "[", '{"a":', "\n", "1e5,", "'", "é,", "a = 1\n"]))
        path.write_bytes(unit.encode() * int(rng.choice([1, 1000, 2_000_000])))


def prepared(number, seed, place):
    """Return call and words of a case, with copies of its files; one of the files or words is hostile."""
    rng = np.random.default_rng((seed, abs(number)))
    call = KINDS[number if number < 0 else int(rng.integers(len(KINDS)))]
    words, leaves = [], []
    for word in call.split():
        name = word.removeprefix("@")
        if word.startswith("@") and not name.startswith("out"):
            source, copy = place.parent / "material" / name, place / name
            (shutil.copytree if source.is_dir() else shutil.copy)(source, copy)
            leaves += sorted(leaf for leaf in (copy, *copy.rglob("*")) if leaf.is_file())
        words.append(str(place / name) if word.startswith("@") else word)
    kind = rng.random()
    if number >= 0 and leaves and kind < 0.75:
        leaf, kind = leaves[int(rng.integers(len(leaves)))], rng.random()
        if kind < 0.75:
            leaf.write_bytes(damaged(leaf.read_bytes(), rng))
        elif kind < 0.95:
            exchange(leaf, rng)
        else:
            leaf.unlink()
            others = (leaf.mkdir, lambda: os.mkfifo(leaf), lambda: leaf.symlink_to("/dev/zero"), lambda: None)
            others[int(rng.integers(4))]()
    elif number >= 0:
        at, new = int(rng.integers(1, len(words) + 1)), str(rng.choice(NUMBERS + TEXTS))
        program, name = ("hmtb dataset", words[1]) if words[0] == "dataset" else ("hmtb", words[0])
        known = [*inspect.signature(_command(PROGRAMS[program]["commands"][name])).parameters]
        option = f"--{rng.choice(known).replace('_', '-')}"
        length, change = ((0, [option, new]), (0, [option]), (1, [new]), (0, [new]), (2, []))[int(rng.integers(5))]
        words[at : at + length] = change
    return call, words


def execute(words, place, patience):
    """Run a command in this forked process, interrupt it after `patience` seconds, and exit with its code."""
    for number, name in ((0, os.devnull), (1, place / "stdout"), (2, place / "stderr")):
        os.dup2(os.open(name, os.O_RDWR | os.O_CREAT), number)
    sys.stdout, sys.stderr = open(1, "w"), open(2, "w")  # noqa: SIM115 - to the end of the process
    resource.setrlimit(resource.RLIMIT_CPU, (SECONDS, SECONDS))
    resource.setrlimit(resource.RLIMIT_DATA, (MEMORY, MEMORY))
    signal.signal(signal.SIGALRM, signal.default_int_handler)
    signal.setitimer(signal.ITIMER_REAL, patience, SECONDS)
    os.chdir(place)
    try:
        code = main(words)
    except BaseException:
        code = 70
        traceback.print_exc()
    finally:
        sys.stdout.flush()
        sys.stderr.flush()
        os._exit(code)


def fault(code, place, codes):
    """Return why a case fails: a signal, a traceback, a wrong message or a partial file; empty if it passes."""
    err = (place / "stderr").read_text(errors="backslashreplace")
    last = (err.strip("\n").splitlines() or [""])[-1]
    if code < 0:
        return f"ended by {signal.Signals(-code).name}"
    if "Traceback" in err or code not in codes:
        return f"exit {code}: {last[:200]}"
    if code > 1 and not (last.startswith("hmtb: ") and len(last) <= LONGEST and last.isprintable()):
        return f"exit {code} without one line: {last[:200]!r}"
    partial = [path.name for path in place.rglob("*.partial")]
    return f"left {partial[0]}" if partial else ""


def bench():
    """Run the cases; print those that fail, then a table by command."""
    parser = options(__doc__)
    for name, value in (("cases", 5000), ("seed", 0), ("case", None)):
        parser.add_argument(f"--{name}", type=int, default=value)
    chosen, work = parser.parse_args(), Path(tempfile.gettempdir()) / "hostile-input"
    if not (work / "material/our-arx.json").is_file():
        shutil.rmtree(work, ignore_errors=True)
        (work / "material").mkdir(parents=True)
        os.chdir(work / "material")
        material()
    for program in PROGRAMS.values():
        for place in filter(None, program["commands"].values()):
            _command(place)  # imports it once for all cases
    ends, memory = Counter(), Counter()
    # each call unchanged first: what does not work by itself would pass every case
    for number in range(-len(KINDS), chosen.cases) if chosen.case is None else [chosen.case]:
        place = work / f"case-{number}"
        shutil.rmtree(place, ignore_errors=True)
        (place / "out").mkdir(parents=True)
        call, words = prepared(number, chosen.seed, place)
        long = call.startswith(LONG)
        if not (pid := os.fork()):
            execute(words, place, 3 if long else 3 * SECONDS)
        _, status, usage = os.wait4(pid, 0)
        code = os.waitstatus_to_exitcode(status)
        wrong = fault(code, place, (0, 1, *[2] * (number >= 0), *[130] * long))
        name = call.split()[0]
        ends[name, "fault" if wrong else code] += 1
        memory[name] = max(memory[name], usage.ru_maxrss / 2**20)
        if wrong or chosen.case is not None:
            print(f"case {number}: {call}: {wrong or code}: {ascii(words)[:400]}")
        else:
            shutil.rmtree(place)
    heading("command", "cases", "done", "exit 1", "refused", "interrupted", "faults", "most memory, GiB")
    for name in (*sorted(memory), ""):
        counts = [sum(ends[one, end] for one in memory if name in ("", one)) for end in (0, 1, 2, 130, "fault")]
        row(f"`{name}`" if name else "all", sum(counts), *counts, f"{memory[name] or max(memory.values()):.1f}")
    return int(any(end == "fault" for _, end in ends))


if __name__ == "__main__":
    raise SystemExit(bench())
