"""The two files of an experiment: what each array is, in a unit that readers know."""

from dataclasses import replace

import numpy as np
import pytest

from hmtb_twin import JOINTS, Status, simulate
from hmtb_twin.arm_files.known_arms import arm_named
from hmtb_twin.files.netcdf import read_netcdf
from hmtb_twin.parameters.values import RECORDER
from scenarios.datasets.experiment_file import signal_contents, stored_log
from scenarios.datasets.plan import DataSetPlan

UDUNITS = {"1", "s", "rad", "rad2", "N", "N m", "V", "MPa", "A", "m", "Hz", "%"}
"""Units that occur, as UDUNITS writes them."""


def test_every_array_has_a_name_and_a_known_unit_and_status_bits_have_meanings(tiny):
    paths = sorted(tiny.rglob("*.nc"))
    assert {path.parent.name for path in paths} == {"train", "test", "signals", "arms"}
    for path in paths:
        for name, variable in read_netcdf(path).variables.items():
            about = variable.attributes
            assert str(about["long_name"]).strip(), f"{path.name}: {name}"
            if variable.values.dtype.kind != "U" and (path.parent.name != "arms" or "units" in about):
                assert about["units"] in UDUNITS, f"{path.name}: {name}"
    status = read_netcdf(tiny / "data/train/binary-elbow_pitch.nc").variables["status"]
    masks, meanings = np.asarray(status.attributes["flag_masks"]), str(status.attributes["flag_meanings"]).split()
    assert masks.dtype == status.values.dtype
    assert {Status[word.upper()].value: word for word in meanings} == dict(zip(masks.tolist(), meanings, strict=True))
    assert len(masks) == len(Status)


def test_the_noise_free_output_lies_under_the_measured_one(tiny):
    """The elbow's angle reaches the record one sample late: held against the angle at the tick, y would seem wrong."""
    data, truth = (
        read_netcdf(tiny / place / "binary-elbow_pitch.nc").variables for place in ("data/train", "truth/signals")
    )
    free = truth["y_noise_free"].values
    assert truth["measurement_delay"].values.tolist() == [1]
    assert list(truth["output"].values) == list(data["output"].values) == ["elbow_pitch"]
    ticks = truth["true_angles"].values[:, [JOINTS.index("elbow_pitch")]]
    np.testing.assert_array_equal(free[1:], ticks[:-1])
    noise = np.hypot(RECORDER.noise, RECORDER.resolver_step / np.sqrt(12.0))
    assert np.std(data["y"].values - free) == pytest.approx(noise, rel=0.2)
    assert np.std(data["y"].values - ticks) > 3.0 * noise
    assert free.shape == data["y"].values.shape


@pytest.mark.parametrize("variant", ["nominal", "flight"])
def test_every_output_is_as_late_as_its_joint(tiny_spec, variant):
    """And electric drives have currents, not pressures."""
    joints = ("shoulder_pitch", "elbow_pitch")
    changes = {"axes": joints, "each_axis": False, "duration": 1.0, "variants": (variant,), "payloads": ("none",)}
    spec = replace(tiny_spec, records=(replace(tiny_spec.records[0], **changes), *tiny_spec.records[1:]))
    entry = DataSetPlan(spec)[0]
    (log,) = simulate([entry.experiment]).logs
    signals = signal_contents(spec, entry, log).variables
    bus = arm_named(variant).bus
    assert signals["measurement_delay"].values.tolist() == [bus[joint].delay for joint in joints]
    for column, joint in enumerate(joints):
        late, true = bus[joint].delay, log.true_angles[:, JOINTS.index(joint)]
        np.testing.assert_array_equal(signals["y_noise_free"].values[late:, column], true[: len(true) - late])
    assert signals["load_pressure"].attributes["units"] == ("A" if variant == "flight" else "MPa")


def test_a_log_comes_back_with_force_and_torque(tiny, tiny_spec):
    entry = DataSetPlan(tiny_spec)[1]
    (log,) = simulate([entry.experiment]).logs
    np.testing.assert_array_equal(stored_log(tiny, entry).wrench, log.wrench)
