"""The notebooks of docs run from first to last cell, hold no outputs, and the results that their text states hold."""

import ast
import json
import os
import re
from importlib import import_module
from pathlib import Path

import pytest

nbformat = pytest.importorskip("nbformat")
pytest.importorskip("ipywidgets")
nbclient = pytest.importorskip("nbclient")

ROOT = Path(__file__).parents[1]
NOTEBOOKS = sorted((ROOT / "docs" / "notebooks").glob("*.ipynb"))
MACHINE_PATH = re.compile(r"(?<![\w.<~-])/(?:work|root|tmp|home)/")
LINK = re.compile(r"\]\(((?!\w+:|#)[^)\s#]+)")
LIMIT = 600
"""Seconds after which a cell counts as stuck; all cells together take two minutes of one processor."""

NOT_PUBLIC = {("scenarios.datasets.score", "score_model")}
"""Names that notebooks import although no `__all__` holds them; docs/datasets.md documents them."""

STATEMENTS = {
    "own_record": {
        "ten of its samples\nare lost, and three are wild, one of them in the second half": (
            "wild.sum() == 3 and (~clean.known).sum() == 13 and len(parts) > 1 < len(checks)"
        ),
        "two poles, a delay of three samples": "nk == 3 and best == {'nb': 2, 'nf': 2, 'nk': 3}",
        "should agree on the response": "choice.estimate.bandwidth().covers(hz).item()",
        "residuals should be white and independent": "test.passed",
        "A second model of order one shows what a failure looks like": "not sysid.resid(small, checks).passed",
        "The answer of the example": "band.covers(true_hz).item()",
        "The JSON file keeps every bit": "np.array_equal(again.parameters, estimate.parameters)",
    },
    "paper": {
        "three joints": "table.index.get_level_values('joint').nunique() == 3",
        "The best models are closer to the test records than the small-signal truth": (
            "all(table.loc[j, 'test error / mrad'].drop(['truth', 'noise']).min() < table.loc[(j, 'truth'), "
            "'test error / mrad'] for j in STUDIED_JOINTS)"
        ),
        "No model reaches the noise": (
            "all(table.loc[j, 'test error / mrad'].drop('noise').min() > 2 * attainable[j] for j in STUDIED_JOINTS)"
        ),
        "which matters most on the shoulder yaw": (
            "table.xs('OE', level='method')['test error / mrad'].idxmax() == 'shoulder_yaw'"
        ),
        "`n4sid` gives none": "table.xs('N4SID', level='method')['from'].isna().all()",
        "`mine` has none either": "table.xs('mine', level='method')['from'].isna().all()",
        "its row and curve are those of ARX": (
            "(lambda a, b: np.allclose(a.iloc[:, :3], b.iloc[:, :3], rtol=1e-2))"
            "(*(table.xs(m, level='method') for m in ('mine', 'ARX')))"
        ),
        "The table has a dash there": (
            "(folder / 'table.tex').read_text().startswith('% Needs') and "
            "'& -- & -- ' in (folder / 'table.tex').read_text() and "
            "not re.search(r'cline.*\\n.*bottomrule', (folder / 'table.tex').read_text())"
        ),
        "No interval of the shoulder yaw contains the true bandwidth": (
            "(table.loc['shoulder_yaw', 'to'].dropna() < true_hz['shoulder_yaw']).all()"
        ),
        "`results/` holds": (
            "all((folder / n).stat().st_size > 500 for n in ('table.tex', 'figure.pdf', 'figure.svg'))"
        ),
    },
    "lecture": {
        "an error of 6 %": "abs(bandwidths(1000, 0.3)[0].std() / TRUE_HZ - 0.06) < 0.01",
        "falls with the square root of the number of samples": (
            "1.6 < bandwidths(1000, 0.3)[0].std() / bandwidths(4000, 0.3)[0].std() < 2.5"
        ),
        "claimed value agrees with the scatter": (
            "all(0.7 < np.median(bandwidths(n, 0.3)[1]) / bandwidths(n, 0.3)[0].std() < 1.4 for n in LENGTHS)"
        ),
        "nine in ten claims lie within 20 % of that median": (
            "(lambda claims: np.mean(np.abs(claims / np.median(claims) - 1) < 0.2))(bandwidths(1000, 0.3)[1]) >= 0.9"
        ),
        "Its interval shrinks around the wrong value": (
            "(lambda bands: not any(one.covers(TRUE_HZ).item() for one in bands) and np.ptp(bands[1].ci95) < "
            "np.ptp(bands[0].ci95))([structures(n, 0.1)['arx'].bandwidth() for n in (1000, 16000)])"
        ),
        "`oe` has the right\nstructure; `iv4` needs none": (
            "all(structures(16000, 0.1)[m].bandwidth().covers(TRUE_HZ).item() for m in ('oe', 'iv4'))"
        ),
        "The sign of the bias is not fixed": (
            "structures(16000, 0.1)['arx'].bandwidth().hz.item() < TRUE_HZ < "
            "structures(16000, 0.3)['arx'].bandwidth().hz.item()"
        ),
        "of order eleven": "PATH.A.shape == (11, 11)",
        "the error on *other* records rises again while the error on its own record still\nfalls": (
            "order_errors(8)[1] > order_errors(3)[1] and order_errors(8)[0] < order_errors(3)[0]"
        ),
        "The best order for other records is far below": (
            "np.argmin([order_errors(n)[1] for n in range(1, 9)]) + 1 <= 4"
        ),
        "Order one (upper figure) is too low": "order_errors(1)[1] > 1.1 * order_errors(3)[1]",
        "The gain *rises* with the amplitude and approaches the truth": (
            "np.all(np.diff([apparent('shoulder_yaw', p)[2] for p in AMPLITUDES]) > 0) and "
            "0.9 < apparent('shoulder_yaw', 80)[2] < 1"
        ),
        "its gain is half the true one": "0.45 < apparent('shoulder_yaw', 2)[2] < 0.55",
        "So does the bandwidth from about 3 mrad rms on": (
            "np.all(np.diff([apparent('shoulder_yaw', p)[3] for p in AMPLITUDES[2:]]) > -0.02) and "
            "all(apparent('shoulder_yaw', p)[3] < TRUTH.joint('shoulder_yaw').bandwidth_hz for p in AMPLITUDES)"
        ),
        "Without friction the points lie on the truth": (
            "(lambda f, gain, *_: np.abs(gain / np.abs(TRUTH.joint('shoulder_yaw').model.frequency_response(f)"
            "[:, 0, 0]) - 1).max() < 0.1)(*apparent('shoulder_yaw', 5, False))"
        ),
        "y over u is **−1/C": (
            "np.median(np.abs(loop_responses(0.3)[1] / loop_responses(0.3)[3] - 1)) < 0.1 and "
            "np.median(np.abs(loop_responses(0.3)[1] / loop_responses(0.3)[4] - 1)) > 0.5"
        ),
        "Only where the reference dominates": (
            "np.median(np.abs(loop_responses(30)[1] / loop_responses(30)[4] - 1)) < 0.1"
        ),
        "At a ratio of 3 it works above 1 Hz": (
            "(lambda f, direct, divided, limit, servo: np.median(np.abs(divided / servo - 1)[f > 1]) < 0.15 and "
            "np.median(np.abs(direct / servo - 1)) > 0.5)(*loop_responses(3))"
        ),
        "its phase at 0.3 Hz is about −200 degrees, that of the servo −20": (
            "np.allclose([np.degrees(np.angle(loop_responses(0.3)[k][0])) % 360 for k in (2, 4)], [160, 340], atol=5)"
        ),
        "its interval is narrower than that of `two_stage`": (
            "with_noise_model.bandwidth().covers(TRUE_HZ).item() and "
            "np.ptp(with_noise_model.bandwidth().ci95) < np.ptp(two_stage.bandwidth().ci95)"
        ),
        "`sysid.feedback` sees the loop": "sysid.feedback(data).feedback.all()",
        "`two_stage` uses the reference": (
            "two_stage.bandwidth().covers(TRUE_HZ).item() and not direct_model.bandwidth().covers(TRUE_HZ).item()"
        ),
        "gives the narrower interval at both amplitudes": (
            "all(np.log(b[3][2] / b[3][1]) > np.log(a[3][2] / a[3][1]) for a, b in "
            "[(excitation_numbers('prbs', p), excitation_numbers('multisine', p)) for p in (5, 40)])"
        ),
        "at 40 mrad, too, the intervals exclude the truth": (
            "all(excitation_numbers(k, p)[3][2] < ELBOW.bandwidth_hz for k in ('prbs', 'multisine') for p in (5, 40))"
        ),
        "Without friction the limit is met as\noften, and 0.2 % is left": (
            "all(abs(excitation_numbers(k, 40, False)[3][0] / ELBOW.bandwidth_hz - 0.998) < 0.0005 and "
            "abs(excitation_numbers(k, 40, False)[0] - excitation_numbers(k, 40)[0]) < 0.02 "
            "for k in ('prbs', 'multisine'))"
        ),
        "most of its samples lie at the limit": "excitation_numbers('prbs', 40)[0] > 0.5",
        "it has lost power at 2 to 3 Hz, where the multisine keeps most": (
            "excitation_numbers('prbs', 40)[1] < 0.5 < 0.7 < excitation_numbers('multisine', 40)[1]"
        ),
    },
    "thesis": {
        "that at 0.17 Hz has a quarter of the power of that at 0.5 Hz, that at 0.33 Hz less than a tenth": (
            "0.2 < slow_lines[0] / slow_lines[2] < 0.3 and slow_lines[1] / slow_lines[2] < 0.1"
        ),
        "less than 2 % of all power": "slow_share < 0.02",
        "repeats after 6 s at the latest": "all(one.period == 300 for one in tests.values())",
        "of about 4 mrad rms": (
            "3.5 < effects[('command', 'rms / mrad')].iloc[0] < 4.5 and "
            "tests['elbow_pitch'].hand_controller.gain == 0.004"
        ),
        "without friction: yes**, all three joints": (
            "all(0.8 <= truth.joint(j).bandwidth_hz <= 1.25 and 0.8 <= best[j, False].bandwidth().hz.item() <= 1.25 "
            "for j in JOINTS)"
        ),
        "Friction lowers the best linear bandwidth of the shoulder yaw far below 0.8 Hz": (
            "best['shoulder_yaw', True].bandwidth().path()[2] < 0.7"
        ),
        "On the yaw ARMAX lies below 0.8 Hz and OKID above 1.25 Hz": (
            "table['recovered'].loc['shoulder_yaw', 'armax'] < 0.8 and "
            "table['recovered'].loc['shoulder_yaw', 'okid'] > 1.25"
        ),
        "joints are near 1 Hz with every method": (
            "near['recovered near 1 Hz'].loc[['shoulder_pitch', 'elbow_pitch']].all()"
        ),
        "Four of the nine contain the small-signal truth, none the best linear": (
            "near.iloc[:, 2].sum() == 4 and near.iloc[:, 3].sum() == 0"
        ),
        "its gain at 0 Hz is 0.67 where the truth has 1": (
            "round(models['shoulder_yaw']['oe'].frequency_response([1e-6]).magnitude.item(), 2) == 0.67"
        ),
        "in the figure its curve lies below the truth": (
            "np.all(models['shoulder_yaw']['oe'].frequency_response(f).magnitude[:, 0, 0] < "
            "np.abs(truth.joint('shoulder_yaw').model.frequency_response(f)[:, 0, 0]))"
        ),
        "less than half of 1 Hz": "table.loc['shoulder_yaw', 'printed'].max() < 0.5",
        "about a third of the yaw's gain at 4 mrad per volt, and less than 3 % at 67": (
            "(lambda g: 0.25 < 1 - g.iloc[0] / g.iloc[2] < 0.4 and 1 - g.iloc[4] / g.iloc[6] < 0.03)"
            "(effects[('gain at 0.5 Hz', 'shoulder_yaw')])"
        ),
        "changes no gain\n  by more than 0.03 and no bandwidth by more than 0.1 Hz": (
            "all(np.abs(effects[k].iloc[0::2].to_numpy() - effects[k].iloc[1::2].to_numpy()).max() <= m "
            "for k, m in (('gain at 0.5 Hz', 0.03), ('bandwidth / Hz', 0.1)))"
        ),
        "at 67 mrad per volt in most samples": "effects[('command', 'at the limit / %')].iloc[4] > 80",
        "contradicts F9, F16 and F22 on these records": (
            "set(verdicts.index[~verdicts['holds']]) == {'F9', 'F16', 'F22'}"
        ),
        "F9 holds only without friction": "passed_without",
        "the OKID model of the elbow has a pair of complex poles": (
            "np.iscomplex(models['elbow_pitch']['okid'].poles()).all()"
        ),
        "0.16, 0.47 and 0.12 Hz (equations 4.7, 4.8, 5.8)": (
            "[round(hz, 2) for hz in printed_yaw.values()] == [0.16, 0.47, 0.12]"
        ),
        "(2.15) is one tone": "chirp_lines['as printed (2.15)'] == 1 < chirp_lines['a real sweep']",
        "twice the intended levels": "levels.tolist() == [-2.0, 2.0]",
        "their order of excitation is four": "sysid.order_of_excitation(np.tile(two_sines, 3)) == 4",
        "scores higher in prediction than in simulation": "fits[1].one_step.item() > fits[1].simulation.item()",
        "so its fit is a simulation": "abs(fits[0].one_step.item() - fits[0].simulation.item()) < 1e-9",
    },
    "your_robot": {
        "its bandwidth is right to half a percent": "abs(bands['without'].hz.item() / true.bandwidth_hz - 1) < 0.005",
        "With friction the bandwidth is lower": "bands['with friction'].hz.item() < 0.95 * true.bandwidth_hz",
        "A larger motion comes nearer to the truth": "bands['with friction'].hz.item() < larger < true.bandwidth_hz",
    },
}
"""Sentences of the notebooks, and what must be true of the executed one for each."""


