"""Wrong words and values on the command line: each is refused in one line before anything is made."""

import pytest

from hmtb_twin import TwinError
from scenarios import names
from scenarios.files.errors import ScenarioError
from sysid import SysidError
from tests.mat_bytes import HEAD, TEXT, nested, packed, part, variable

USAGE = [
    ("nonsense", "unknown command 'nonsense'; there are: thesis, simulate"),
    ("identfy a.csv", "unknown command 'identfy': did you mean 'identify'? There are: thesis"),
    ("--verbose", "unknown command '--verbose'"),
    ("identify a.csv --orders 2 2", "--orders 2 2 given without --method"),
    ("identify a.csv --method oe --orders 2 x 1", "--orders: expected whole numbers, given 2 x 1"),
    ("identify --method oe --orders 1 1", "expected the path of a record"),
    ("simulate siso-1-elbow_pitch --duration long", "--duration: expected a number, given long"),
    ("simulate siso-1-elbow_pitch --out", "--out needs a value"),
    ("simulate", f"no scenario named; there are {len(names())}, listed by: hmtb scenarios list"),
    ("simulate siso-1-elbow_pich", "unknown scenario 'siso-1-elbow_pich': did you mean 'siso-1-elbow_pitch' or "),
    ("scenarios shw", "unknown action 'shw'; there are: list, show"),
    ("scenarios show", "hmtb scenarios show needs a name"),
    ("truth --payloads rpcm", "unknown option '--payloads': did you mean --payload?"),
    ("waveform", "missing KIND"),
    ("dataset nonsense", "unknown command 'nonsense'; there are: list, get, show, build"),
    ("dataset build", "missing SPEC; see hmtb dataset build --help"),
    ("dataset build hmtb-siso-v1 --workers two", "--workers: expected a whole number, given two"),
    ("dataset build hmtb-siso-v1 elsewhere", "unexpected argument 'elsewhere'; see hmtb dataset build --help"),
    ("dataset build hmtb-sisu-v1", "unknown data set 'hmtb-sisu-v1': did you mean 'hmtb-siso-v1'"),
    ("dataset build mine.toml", "no file mine.toml: expected a spec"),
    ("dataset build hmtb-siso-v1 --students roster.txt", "--students given without --withhold FOLDER"),
    ("dataset grade withheld", "missing SUBMISSIONS"),
]
"""Words that a command does not take."""

