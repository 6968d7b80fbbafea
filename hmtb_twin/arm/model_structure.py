"""Which arms can stand in one batch: those whose compiled models differ in nothing but numbers."""

from collections.abc import Hashable
from functools import cache

import mujoco

from hmtb_twin.arm.arm import Arm


def structure(arm: Arm) -> Hashable:
    """Return what arms have in common that can run side by side, a model each, and that nothing else has.

    `mujoco.batch.Batch.set_models` wants the same sizes of all that MuJoCo's state holds. One loop over the ticks wants
    more: the same names at the same places, the same step and integrator, and the states of the drives in the same
    places.

    Args:
        arm: An arm.

    Returns:
        A key, equal for arms of the same structure.
    """
    model = arm.model
    supply, spools = arm.supply_state, arm.spool_states
    return (
        tuple(getattr(model, name) for name in _sizes()),
        bytes(model.names),
        model.opt.timestep,
        int(model.opt.integrator),
        arm.worksite,
        tuple(arm.pressure_states.tolist()),
        None if spools is None else tuple(spools.tolist()),
        None if supply is None else tuple(supply.tolist()),
    )


@cache
def _sizes() -> tuple[str, ...]:
    """Names of all sizes of a model: MuJoCo calls each of them n and what is counted."""
    empty = mujoco.MjSpec().compile()
    return tuple(name for name in dir(empty) if name.startswith("n") and isinstance(getattr(empty, name), int))
