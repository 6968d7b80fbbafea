"""Grades: what students hand in, held against a truth that they never saw."""

import json
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from scipy.io import savemat

from scenarios.commands.cli import main
from scenarios.datasets import challenge_grade as grade_room
from scenarios.datasets import open_data_set
from scenarios.datasets.arm_truth import read_arm
from scenarios.datasets.baselines import true_predictor
from scenarios.datasets.challenge_grade import UNSAID, Grade, compared, grade, grade_all, pole_distance
from scenarios.datasets.challenge_key import read_key, unpack
from scenarios.datasets.challenge_model import read_model
from scenarios.datasets.challenge_submission import open_submission
from scenarios.files.errors import ScenarioError
from scenarios.files.netcdf import Contents, Variable
from tests.scenarios.conftest import Class

HUGE = b"1" + 400 * b"0"
"""A number that no float holds."""

NAME, ARM, JOINT = "ann-twin-0-noise", "ann-twin-0-arm-0", "elbow_pitch"


@pytest.fixture(scope="module")
def whole(hidden: Class, tmp_path_factory: pytest.TempPathFactory) -> Path:
    return unpack(read_key(hidden.key), "class-v1-ann", tmp_path_factory.mktemp("whole"))


@pytest.fixture
def submit(tmp_path: Path, whole: Path) -> Callable[..., Path]:
    """Hand in what the true model predicts, with other files beside it or instead."""

    def made(name: str = "ann", files: dict[str, bytes | None] | None = None) -> Path:
        record = open_data_set(whole).test[0]
        predictor = true_predictor(read_arm(whole / f"truth/arms/{ARM}.nc"), record.joints)
        yhat = predictor.predicted(record.iodata(), 0)
        folder = tmp_path / "submissions" / name
        folder.mkdir(parents=True)
        text = "\n".join((JOINT, *map(repr, yhat[:, 0].tolist()))) + "\n"
        for place, content in {f"{NAME}.csv": text.encode(), **(files or {})}.items():
            if content is not None:
                (folder / place).write_bytes(content)
        return folder

    return made


def grades(capsys: pytest.CaptureFixture[str], *words: object) -> tuple[int, str, str]:
    code = main(["dataset", "grade", *map(str, words)])
    out, err = capsys.readouterr()
    return code, out, err


def test_the_true_model_has_the_score_of_the_baseline_of_the_truth(
    hidden: Class, submit: Callable[..., Path], capsys: pytest.CaptureFixture[str]
) -> None:
    found = grade(submit(), hidden.key, student="ann")
    assert found.scores.mean == pytest.approx(found.baselines["truth"], rel=1e-9)
    assert found.best_baseline is not None and found.best_baseline[0] in ("hold", "oe 2 2 1")
    assert found.scores.mean < 0.5 * found.baselines["hold"]
    code, out, _ = grades(capsys, submit("again"), "--key", hidden.key, "--student", "ann")
    assert code == 0 and f"score: {found.scores.mean:.6g} mrad" in out and "baseline hold" in out


def _matrices(whole: Path) -> dict[str, np.ndarray]:
    model = read_arm(whole / f"truth/arms/{ARM}.nc").joints[JOINT].model
    return {name: np.asarray(getattr(model, name)) for name in "ABCD"}