VALUES = [
    ("bandwidth --joints elbow", "did you mean 'elbow_pitch'"),
    ("bandwidth --methods okd", "did you mean 'okid'"),
    ("bandwidth --tests 9", "unknown test 9"),
    ("bandwidth --seeds 0", "seeds must be 1 to 1000, given 0"),
    ("bandwidth --seed -1", "a seed is a whole number from 0 to 2^63 - 1, given -1"),
    ("bandwidth --duration 6", "a duration of 6 s given, expected 10 s or more"),
    ("bandwidth --threads 0", "threads = 0 given, expected a whole number from 1 to 1024"),
    ("bandwidth --methods", "no methods given"),
    ("bandwidth --data x.csv", "expected a log of hmtb simulate"),
    ("bandwidth --data x.nc --tests 5 --no-friction", "leave out --tests, --no-friction"),
    ("bandwidth --data missing.nc", "no file missing.nc"),
    (
        "simulate siso-5-elbow_pitch --format nc --dropped 0.1",
        "--dropped is a fault of the bus; expected --format 1553",
    ),
    ("simulate siso-5-elbow_pitch --format 1553 --invalid 2", "invalid is a probability, 0 to 1, given 2.0"),
    ("simulate siso-5-elbow_pitch --format 1554", "unknown format '1554': did you mean '1553'"),
    ("simulate siso-1-elbow_pitch --duration -1", "duration"),
    ("simulate siso-1-elbow_pitch --threads 0", "threads"),
    ("simulate siso-1-elbow_pitch siso-1-elbow_pitch", "named twice"),
    ("simulate missing.toml", "cannot read scenario file"),
    ("thesis --seeds 0", "seeds must be 1 to 1000, given 0"),
    ("thesis --seeds 1000000000", "seeds must be 1 to 1000, given 1000000000"),
    ("thesis --seed -1", "a seed is a whole number from 0 to 2^63 - 1, given -1"),
    (f"thesis --seeds 2 --seed {2**63 - 1}", f"2^63 - 1, given {2**63}"),
    ("truth --variant nominl", "nominal"),
    ("truth --payload box", "rpcm"),
    ("truth --actuator servo", "available: linear, orifice"),
    ("truth --friction-level -1", "friction_level = -1.0 given, expected 0 to 100"),
    (
        "truth --supply-pressure 5",
        "at 5 MPa the drives cannot hold the arm at this pose: shoulder pitch needs 296 N m and has 268",
    ),
    ("truth --pose homm", "did you mean 'home'?"),
    ("truth --pose 0,20,50", "7 angles in degrees"),
    ("truth --pose 0,20,50,90,-50,0,zero", "7 angles in degrees"),
    ("truth --pose 0,20,50,160,-50,0,0", "elbow_pitch = 160 deg given, expected between 0 and 150 deg"),
    ("truth --pose 0,20,50,30,-50,0,0 --bla 0.01", "give --pose a name"),
    ("truth --bla 0", "--bla 0 given, expected a root mean square above 0 rad"),
    ("truth --out truth.gif", "expected a figure: .svg, .png, .pdf"),
    ("truth --maps --density 0", "density of the maps: 0 given"),
    ("truth --seed -1", "seed"),
    ("truth --threads 0", "--threads 0 given"),
    ("truth --threads 2", "--threads 2 given without --bla or --maps"),
    ("truth --density 0", "--density 0 given without --maps"),
    (
        "truth --variant flight --supply-pressure 15",
        "supply_pressure = 15.0 given, but the drives of this arm are electric",
    ),
    ("verify perfect --workers 0", "workers must be 1 to 1024, given 0"),
    ("waveform prb", "did you mean 'prbs'"),
    ("waveform fil", "did you mean 'file'"),
    (
        "waveform chirp_as_printed --f-low 1 --f-high 2",
        "chirp_as_printed needs --f-center; it takes --f-low, --f-high, --f-center, --amplitude",
    ),
    ("waveform multisine --f-start 1", "multisine has no --f-start"),
    ("waveform file", "hmtb waveform file --path FILE"),
    ("waveform points", "hmtb waveform file --path FILE"),
    ("waveform prbs --path x.txt", "prbs has no --path"),
    ("waveform file --path none.txt", "No such file"),
    ("waveform file mine.txt", "unexpected argument 'mine.txt'; did you mean --path mine.txt?"),
]
"""Values that a command does not take."""


@pytest.mark.parametrize(("words", "says"), USAGE)
def test_usage_errors_are_one_line_on_the_narrowest_terminal(complaint, monkeypatch, words, says):
    monkeypatch.setenv("COLUMNS", "40")
    assert says in complaint(*words.split())


@pytest.mark.slow
@pytest.mark.parametrize(("words", "says"), VALUES)
def test_bad_values_are_one_line(complaint, tmp_path, monkeypatch, words, says):
    monkeypatch.chdir(tmp_path)
    assert says in complaint(*words.split())
    assert list(tmp_path.iterdir()) == []


# Commands that write nothing may do without the folder, or miss it where Numba compiles: their outcome is not fixed.
@pytest.mark.parametrize("words", ["convert x.csv y.mat", "identify x.csv"])
def test_a_working_folder_that_was_deleted_is_named_in_one_line(complaint, tmp_path, monkeypatch, words):
    deleted = tmp_path / "deleted"
    deleted.mkdir()
    monkeypatch.chdir(deleted)
    deleted.rmdir()
    line = complaint(*words.split())
    assert "the folder in which the command was started no longer exists" in line or "no data file 'x.csv'" in line


