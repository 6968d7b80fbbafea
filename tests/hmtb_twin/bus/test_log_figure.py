"""The figure of a log shows its numbers."""

import numpy as np
import pytest

from hmtb_twin import JointLog, load_arm, simulate
from scenarios.experiments.registry import load
from tests.refusals import refused


@pytest.fixture(scope="module")
def log():
    return simulate(load("siso-5-elbow_pitch", duration=4.0))[0]


def test_the_curves_are_the_channels(log):
    figure = log.plot()
    angles, errors, efforts = figure.axes
    column = log.joint_index("elbow_pitch")
    command, measured = angles.lines[:2]
    np.testing.assert_array_equal(command.get_ydata(), np.degrees(log.commanded[:, column]))
    np.testing.assert_array_equal(measured.get_ydata(), np.degrees(log.measured[:, column]))
    np.testing.assert_allclose(errors.lines[0].get_ydata(), 1e3 * (log.commanded - log.measured)[:, column])
    np.testing.assert_array_equal(efforts.lines[0].get_ydata(), log.effort[:, column])
    limited = [line for line in angles.lines if "limit" in str(line.get_label())]
    marked = sum(len(line.get_xdata()) for line in limited)
    assert marked == np.count_nonzero(log.status & 3)


def test_joints_by_name_or_those_that_move(log, tmp_path):
    figure = log.plot(["wrist_roll", "elbow_pitch"])
    assert [figure.axes[0].get_ylabel(), figure.axes[3].get_ylabel()] == ["wrist roll", "elbow pitch"]
    figure.savefig(tmp_path / "log.png")
    tool = simulate(load("mimo-7", duration=2.0))[0]
    moved = np.argsort(np.ptp(tool.true_angles, axis=0))[-3:]
    drawn = [axes.get_ylabel() for axes in tool.plot().axes[::3]]
    assert drawn == [tool.joints[column].replace("_", " ") for column in sorted(moved)]
    other = simulate(load("all-joints", duration=2.0, arm="ur10"))[0]
    assert len(other.plot().axes) == 3 * len(load_arm("ur10").joints)


def test_what_cannot_be_drawn_is_refused(log, tmp_path):
    refused("unknown joint 'elbow'", log.plot, "elbow")
    refused("each once", log.plot, ["elbow_pitch", "elbow_pitch"])
    refused("expected one or more", log.plot, [])
    again = JointLog.load(log.save(tmp_path / "log.nc"))
    assert len(again.plot().axes) == 3
