"""Hostile files and words for every reader and command: none may end in a traceback, a signal or a hang.

    python tests/benchmarks/hostile_input.py [--cases 5000] [--seed 0] [--case N] [--work FOLDER]

A case is a call that works, with one of its files damaged or exchanged, or one of its words changed. It runs in a fork
of this process, which has loaded everything, with 60 s of processor time, 180 s in all, and 4 GiB of memory. It passes
if it ends with exit code 0, 1 or 2, if 2 comes with one line `hmtb: ...` of at most 2000 printable characters, if no
traceback and no partial file is left. A case depends on its seed and number only: `--case N` repeats one; FOLDER keeps
the files of those that fail. The readers are those that the commands use.
"""

import importlib
import inspect
import json
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

from scenarios.commands.cli import PROGRAMS, main
from tests.benchmarks.tables import heading, options, row

SECONDS, MEMORY, LONGEST = 60, 4 * 2**30, 2000

NUMBERS = ["nan", "inf", "-inf", "-1", "0", "1e308", "-1e308", "1e400", "1e-308", "9" * 30, "0x10", "1_0", "٣", "1,5"]
TEXTS = ["", " ", "../../etc/passwd", "/dev/null", ".", "/", "~", "--json", "-", "--", "%s%n", "{0}", "$(id)", "NaN"]
TEXTS += ["<script>", "None", "\x00", "\x1b[2J", "\u202e", "\udcff", "a\nb", "é" * 300, "x" * 10**5, "[" * 5000]

VALUE = re.compile(r'"[^"]*"|-?[0-9][0-9.eE+-]*|null|true|false')
VALUES = ["null", "true", "-1", "0.5", "9" * 400, "1e999", "NaN", '""', '"../x"', "[]", "[[]]", "{}", '{"a": 1}']

CALLS = """
identify {run.nc} --method arx --orders 2 2 1 --out {out}
identify {run.csv} --joint elbow_pitch --method arx --orders 2 2 1
identify {run.mat} --method arx --orders 2 2 1
identify {run.asc} --method arx --orders 2 2 1
identify {run.ch10} --method arx --orders 2 2 1
identify {table.csv} --method oe --orders 2 2 1 --save {out}/model.json
identify {table.txt} --method iv4 --orders 2 2 1 --time t
identify {table.mat} --method n4sid --orders 2
identify {table73.mat} --method arx --orders 2 2 1
identify {table.nc} --method arx --orders 2 2 1 --missing
identify {log.mcap} --input /cmd.u --output /cmd.y --method arx --orders 2 2 1 --time log
compare {run.nc} --models truth oe:2/2 --out {out}/figure.svg
compare {table.csv} --models {model.json} arx:2/2 --estimation {table.mat}
convert {run.nc} {out}/other.mat --lossy
convert {run.ch10} {out}/other.csv
convert {run.mat} {out}/other.nc
convert {run.asc} {out}/other.ch10 --lossy
bandwidth --data {run.nc} --methods arx --no-bla
track {table.csv} --calibration 5 --order 2
simulate {scenario.toml} --out {out} --duration 0.2
simulate siso-5-elbow_pitch --out {out} --duration 0.2 --format nc,csv
scenarios show {scenario.toml}
preview {scenario.toml} --out {out}
waveform file --path {points.txt} --out {out}
waveform prbs --amplitude 1 --clock 2 --out {out}
waveform sine --amplitude 1 --frequency 2 --out {out}
waveform white_noise --amplitude 1 --seed 1 --out {out}
truth --variant nominal
dataset show {spec.toml}
dataset build {spec.toml} --out {out} --workers 1
dataset check {data}
dataset export {data} --format csv,mat --out {out}
dataset score {predictions} --data {data}
dataset baselines {data} --method arx --orders 2 2
dataset grade {withheld} {submissions}
leaderboard {result.json} --out {out}
completion bash
"""

KINDS = CALLS.strip().splitlines()