def read(path: Path):
    return nbformat.read(path, as_version=4)


def prose(path: Path) -> str:
    return "\n\n".join(cell.source for cell in read(path).cells if cell.cell_type == "markdown")


@pytest.fixture(scope="module")
def cache(tmp_path_factory):
    """Folder in which the data set is built once."""
    return tmp_path_factory.mktemp("cache")


def test_there_are_statements_of_every_notebook():
    assert {path.stem for path in NOTEBOOKS} == STATEMENTS.keys()


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_files_hold_no_results_and_no_machine(path):
    text = path.read_text(encoding="utf-8")
    notebook = nbformat.from_dict(json.loads(text))
    nbformat.validate(notebook)
    assert (notebook.nbformat, notebook.nbformat_minor) == (4, 5)
    ids = [cell.id for cell in notebook.cells]
    assert len(set(ids)) == len(ids)
    assert all(re.fullmatch(r"[a-z]+[a-z-]*", one) for one in ids), "ids that say what the cell is for stay the same"
    for cell in notebook.cells:
        assert "raises-exception" not in cell.metadata.get("tags", ()), "a cell with this tag may fail unseen"
        if cell.cell_type == "code":
            assert not cell.outputs and cell.execution_count is None, f"{path.name}, {cell.id}: clear all outputs"
    assert set(notebook.metadata) == {"kernelspec", "language_info"}
    assert not MACHINE_PATH.search(text)
    missing = [link for link in LINK.findall(prose(path)) if not (path.parent / link).exists()]
    assert not missing


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_notebooks_use_public_names(path):
    code = "\n".join(cell.source for cell in read(path).cells if cell.cell_type == "code")
    tree = ast.parse(re.sub(r"^%.*$", "", code, flags=re.M))
    packages = ("sysid", "hmtb_twin", "scenarios")
    for node in ast.walk(tree):
        if isinstance(node, ast.ImportFrom) and (node.module or "").partition(".")[0] in packages:
            names = {(node.module, alias.name) for alias in node.names} - NOT_PUBLIC
            assert all(name in import_module(module).__all__ for module, name in names), node.module
        if isinstance(node, ast.Attribute) and isinstance(node.value, ast.Name) and node.value.id in packages:
            package = import_module(node.value.id)
            rooms = {"plots", "models"} if node.value.id == "sysid" else set()
            assert node.attr in {*package.__all__, *rooms}, f"{node.value.id}.{node.attr}"


