"""`hmtb view`: the arm in MuJoCo's viewer."""

from typing import Annotated

import tyro

from scenarios.commands.output import say


def view(
    name: Annotated[str | None, tyro.conf.Positional, tyro.conf.arg(metavar="[SCENARIO|LOG]")] = None,
    *,
    payload: str = "rpcm",
    speed: float = 1.0,
    loop: bool = False,
    seed: int | None = None,
) -> int:
    """Show the arm in MuJoCo's viewer: alone, to be moved by hand, or an experiment played back.

    Needs a display; hmtb video works without one.

    Args:
        name: A scenario, which is simulated first, or a log NAME.nc. When not given: the arm at the approach point,
            its servos on, with the viewer's own controls.
        payload: What the end effector of the arm alone holds: rpcm, none, ballast or mdm.
        speed: Seconds of the experiment per second of playback.
        loop: Play again and again.
        seed: Seed of a scenario's noise; its own when not given.
    """
    from hmtb_twin import load_arm
    from hmtb_twin.parameters.values import OPERATING_POSE
    from hmtb_twin.run.playback import play
    from scenarios.experiments.film import load_or_simulate, viewer_module
    from scenarios.files.errors import ScenarioError

    if not 0 < speed <= 1000:
        raise ScenarioError(f"--speed must be above 0 and at most 1000, given {speed:g}")
    viewer = viewer_module()  # refuses before the simulation, not after
    if name is None:
        arm = load_arm(payload=payload)
        viewer.launch(arm.model, arm.rest(arm.pose(OPERATING_POSE)))
        return 0
    log = load_or_simulate(name, seed=seed)
    say(f"{log.name}: {len(log) * log.dt:g} s, played at {speed:g} times its speed; close the window to end")
    play(log, viewer, speed=speed, loop=loop)
    return 0
