"""The default physics step of each form of the actuator and each servo law: halved or doubled, the bandwidths stay."""

from itertools import product

import mujoco
import pytest

from hmtb_twin import VARIANTS, Plant, Specimen, linearize, load_arm
from hmtb_twin.parameters.variants import PAYLOADS
from tests.hmtb_twin.altered_arms import at_step, bandwidths

ARMS = [
    *((Plant(), *one) for one in product(VARIANTS, PAYLOADS)),
    *((Plant(servo=law), variant, "none") for law, variant in (("torque", "nominal"), ("flow", "published"))),
    *((Plant("orifice", servo=law), "nominal", payload) for law in ("flow", "torque") for payload in ("rpcm", "none")),
]


def change(arm, factor):
    """Largest relative change of a bandwidth when the physics step is multiplied."""
    ours, other = bandwidths(arm), bandwidths(at_step(arm, factor * arm.model.opt.timestep))
    assert len(ours) == 7 - len(arm.indexed)
    return max(abs(other[name] / hz - 1.0) for name, hz in ours.items())


@pytest.mark.slow
@pytest.mark.parametrize(("plant", "variant", "payload"), ARMS)
def test_other_steps_keep_every_bandwidth(plant, variant, payload):
    arm = load_arm(variant, payload, plant=plant)
    assert change(arm, 0.5) < 1e-5
    # The oil of the wrist roll, at 71 Hz, is what a doubled step resolves least.
    assert change(arm, 2.0) < 1e-3


def test_bandwidths_are_those_of_the_truth(arm, truth):
    for name, hz in bandwidths(arm).items():
        assert hz == pytest.approx(truth.joint(name).bandwidth_hz, rel=2e-6)


@pytest.mark.parametrize(
    ("variant", "plant", "payload", "steps"),
    [
        ("nominal", Plant(), "rpcm", 15),
        ("nominal", Plant(), "none", 25),
        ("nominal", Plant(servo="torque"), "none", 33),
        ("published", Plant(), "mdm", 20),
        ("published", Plant(servo="flow"), "rpcm", 15),
        ("flight", Plant(), "rpcm", 20),
        ("nominal", Plant("orifice"), "none", 20),
        ("published", Plant("orifice", servo="flow"), "rpcm", 20),
    ],
)
def test_steps_of_a_tick_follow_servo_law_and_lightest_joint(variant, plant, payload, steps):
    option = load_arm(variant, payload, plant=plant).model.opt
    assert option.timestep == pytest.approx(0.02 / steps, rel=1e-12)
    assert option.integrator == mujoco.mjtIntegrator.mjINT_RK4


@pytest.mark.slow
@pytest.mark.parametrize(("factor", "worksite"), [(4.0, False), (4.0, True), (100.0, True)])
def test_stiff_oil_gets_more_steps_with_power_and_without(factor, worksite):
    arm = load_arm(specimen=Specimen(bulk_modulus=factor), worksite=worksite)
    assert arm.model.opt.timestep < (0.00099 if worksite else 0.0015)
    assert arm.unpowered.opt.timestep == arm.model.opt.timestep
    assert linearize(arm, amplitudes=()).spectral_radius < 1.0
