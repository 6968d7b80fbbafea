from dataclasses import replace

import numpy as np
import pytest

from hmtb_twin import IDEAL, OverloadError, PayloadChange, Plant, load_arm, simulate
from hmtb_twin.run.live_run import LiveRun
from hmtb_twin.truth.logged_arm import logged_arm, logged_payloads
from tests.hmtb_twin.altered_arms import equal
from tests.refusals import refused

CHANGES = (PayloadChange(0.6, "rpcm"), PayloadChange(1.2, "mdm"))


@pytest.fixture
def changing(experiment):
    return experiment(payload="none", payload_changes=CHANGES, duration=1.6)


def test_up_to_the_first_change_a_run_has_the_bits_of_one_without_changes(changing):
    log, plain = simulate([changing, replace(changing, payload_changes=())])
    np.testing.assert_array_equal(log.commanded, plain.commanded)
    for name in ("true_angles", "wrench", "load_pressure"):
        np.testing.assert_array_equal(getattr(log, name)[:31], getattr(plain, name)[:31], err_msg=name)
        assert (getattr(log, name)[31] != getattr(plain, name)[31]).any(), name


@pytest.mark.slow
def test_bits_depend_neither_on_the_batch_nor_on_a_live_run(changing):
    mixed = [
        changing,
        replace(changing, name="steady", payload_changes=(), payload="mdm"),
        # Without power when the payload changes, and longer than what is computed ahead.
        replace(changing, name="off", shutdown=(0.5, 0.8), duration=6.0, plant=Plant(process_noise=0.01)),
        replace(changing, name="late", payload_changes=(PayloadChange(5.5, "ballast"),), duration=6.0),
    ]
    for one, log in zip(mixed, simulate(mixed, threads=2), strict=True):
        assert equal(simulate([one], threads=1)[0], log), one.name
        live = LiveRun(one)
        while live.step() is not None:
            pass
        assert equal(live.log(), log), one.name


def test_power_that_is_switched_live_leaves_later_changes(changing):
    live = LiveRun(changing)
    for _ in range(20):
        live.step()
    live.switch_power(on=False)
    live.step()
    live.switch_power(on=True)
    while live.step() is not None:
        pass
    assert equal(live.log(), simulate([replace(changing, shutdown=(0.4, 0.42))])[0])


@pytest.mark.slow
@pytest.mark.parametrize("actuator", ["linear", "orifice"])
def test_after_a_change_the_arm_becomes_the_arm_with_the_new_payload(changing, actuator):
    ideal = replace(changing, chain=IDEAL, amplitude=0.2, plant=Plant(actuator=actuator), duration=10.0)
    log, loaded = simulate([ideal, replace(ideal, payload="mdm", payload_changes=())])
    np.testing.assert_array_equal(log.commanded, loaded.commanded)
    apart = np.abs(log.true_angles - loaded.true_angles)
    # The joints sag under the multiplexer at once, and are back after seconds.
    assert apart[60:].max() > 1e-3
    assert apart[-50:].max() < 1e-5
    np.testing.assert_allclose(log.load_pressure[-50:], loaded.load_pressure[-50:], atol=1e-2)
    # Sensor and gripper weigh 4 kg, the units 4.1 and 23.1 kg.
    weights = 9.81 * (4.0 + np.array([0.0, 4.1, 23.1]))
    np.testing.assert_allclose(np.linalg.norm(log.wrench[[29, 59, -1], :3], axis=1), weights, rtol=0.05)


def test_the_log_names_its_payloads_and_has_no_single_truth(changing):
    log = simulate([changing])[0]
    assert logged_payloads(log) == ((0.0, "none"), (0.6, "rpcm"), (1.2, "mdm"))
    assert logged_arm(log, "mdm") is load_arm(payload="mdm")
    refused("its payload changes, none from 0 s, rpcm from 0.6 s, mdm from 1.2 s", logged_arm, log)
    refused("its payloads cannot be read", logged_payloads, replace(log, provenance={"payload_changes": "[1]"}))
    plain = simulate([replace(changing, payload_changes=())])[0]
    assert "payload_changes" not in plain.provenance
    assert logged_payloads(plain) == ((0.0, "none"),)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"payload_changes": (PayloadChange(0.5, "brick"),)}, r"'brick'.*rpcm"),
        ({"payload_changes": (PayloadChange(0.5, "none"),)}, "none follows itself"),
        ({"payload_changes": (*CHANGES, PayloadChange(1.0, "none"))}, "0.6, 1.2, 1 s given, expected ascending"),
        ({"payload_changes": (PayloadChange(0.0, "mdm"),)}, "payload_changes at 0 s given, expected ascending"),
        ({"payload_changes": (PayloadChange(9.0, "mdm"),)}, "expected ascending times between 0 and the end at 1.6 s"),
        ({"payload_changes": (PayloadChange(float("nan"), "mdm"),)}, "expected ascending times"),
        ({"payload_changes": CHANGES[:1], "worksite": True}, "at the worksite given, expected none"),
    ],
)
def test_bad_changes_are_refused(changing, change, message):
    refused(message, simulate, [replace(changing, **change)])


def test_the_drives_must_hold_the_arm_with_each_payload(changing):
    weak = replace(changing, plant=Plant(supply_pressure=6.0))
    assert len(simulate([replace(weak, payload_changes=CHANGES[:1])])) == 1
    for run in (lambda: simulate([weak]), lambda: LiveRun(weak)):
        with pytest.raises(OverloadError, match="payload mdm: at 6 MPa the drives cannot hold the arm"):
            run()
