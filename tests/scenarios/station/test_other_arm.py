"""The station of another arm: its own tests, joints, payloads and shapes."""

from types import SimpleNamespace

import numpy as np
import pytest

pytest.importorskip("viser")

from hmtb_twin import MODES, load_arm
from hmtb_twin.arm.meshes import body_meshes
from hmtb_twin.arm.rendering import scene_model
from hmtb_twin.control.modes import TOOL_AXES
from scenarios.station.drive_tab import DriveTab, drive, drive_fields
from scenarios.station.experiment_tab import ExperimentTab
from scenarios.station.identify_tab import IdentifyTab
from scenarios.station.station import Station
from tests.refusals import refused
from tests.scenarios.station.conftest import press, wait_until


@pytest.fixture(scope="module")
def station(tmp_path_factory):
    station = Station(tmp_path_factory.mktemp("station"), arm="xarm7")
    yield station
    station.close()


@pytest.fixture
def client(station):
    yield SimpleNamespace(client_id=0, gui=station.server.gui, add_notification=lambda *_, **__: None)
    station.motion.stop()
    wait_until(lambda: not station.work.label)
    station.session.forget_watchers()
    station.session.memory.clear()
    station.server.gui.reset()


@pytest.mark.slow
def test_a_test_of_the_arm_runs_and_its_record_can_be_identified(station, client):
    tab = ExperimentTab(station, client)
    assert tab._start.options[0] == "prbs-joint1"
    tab._start.value = "multisine-joint3"
    press(tab._start)
    fields = tab._form.handles
    assert fields["axes"].value == "joint3"
    assert fields["mode"].options == MODES
    assert fields["payload"].options == ("none",)
    assert fields["variant"].options == ("xarm7",)
    fields["duration"].value = 2.0
    tab._update()
    tab._speed.value = "as fast as it goes"
    press(tab._run)
    wait_until(lambda: not station.motion.running)
    assert "multisine-joint3: 2 s recorded" in tab._outcome.content
    log = station.session.records["multisine-joint3"]
    assert (log.joints, log.provenance["variant"]) == (load_arm("xarm7").joints, "xarm7")
    assert np.ptp(log.measured[:, 2]) > 10 * np.ptp(log.measured[:, 5])
    assert set(load_arm("xarm7").joints) <= set(IdentifyTab(station, client)._form.handles["joint"].options)


@pytest.mark.slow
def test_every_joint_can_be_driven_by_hand(station, client):
    tab = DriveTab(station, client)
    tab._form.handles["mode"].value = "single_joint_rate"
    tab._form.update()
    press(tab.buttons["Drive"])
    wait_until(lambda: tab.drive is not None)
    assert tab.drive.axes == load_arm("xarm7").joints
    # the seventh axis has buttons too
    tab._pad._push_axis(6, 1)
    assert tab.drive.stick.volts()["joint7"] == tab.volts.value
    press(tab.buttons["End"])
    wait_until(lambda: not station.motion.running and tab.drive is None)
    assert station.session.records[tab.name].joints == load_arm("xarm7").joints


def test_what_is_driven_is_what_the_arm_has():
    values = {field.name: field.initial for field in drive_fields("kinova")}
    made = drive(values)
    assert (made.variant, made.mode, made.worksite) == ("kinova", "cartesian_rate", False)
    assert made.axes == TOOL_AXES
    joints = values | {"mode": "single_joint_rate"}
    assert drive(joints).axes == load_arm("kinova").joints
    alone = drive(joints | {"axes": "j2s6s200_joint_4"})
    assert alone.axes == ("j2s6s200_joint_4",)


def test_shapes_from_meshes_are_those_of_the_file():
    model = scene_model(load_arm("xarm7"))
    meshes = body_meshes(model)
    assert len(meshes) >= 7
    # no larger than the links, which are shorter than half a metre
    sizes = [np.ptp(mesh.bounds, axis=0).max() for body, mesh in meshes.items() if model.body(body).name != "world"]
    assert min(sizes) > 0.05 and max(sizes) < 0.6


def test_an_unknown_arm_is_refused_before_a_page_opens(tmp_path):
    refused("unknown variant 'xarm9'.*xarm7", Station, tmp_path, arm="xarm9")