def material(place):
    """Files that the calls work on."""
    place.mkdir(parents=True)
    os.chdir(place)
    rng = np.random.default_rng(0)
    n = 400
    t, u = np.arange(n) * 0.02, np.repeat(rng.choice([-1.0, 1.0], n // 4), 4)
    y = np.convolve(u, 0.1 * 0.9 ** np.arange(50))[:n] + 0.01 * rng.standard_normal(n)
    table = np.column_stack((t, u, y))
    np.savetxt("table.csv", table, delimiter=",", header="t,u,y", comments="")
    np.savetxt("table.txt", table, header="t u y", comments="")
    savemat("table.mat", {"u": u[:, None], "y": y[:, None], "Ts": 0.02}, do_compression=True)
    for name in ("table73.mat", "table.nc"):
        with h5py.File(name, "w", userblock_size=512 if name.endswith("mat") else 0) as file:
            for key, values in (("t", t), ("u", u), ("y", y)):
                shape = (1, n) if name.endswith("mat") else n
                file.create_dataset(key, shape, data=values, chunks=True, compression="gzip")
                file[key].attrs["MATLAB_class"] = np.bytes_("double")
    np.savetxt("points.txt", rng.uniform(-1, 1, 100))
    with open("log.mcap", "wb") as stream:
        from mcap.writer import Writer

        writer = Writer(stream)
        writer.start()
        schema = writer.register_schema(name="cmd", encoding="jsonschema", data=b"{}")
        channel = writer.register_channel(topic="/cmd", message_encoding="json", schema_id=schema)
        for at, one, two in table:
            text = json.dumps({"u": one, "y": two}).encode()
            writer.add_message(channel, log_time=int(1e9 * at), publish_time=0, data=text)
        writer.finish()
    records = "".join(
        f'[[records]]\nname = "{part}"\npart = "{part}"\naxes = ["elbow_pitch"]\nduration = 4.0\n'
        'draw_waveforms = true\n[[records.excitation]]\nkind = "white_noise"\namplitude = 0.5\n'
        for part in ("test", "train")
    )
    head = 'name = "tiny"\nversion = 1\ntitle = "Tiny"\nseed = 7\n[baselines]\nmodels = ["hold", "arx:2/2"]\n'
    Path("spec.toml").write_text(head + records)
    drawn = '[truth]\nfloors = 0\n[twins]\ncount = 1\nkp = {kind = "lognormal", spread = 0.1}\n'
    Path("class.toml").write_text(head.replace("tiny", "class") + drawn + records)
    Path("scenario.toml").write_text(said("scenarios show siso-5-elbow_pitch"))
    said("simulate siso-5-elbow_pitch --duration 12 --format nc,csv,mat,ascii,1553")
    for file in Path().glob("siso-5-elbow_pitch.*"):
        file.rename(f"run{file.suffix}")
    said("identify table.csv --method oe --orders 2 2 1 --save model.json")
    said("dataset build spec.toml")
    Path("tiny-v1").rename("data")
    said("dataset build class.toml --withhold withheld --out public")
    for data, answers in ((Path("data"), Path("predictions")), (Path("public/class-v1"), Path("submissions"))):
        answers.mkdir()
        for record in (data / "data/test").glob("*.nc"):
            np.savetxt(answers / f"{record.stem}.csv", np.zeros((200, 1)), header="elbow_pitch", comments="")
    said("identify run.nc --method oe --orders 2 2 1 --save submissions/model-elbow_pitch.json")
    said("verify our-arx --quick --records 2 --figures efficiency --seed 1 --out .")
    Path("our-arx.json").rename("result.json")


def said(words):
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
        zeros, noise = bytes(len(part)), rng.bytes(len(part))
        parts = (flipped, noise, zeros, zeros.replace(b"\0", b"\xff"), b"", part + part)
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
        one = rng.choice([match.span() for match in VALUE.finditer(text)] or [(0, 0)])
        return (text[: one[0]] + str(rng.choice(VALUES)) + text[one[1] :]).encode(errors="replace")
    lines = text.splitlines() or [""]
    at = int(rng.integers(len(lines)))
    words = lines[at].replace(",", " , ").replace("=", " = ").split() or [""]
    new = str(rng.choice(NUMBERS if rng.random() < 0.5 else TEXTS))
    words[int(rng.integers(len(words)))] = repr(new) if rng.random() < 0.2 else new
    long = str(rng.choice(["[" * 20_000, "{'a':" * 999, "\ufeff", ",,,,", ";" * 70_000, "a." * 5000 + "b=1"]))
    others = [*[[" ".join(words)]] * 3, [lines[at]] * 2, [], [long]]
    lines[at : at + 1] = others[int(rng.integers(len(others)))]
    return "\n".join(lines).encode(errors="replace")


def foreign(path, rng):
    """Replace a file by a good one that nobody expects."""
    odd = [
        np.zeros((0, 1)),
        np.zeros((400, 0)),
        np.zeros((20, 20, 2)),
        np.full(400, np.nan),
        np.full(400, 1j),
        np.ones(1),
    ]
    odd += [np.array(["a", "b"], object), np.array([[np.zeros((3, 3)), "x"]], object), np.ones((400, 1), np.int8)]
    odd += [np.ones(1), np.full((400, 1), 1e308), np.array("text"), np.zeros(400, bool), np.zeros((3000, 900))]
    if path.suffix == ".mat" and rng.random() < 0.7:
        cell = np.zeros((1, 1), object)
        for _ in range(int(rng.choice([0, 900]))):
            cell[0, 0], cell = cell, np.zeros((1, 1), object)
        values = {name: odd[int(rng.integers(len(odd)))] for name in ("u", "y")}
        savemat(path, {**values, "cell": cell, "dt": rng.choice([0.02, -1.0, np.nan])}, do_compression=True)
    elif path.suffix in (".nc", ".mat"):
        path.unlink()
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
        name = word.strip("{").partition("}")[0]
        if word.startswith("{") and name != "out":
            copy, source = place / name, place.parent / "material" / name
            (shutil.copytree if source.is_dir() else shutil.copy)(source, copy)
            leaves += [leaf for leaf in sorted(copy.rglob("*")) if leaf.is_file()] if copy.is_dir() else [copy]
        words.append(word.replace(f"{{{name}}}", str(place / name)))
    kind = rng.random()
    if number < 0:
        pass
    elif leaves and kind < 0.75:
        leaf, kind = leaves[int(rng.integers(len(leaves)))], rng.random()
        if kind < 0.75:
            leaf.write_bytes(damaged(leaf.read_bytes(), rng))
        elif kind < 0.95:
            foreign(leaf, rng)
        else:
            leaf.unlink()
            others = (leaf.mkdir, lambda: os.mkfifo(leaf), lambda: leaf.symlink_to("/dev/zero"), lambda: None)
            others[int(rng.integers(4))]()
    else:
        at, new = int(rng.integers(1, len(words) + 1)), str(rng.choice(NUMBERS + TEXTS))
        program, name = ("hmtb dataset", words[1]) if words[0] == "dataset" else ("hmtb", words[0])
        module, _, function = PROGRAMS[program]["commands"][name].partition(":")
        command = getattr(importlib.import_module(f"scenarios.commands.{module}"), function)
        known = [option for option in inspect.signature(command).parameters if option != "maps"]  # they take minutes
        option = f"--{rng.choice(known).replace('_', '-')}"
        length, change = ((0, [option, new]), (0, [option]), (1, [new]), (0, [new]), (2, []))[int(rng.integers(5))]
        words[at : at + length] = change
    return call, words


def execute(words, place):
    """Run a command in this forked process, and end the process with the exit code."""
    for number, name in ((0, os.devnull), (1, place / "stdout"), (2, place / "stderr")):
        os.dup2(os.open(name, os.O_RDWR | os.O_CREAT), number)
    sys.stdout, sys.stderr = open(1, "w"), open(2, "w")  # noqa: SIM115 - to the end of the process
    resource.setrlimit(resource.RLIMIT_CPU, (SECONDS, SECONDS))
    resource.setrlimit(resource.RLIMIT_DATA, (MEMORY, MEMORY))
    signal.alarm(3 * SECONDS)
    os.chdir(place)
    code = 70
    try:
        code = main(words)
    except BaseException:
        traceback.print_exc()
    finally:
        sys.stdout.flush()
        sys.stderr.flush()
        os._exit(code)


def fault(code, place):
    """Return why a case fails: a signal, a traceback, a wrong message or a partial file; empty if it passes."""
    err = (place / "stderr").read_text(errors="backslashreplace")
    last = (err.strip("\n").splitlines() or [""])[-1]
    if os.WIFSIGNALED(code):
        return f"ended by {signal.Signals(os.WTERMSIG(code)).name}"
    code = os.WEXITSTATUS(code)
    if "Traceback" in err or code not in (0, 1, 2):
        return f"exit {code}: {last[:200]}"
    if code == 2 and not (last.startswith("hmtb: ") and len(last) <= LONGEST and last.isprintable()):
        return f"exit 2 without one line: {last[:200]!r}"
    partial = [path.name for path in place.rglob("*.partial")]
    return f"left {partial[0]}" if partial else ""


def bench():
    """Run the cases; print those that fail, then a table by command."""
    parser = options(__doc__)
    parser.add_argument("--cases", type=int, default=5000)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--case", type=int)
    parser.add_argument("--work", type=Path, default=Path(tempfile.gettempdir()) / "hostile-input")
    chosen = parser.parse_args()
    if not (chosen.work / "material/result.json").is_file():
        shutil.rmtree(chosen.work, ignore_errors=True)
        material(chosen.work / "material")
    for place in (place for program in PROGRAMS.values() for place in program["commands"].values() if place):
        importlib.import_module(f"scenarios.commands.{place.partition(':')[0]}")
    ends, memory = Counter(), Counter()
    # each call unchanged first: what does not work by itself would pass every case
    for number in range(-len(KINDS), chosen.cases) if chosen.case is None else [chosen.case]:
        place = chosen.work / f"case-{number}"
        shutil.rmtree(place, ignore_errors=True)
        (place / "out").mkdir(parents=True)
        call, words = prepared(number, chosen.seed, place)
        if not (pid := os.fork()):
            execute(words, place)
        _, code, usage = os.wait4(pid, 0)
        wrong = fault(code, place) or ("fails unchanged" if number < 0 and os.WEXITSTATUS(code) > 1 else "")
        name = " ".join(word for word in call.split()[:2] if not word.startswith("{"))
        ends[name, 3 if wrong else os.WEXITSTATUS(code)] += 1
        memory[name] = max(memory[name], usage.ru_maxrss / 2**20)
        if wrong or chosen.case is not None:
            print(f"case {number}: {call}: {wrong or os.WEXITSTATUS(code)}: {ascii(words)[:400]}")
        else:
            shutil.rmtree(place)
    heading("call", "cases", "done", "exit 1", "refused", "faults", "most memory, GiB")
    for name in (*sorted(memory), ""):
        counts = [sum(n for (one, end), n in ends.items() if end == k and name in ("", one)) for k in range(4)]
        row(f"`{name}`" if name else "all", sum(counts), *counts, f"{memory[name] or max(memory.values()):.1f}")
    return int(any(end == 3 for _, end in ends))


if __name__ == "__main__":
    raise SystemExit(bench())