@pytest.mark.pages
@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_notebooks_run_and_their_statements_hold(path, cache, tmp_path, monkeypatch):
    text, statements = prose(path), STATEMENTS[path.stem]
    unknown = [sentence for sentence in statements if sentence not in text]
    assert not unknown, "sentences that the notebook does not have"
    monkeypatch.setenv("HMTB_CACHE", str(cache))
    monkeypatch.setenv("PYTHONPATH", os.pathsep.join([str(ROOT), os.environ.get("PYTHONPATH", "")]))
    # Of the tests: figures are shown here.
    monkeypatch.delenv("MPLBACKEND", raising=False)
    notebook = read(path)
    checks = "{" + ", ".join(f"{key!r}: bool({code})" for key, code in statements.items()) + "}"
    notebook.cells.append(nbformat.v4.new_code_cell(f"import json\nprint(json.dumps({checks}))"))
    resources = {"metadata": {"path": str(tmp_path)}}
    client = nbclient.NotebookClient(notebook, timeout=LIMIT, kernel_name="python3", resources=resources)
    client.execute()
    held = json.loads(notebook.cells[-1].outputs[-1].text)
    assert not [sentence for sentence, holds in held.items() if not holds]
    shown = [output for cell in notebook.cells if cell.cell_type == "code" for output in cell.outputs]
    errors = [output.text for output in shown if output.output_type == "stream" and output.name == "stderr"]
    # of which the notebook of an own record speaks, with the line of code that gives it
    expected = ("SysidWarning: the delay is between", "delays = sysid.delayest(parts)")
    lines = [line for text in errors for line in text.splitlines() if not any(words in line for words in expected)]
    assert not [line for line in lines if not line.startswith("hmtb-siso-v1: ")]  # progress of its build
    assert any("image/png" in output.get("data", {}) for output in shown)