def test_the_true_model_has_no_error_in_any_format(hidden: Class, whole: Path, submit: Callable[..., Path]) -> None:
    matrices = _matrices(whole)
    joint = read_arm(whole / f"truth/arms/{ARM}.nc").joints[JOINT]
    folder = submit()
    json_file, mat_file = folder / f"model-{JOINT}.json", folder / f"model-{JOINT}.mat"
    json_file.write_text(json.dumps({"dt": 0.02, **{name: value.tolist() for name, value in matrices.items()}}))
    savemat(mat_file, {"dt": 0.02, **matrices})
    netcdf = Contents({name: Variable((f"{name}0", f"{name}1"), v, {}) for name, v in matrices.items()}, {"dt": 0.02})
    (folder / f"model-{JOINT}.nc").write_bytes(netcdf.to_bytes())
    with pytest.raises(ScenarioError, match="is a second model"):
        grade(folder, hidden.key, student="ann")
    for ending in ("json", "mat", "nc"):
        _, truth, errors = compared(read_model(folder / f"model-{JOINT}.{ending}"), joint)
        assert truth["bandwidth_hz"] == joint.bandwidth_hz
        assert abs(errors["bandwidth"]) < 0.1 and abs(errors["dc_gain"]) < 1e-6
        assert errors["response"] < 1e-6 and errors["poles"] < 1e-3


def test_errors_are_those_that_were_put_in(hidden: Class, whole: Path, submit: Callable[..., Path]) -> None:
    matrices = _matrices(whole)
    true = read_arm(whole / f"truth/arms/{ARM}.nc").joints[JOINT].bandwidth_hz
    stronger = {"dt": 0.02, **{n: (1.1 * v if n in "CD" else v).tolist() for n, v in matrices.items()}}
    files = {
        f"model-{ARM}-{JOINT}.json": json.dumps(stronger).encode(),
        "bandwidths.csv": f"joint,bandwidth_hz\n{JOINT},{0.8 * true!r}\n".encode(),
    }
    model, bandwidth = grade(submit(files=files), hidden.key, student="ann").models
    assert model.errors["dc_gain"] == pytest.approx(10.0, abs=1e-6)
    assert model.errors["response"] == pytest.approx(10.0, abs=1e-6)
    assert abs(model.errors["bandwidth"]) < 0.1 and model.stable
    assert bandwidth.errors == {"bandwidth": pytest.approx(-20.0)}


def test_poles_zeros_and_gain_are_the_transfer_function_that_they_make(tmp_path: Path) -> None:
    path = tmp_path / "model.json"
    roots = {"dt": 0.02, "poles": [[0.9, 0.1], [0.9, -0.1]], "zeros": [0.5], "gain": 0.04}
    path.write_text(json.dumps(roots))
    model = read_model(path)
    assert model.dc_gain == pytest.approx(0.04 * 0.5 / abs(0.1 - 0.1j) ** 2)
    savemat(tmp_path / "model.mat", {**roots, "poles": np.array([0.9 + 0.1j, 0.9 - 0.1j])})
    z = np.exp(0.04j * np.pi)
    expected = 0.04 * (z - 0.5) / ((z - 0.9) ** 2 + 0.01)
    for one in (model, read_model(tmp_path / "model.mat")):
        assert one.response(np.array([1.0]))[0] == pytest.approx(expected)
    assert pole_distance(model.poles, np.array([0.9 - 0.1j, 0.3, 0.9 + 0.13j])) == pytest.approx(0.03 / np.sqrt(2))


def test_every_folder_is_graded_and_those_refused_say_why(
    hidden: Class, submit: Callable[..., Path], capsys: pytest.CaptureFixture[str]
) -> None:
    submit("ann")
    folder = submit("bob").parent  # with predictions of ann's record
    (folder / "carol").mkdir()
    found = grade_all(folder, hidden.key)
    assert isinstance(found["ann"], Grade)
    assert "is of an experiment of ann's data set" in str(found["bob"])
    assert "unknown student 'carol'" in str(found["carol"])
    code, out, _ = grades(capsys, folder, "--key", hidden.key)
    assert code == 1 and "refused: bob" in out and "rmse / mrad" in out
    code, out, _ = grades(capsys, folder, "--key", hidden.key, "--json")
    record = json.loads(out)
    assert record["grades"]["ann"]["score"] > 0.0 and set(record["refused"]) == {"bob", "carol"}


