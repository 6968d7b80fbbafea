"""Calls of the command line; a small study and small data sets, made once for all tests that look at them."""

import json
import shutil
from dataclasses import dataclass, replace
from pathlib import Path

import pytest

from hmtb_twin import PayloadChange, simulate
from hmtb_twin.parameters.specimen_draw import Distribution, TwinDistributions
from hmtb_twin.parameters.values import LARGE_MOTION
from scenarios.commands.cli import main
from scenarios.datasets import open_data_set
from scenarios.datasets.build import build
from scenarios.datasets.record_block import RecordBlock
from scenarios.datasets.spec import BaselineSpec, DataSetSpec, TruthSpec, Twins
from scenarios.datasets.withhold import build_withheld
from scenarios.experiments.campaign import NOMINAL
from scenarios.experiments.excitation_computer import Excitation
from scenarios.experiments.registry import load
from scenarios.thesis.disturbances import DISTURBANCES
from scenarios.thesis.study import planned_steps, run_study
from tests.shared import shared


@pytest.fixture
def run(capsys):
    """Run a command: exit code, stdout and stderr."""

    def call(*words):
        code = main([str(word) for word in words])
        return code, *capsys.readouterr()

    return call


@pytest.fixture
def printed(run):
    """Run a command that ends with an exit code, 0 by default, and nothing on stderr: stdout."""

    def call(*words, code=0):
        end, out, err = run(*words)
        assert (end, err) == (code, ""), err
        return out

    return call


@pytest.fixture
def result(printed):
    """Run a command with --json: the object that it prints."""
    return lambda *words, code=0: json.loads(
        printed(*words, "--json", code=code), parse_constant=lambda name: pytest.fail(f"{name} is not JSON")
    )


@pytest.fixture
def complaint(run):
    """Run a command that must be refused, with exit 2, nothing on stdout and no traceback: the one line on stderr."""

    def call(*words):
        code, out, err = run(*words)
        assert (code, out, err.count("\n")) == (2, "", 1)
        assert err.startswith("hmtb: ")
        return err

    return call


@pytest.fixture(scope="module")
def scheduler():
    """Address of a Dask scheduler, whose worker is a thread of this process: all travels over the wire all the same."""
    distributed = pytest.importorskip("distributed")
    with distributed.LocalCluster(
        n_workers=1, threads_per_worker=1, processes=False, protocol="tcp", dashboard_address=None, host="127.0.0.1"
    ) as cluster:
        yield cluster.scheduler_address


@pytest.fixture(scope="session")
def fewer_disturbances():
    """Every disturbance with its worst degree and one draw; all of them would take half of the time of the study."""
    # without bias: the undisturbed record; a record of 20 s has parts of 10 s and none that are longer
    more = {"bias": (0.0, 2.0), "length": (10.0, 30.0)}
    return {
        key: replace(entry, draws=1, degrees=more.get(key, entry.degrees[-1:])) for key, entry in DISTURBANCES.items()
    }


@pytest.fixture(scope="session")
def study_run(fewer_disturbances):
    """The whole chain on records of 24 s, of which 20 s remain after settling, ten periods; and its progress."""
    return shared("study", lambda: _small_study(fewer_disturbances))


def _small_study(fewer_disturbances):
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("scenarios.thesis.robustness.DISTURBANCES", fewer_disturbances)
        patch.setattr("scenarios.thesis.order_search.POLES", (1, 2, 5))
        patch.setattr("scenarios.identification.every_joint.ORDERS", ((3, 4),))
        # models of three of the tests of several joints, one of them with independent inputs
        patch.setattr("scenarios.thesis.every_data_set.names", lambda _: ("mimo-1", "mimo-13", "mimo-7-independent"))
        moves = []
        steps = planned_steps((NOMINAL,), 24.0, report=lambda *move: moves.append(move))
        return run_study(seed=11, duration=24.0, conditions=(NOMINAL,), steps=steps), moves


@pytest.fixture(scope="session")
def study(study_run):
    """The study of `study_run`."""
    return study_run[0]


@pytest.fixture(scope="session")
def exchange_log():
    """The elbow pitch for 40 s, its end effector empty, and with the multiplexer from 20 s on."""
    changes = (PayloadChange(20.0, "mdm"),)
    return simulate([replace(load("track-elbow_pitch"), duration=40.0, payload_changes=changes)])[0]


@pytest.fixture(scope="session")
def tiny_spec():
    """Three short records."""
    prbs = Excitation("prbs", {"amplitude": 1.0, "clock": 2, "register": 7})
    noise = Excitation("white_noise", {"amplitude": 0.5})
    settings = {"excitation": (noise,), "duration": 4.0, "draw_waveforms": True, "hand_controller": LARGE_MOTION}
    test = RecordBlock("noise", "test", axes=("elbow_pitch",), **settings)
    axes = ("shoulder_yaw", "elbow_pitch")
    train = replace(test, name="binary", part="train", axes=axes, each_axis=True, excitation=(prbs,))
    baselines = BaselineSpec(("hold", "arx:2/2", "truth"))
    spec = DataSetSpec("tiny", 1, "Three short records", 7, (train, test), "For tests.", 20, baselines=baselines)
    return replace(spec, date="2026-01-31")


@pytest.fixture(scope="session")
def tiny(tiny_spec, tmp_path_factory):
    """Folder of the built data set; tests that change it take a copy."""
    return build(tiny_spec, tmp_path_factory.mktemp("data-sets"), workers=1).folder


@dataclass(frozen=True)
class Class:
    """Public data sets of two students, and the withheld folder."""

    spec: DataSetSpec
    withheld: Path
    ann: Path
    bob: Path


@pytest.fixture(scope="session")
def school(tiny_spec, tmp_path_factory):
    """Data sets with withheld truth; tests that change them take a copy."""
    place = tmp_path_factory.mktemp("school")
    drawn = {
        "kp": Distribution("lognormal", 0.1),
        "mass": Distribution("lognormal", 0.05),
        "supply_pressure": Distribution("normal", 0.2),
        "process_noise": Distribution("uniform", 0.0001, 0.0002),
    }
    spec = replace(
        tiny_spec,
        name="class",
        twins=Twins(1, TwinDistributions(**drawn)),
        truth=TruthSpec(floors=0),
        baselines=BaselineSpec(("hold", "oe:2/2/1", "truth")),
        records=tuple(replace(block, draw_waveforms=False) for block in tiny_spec.records),
    )
    (ann, bob), _ = build_withheld(spec, place / "out", place / "withheld", persons=("ann", "bob"), seed=3)
    return Class(spec, place / "withheld", ann, bob)


@pytest.fixture(scope="session")
def data_set(tiny):
    """The tiny data set, opened."""
    return open_data_set(tiny)


@pytest.fixture
def copy(tiny, tmp_path):
    """A copy of the tiny data set, for tests that change it."""
    return Path(shutil.copytree(tiny, tmp_path / tiny.name))