NUMBER = "0x" + "f" * 5000
"""A whole number that Python reads but does not print."""


@pytest.mark.parametrize(
    ("text", "says"),
    [
        (f"seed = {NUMBER}", "a whole number of 20000 bits, expected at most 63"),
        (f"[[excitation]]\nkind = {{ a = [1, {NUMBER}] }}", "a whole number of 20000 bits"),
        ("seed = " + "9" * 5000, "not a TOML file"),
        ("seed = " + "[" * 100_000, "nested too deeply"),
        ("seed = " + "[" * 300 + "]" * 300, "nested too deeply"),
        (".".join("a" * 100_000) + " = 1", "nested too deeply"),
        ("[" + " . ".join(['"a b"'] * 100_000) + "]", "nested too deeply"),
    ],
    ids=["hexadecimal", "inside", "decimal", "open", "lists", "dotted", "quoted"],
)
def test_numbers_and_nests_without_end_are_refused(complaint, tmp_path, monkeypatch, text, says):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "mine.toml").write_text(text)
    for command in ("scenarios show", "preview", "simulate", "dataset show", "dataset build"):
        line = complaint(*command.split(), "mine.toml")
        assert line.startswith("hmtb: mine.toml: ") and says in line
        assert len(line) < 300


LONG = 50_000
"""Characters of a name that a message would fill many screens with."""


@pytest.mark.parametrize(
    ("words", "name", "content"),
    [
        ("identify a.csv --method arx --orders 1 1 1", "a.csv", ",".join(f"column{k}" for k in range(LONG)) + "\n1\n"),
        ("identify a.csv --method arx --orders 1 1 1", "a.csv", f"{'c' * LONG}\n1\n2\n"),
        ("scenarios show a.toml", "a.toml", f"{'k' * LONG} = 1"),
        ("scenarios show a.toml", "a.toml", f"name = '{'n' * LONG}'"),
        (f"scenarios show {'n' * LONG}", "a.toml", ""),
        (f"identify a.csv --method arx --orders 1 1 1 --input {'u' * LONG}", "a.csv", "u,y\n1,1\n"),
        (f"dataset show {'n' * LONG}", "a.toml", ""),
        (f"{'w' * LONG}", "a.toml", ""),
        (f"simulate {'s' * LONG}", "a.toml", ""),
    ],
    ids=range(9),
)
def test_messages_fit_on_a_screen(complaint, tmp_path, monkeypatch, words, name, content):
    monkeypatch.chdir(tmp_path)
    (tmp_path / name).write_text(content)
    assert len(complaint(*words.split())) < 1200


@pytest.mark.parametrize("kind", [SysidError, TwinError, ScenarioError])
def test_the_end_of_a_long_message_says_what_was_expected(kind):
    text = str(kind(f"columns {', '.join(map(str, range(LONG)))} given, expected u and y"))
    assert text.startswith("columns 0, 1, 2") and text.endswith("given, expected u and y")
    assert len(text) < 1000
    assert "characters left out" in text
    assert str(kind("short")) == "short"


@pytest.mark.slow
@pytest.mark.parametrize(
    "words", ["identify {} --method arx --orders 1 1 1", "compare {} --models oe:1/1", "convert {} b.csv"]
)
@pytest.mark.parametrize(
    "content",
    [
        HEAD + variable("u", part(200, bytes(8))),
        HEAD + packed(variable("format", part(77, b"h"), TEXT)),
        HEAD + nested(20_000),
    ],
    ids=["type", "text", "nested"],
)
def test_a_damaged_mat_file_is_named(complaint, tmp_path, monkeypatch, words, content):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "a.mat").write_bytes(content)
    assert "a.mat" in complaint(*words.format("a.mat").split())
    assert not (tmp_path / "b.csv").exists()