def test_one_submission_that_nobody_thought_of_does_not_stop_the_class(
    hidden: Class, submit: Callable[..., Path], monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    submit("bob")
    folder = submit("ann").parent

    def overflowing(path: Path) -> object:
        if path.name == "ann":
            raise OverflowError("too large")
        return open_submission(path)

    monkeypatch.setattr(grade_room, "open_submission", overflowing)
    found = grade_all(folder, hidden.key)
    assert found["ann"] == f"{folder / 'ann'} cannot be graded: OverflowError('too large')"
    assert "is of an experiment of ann's data set" in str(found["bob"])
    assert grades(capsys, folder, "--key", hidden.key)[0] == 1


def test_a_submission_may_say_itself_whose_it_is(hidden: Class, submit: Callable[..., Path]) -> None:
    spec = open_data_set(hidden.ann).spec
    stated = {"data_set": spec.label, "commitment": spec.commitment, "student": "ann"}
    found = grade(submit(files={"submission.json": json.dumps(stated).encode()}), hidden.key)
    assert (found.label, found.remarks) == (spec.label, ())
    assert grade(submit("silent"), hidden.key, student="ann").remarks == (UNSAID,)
    with pytest.raises(ScenarioError, match="of 2 students: say which"):
        grade(submit("other"), hidden.key)
    for key, value in (("commitment", "f" * 64), ("student", "bob"), ("data_set", "class-v1-bob")):
        files = {"submission.json": json.dumps({**stated, key: value}).encode()}
        with pytest.raises(ScenarioError, match="made for another data set"):
            grade(submit(f"wrong-{key}", files=files), hidden.key, student="ann")


@pytest.mark.parametrize(
    ("files", "says"),
    [
        ({f"{NAME}.csv": None}, "no predictions"),
        ({f"{NAME}.csv": b"elbow_pitch\n" + 199 * b"1.5\n"}, r"shape \(199, 1\) given, expected \(200, 1\)"),
        ({f"{NAME}.csv": b"elbow_pitch\n" + 199 * b"1.5\n" + b"nan\n"}, "1 numbers behind the window are not finite"),
        ({f"{NAME}.csv": b"shoulder_yaw\n" + 200 * b"1.5\n"}, "expected elbow_pitch"),
        ({"other.csv": b"elbow_pitch\n1\n"}, "unknown experiment 'other'"),
        ({"bandwidths.csv": b"joint,bandwidth_hz\nelbow_pitch,nan\n"}, "expected a number above 0"),
        ({"bandwidths.csv": b"joint,hz\nelbow_pitch,1\n"}, "expected joint, bandwidth_hz"),
        ({"bandwidths.json": b'{"elbow": 1.0}'}, "unknown joint 'elbow'"),
        ({"bandwidths.json": b'{"elbow_pitch": "1 Hz"}'}, "expected a number, Hz"),
        ({"bandwidths.json": b'{"bob-twin-0-arm-0": {"elbow_pitch": 1.0}}'}, "unknown arm"),
        ({"bandwidths.json": b"[" * 10**5}, "cannot read"),
        ({"submission.json": b'{"label": "x"}'}, "unknown key 'label'"),
        ({"model-elbow_pitch.json": b'{"poles": [0.5], "zeros": [], "gain": 1}'}, "does not say its sampling time"),
        ({"model-elbow_pitch.json": b'{"dt": 0.01, "poles": [0.5], "zeros": [], "gain": 1}'}, "dt = 0.01 given"),
        ({"model-elbow_pitch.json": b'{"dt": 0.02, "poles": [[0.5, 1]], "zeros": [], "gain": 1}'}, "conjugates"),
        ({"model-elbow_pitch.json": b'{"dt": 0.02, "poles": [NaN], "zeros": [], "gain": 1}'}, "not finite"),
        ({"model-elbow_pitch.json": b'{"dt": 0.02, "poles": [0.5], "zeros": [0, 0], "gain": 1}'}, "no more zeros"),
        ({"model-elbow_pitch.json": b'{"dt": 0.02, "A": [[1]]}'}, "expected either A, B, C and D"),
        ({"model-elbow_pitch.json": b'{"dt": 0.02, "A": [[1]], "B": [1], "C": [[1]], "D": [[1]]}'}, "real matrices"),
        ({"model-elbow_pitch.json": b'{"dt": 0.02, "run": "x"}'}, "unknown key 'run'"),
        (
            {"model-elbow_pitch.json": b'{"dt": 0.02, "A": [[1]], "B": [[1]], "C": [[1]], "D": [[0]]}'},
            "gain at 0 Hz is infinite",
        ),
        ({"model-elbow_pitch.json": b'{"dt": 0.02, "poles": [1], "zeros": [], "gain": 1}'}, "gain at 0 Hz is infinite"),
        (
            {"model-elbow_pitch.json": b'{"dt": 0.02, "poles": [1e200], "zeros": [], "gain": 1}'},
            "poles has numbers above 1e",
        ),
        (
            {"model-elbow_pitch.json": b'{"dt": 0.02, "poles": [1e308, 1e308], "zeros": [], "gain": 1}'},
            "poles has numbers above 1e",
        ),
        (
            {"model-elbow_pitch.json": b'{"dt": 0.02, "A": [[1e308]], "B": [[1]], "C": [[1]], "D": [[0]]}'},
            "A has numbers above 1e",
        ),
        (
            {"model-elbow_pitch.json": b'{"dt": 0.02, "poles": [' + HUGE + b'], "zeros": [], "gain": 1}'},
            "poles has numbers above 1e",
        ),
        (
            {"model-elbow_pitch.json": b'{"dt": 0.02, "A": [[1.5, ' + HUGE + b"]]}"},
            "expected numbers in rows",
        ),
        ({"bandwidths.json": b'{"elbow_pitch": ' + HUGE + b"}"}, "expected a number above 0 and up to"),
        ({"bandwidths.json": b'{"elbow_pitch": 1, "elbow_pitch": 2}'}, "'elbow_pitch' is there twice"),
        ({"bandwidths.csv": b"joint,bandwidth_hz\nelbow_pitch,1_0\n"}, "'1_0' given"),
        ({f"{NAME}.csv": b"elbow_pitch\n" + 199 * b"1.5\n" + b"1_0\n"}, "row 201: '1_0' given"),
        ({"model-elbow_pitch.mat": b"cos\nsystem\n(S'true'\ntR."}, "cannot read"),
        ({"model-wrist.json": b"{}"}, "unknown joint 'wrist'"),
    ],
)
def test_what_is_wrong_is_said_in_one_line(
    hidden: Class,
    submit: Callable[..., Path],
    capsys: pytest.CaptureFixture[str],
    files: dict[str, bytes | None],
    says: str,
) -> None:
    folder = submit(files=files)
    with pytest.raises(ScenarioError, match=says):
        grade(folder, hidden.key, student="ann")
    code, out, err = grades(capsys, folder, "--key", hidden.key, "--student", "ann")
    assert (code, out, err.count("\n")) == (2, "", 1)


def test_links_are_not_followed(hidden: Class, submit: Callable[..., Path]) -> None:
    folder = submit()
    (folder / "bandwidths.csv").symlink_to("/etc/hostname")
    with pytest.raises(ScenarioError, match="is a link"):
        grade(folder, hidden.key, student="ann")


def test_an_unstable_model_is_said_to_be(
    hidden: Class, submit: Callable[..., Path], capsys: pytest.CaptureFixture[str]
) -> None:
    unstable = {"dt": 0.02, "poles": [1.01], "zeros": [], "gain": 0.1}
    folder = submit(files={f"model-{JOINT}.json": json.dumps(unstable).encode()})
    _, out, _ = grades(capsys, folder, "--key", hidden.key, "--student", "ann")
    assert f"model-{JOINT}.json is unstable" in out
