"""The default physics step of each form of the actuator: halved or doubled, the bandwidths stay."""

from itertools import product

import pytest

from hmtb_twin import VARIANTS, Plant, load_arm
from hmtb_twin.parameters.payloads import PAYLOADS
from tests.hmtb_twin.altered_arms import at_step, bandwidths

ARMS = [
    *(("linear", *one) for one in product(VARIANTS, PAYLOADS)),
    *(("orifice", "nominal", payload) for payload in ("rpcm", "none")),
]
DOUBLED = 1e-3
"""Largest change of a bandwidth that a doubled step may make."""


def change(arm, factor):
    """Largest relative change of a bandwidth when the physics step is multiplied."""
    ours, other = bandwidths(arm), bandwidths(at_step(arm, factor * arm.model.opt.timestep))
    assert len(ours) == 6
    return max(abs(other[name] / hz - 1.0) for name, hz in ours.items())


@pytest.mark.slow
@pytest.mark.parametrize(("form", "variant", "payload"), ARMS)
def test_doubled_step_keeps_every_bandwidth(form, variant, payload):
    # The orifice form is integrated to the fourth order: there the step has converged.
    assert change(load_arm(variant, payload, plant=Plant(actuator=form)), 2.0) < (DOUBLED if form == "linear" else 1e-5)


def test_step_of_the_linear_form_is_small_enough_and_not_only_at_a_turn_of_the_error():
    # The error changes its sign between 1 and 4 ms: doubling alone would show too little.
    assert change(load_arm(), 1.0 / 16.0) < 1.2 * DOUBLED


def test_bandwidths_are_those_of_the_truth(arm, truth):
    for name, hz in bandwidths(arm).items():
        assert hz == pytest.approx(truth.joint(name).bandwidth_hz, rel=1e-6)
    assert arm.model.opt.timestep == VARIANTS["nominal"].step == 0.0005
    assert load_arm("flight").model.opt.timestep == VARIANTS["flight"].step == 0.000125
