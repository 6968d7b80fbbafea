"""`hmtb video`: a film or a picture of an experiment; `hmtb view`: the arm in MuJoCo's viewer."""

from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import tyro

from scenarios.commands.output import check_files, print_json, progress, say, say_next, say_next_identify
from scenarios.files.errors import ScenarioError, unknown
from scenarios.files.printable import counted

if TYPE_CHECKING:
    import numpy as np

DECK = ("window", "port", "starboard", "wrist_camera")
"""Views of the operator on the aft flight deck."""


def video(
    name: Annotated[str, tyro.conf.Positional, tyro.conf.arg(metavar="SCENARIO|LOG")],
    *,
    out: Path | None = None,
    camera: str = "overview",
    width: int = 640,
    height: int = 480,
    fps: float = 25.0,
    speed: float = 1.0,
    start: float = 0.0,
    duration: float | None = None,
    plot: bool = True,
    seed: int | None = None,
    overwrite: bool = False,
    json: bool = False,
) -> int:
    """Film an experiment: a scenario or a log.

    A scenario is simulated first. Films are rendered without a display. .mp4 needs the extra hmtb-twin[video]; .gif and
    .png do without.

    Args:
        name: A registered scenario, a TOML file, or a log NAME.nc.
        out: The file, its ending .mp4, .gif or .png (the picture at --start); NAME.mp4 when not given.
        camera: View, or several separated by commas: overview, window (the aft flight deck's), port, starboard,
            worksite and seats (the bay's cameras), wrist_camera; deck is window, port, starboard and wrist_camera in
            one.
        width: Width of each view, pixels.
        height: Height of each view, pixels.
        fps: Frames per second.
        speed: Seconds of the experiment per second of film.
        start: First time to show, s.
        duration: How much of the experiment to show, s; to its end when not given.
        plot: Draw command and measured angle of the excited joints under a film of 320 pixels or wider.
        seed: Seed of a scenario's noise; its own when not given.
        overwrite: Replace files that exist, without a question.
        json: Print JSON.
    """
    from hmtb_twin.run.playback import frame_times, frames
    from scenarios.experiments.film import load_or_simulate, write_film
    from scenarios.experiments.film_plot import with_plot

    for label, value in (("fps", fps), ("speed", speed)):
        if not 0 < value <= 1000:
            raise ScenarioError(f"--{label} must be above 0 and at most 1000, given {value:g}")
    cameras = _cameras(camera)
    # Of a picture's scenario only what lies before it is simulated.
    needed = 0.0 if out is not None and out.suffix == ".png" else duration
    until = None if needed is None else start + needed
    log = load_or_simulate(name, seed=seed, until=until)
    path = Path(f"{log.name}.mp4") if out is None else out
    check_files(path, overwrite=overwrite)
    end = len(log) * log.dt
    last = end - log.dt
    if duration is not None:
        last = min(start + duration, last)
    if not 0 <= start <= last:
        length = "" if duration is None else f" for {duration:g} s"
        raise ScenarioError(f"nothing to show from {start:g} s{length}; {log.name} lasts from 0 to {end:g} s")
    is_picture = path.suffix == ".png"
    if is_picture:
        last = start
    times = frame_times((start, last), rate=fps, speed=speed)
    pictures, count = frames(log, cameras, size=(width, height), times=times), len(times)
    if plot:
        pictures = with_plot(pictures, log, times)
    with progress("filming") as report:

        def counted_frames() -> "Iterator[np.ndarray]":
            for k, picture in enumerate(pictures, start=1):
                report(k, count)
                yield picture

        write_film(counted_frames(), path, rate=fps)
    if json:
        print_json({"film": path, "scenario": log.name, "frames": count, "cameras": cameras})
        return 0
    if is_picture:
        content = f"picture of {log.name} at {start:g} s"
    else:
        content = f"{counted(count, 'frame')} of {log.name}, {start:g} to {last:g} s"
    say(f"{path}: {content}")
    if name.endswith(".nc"):
        say_next_identify(Path(name), log.name, log.axes, arm=log.provenance.get("variant", "nominal"))
    else:
        say_next("simulate", name)
    return 0


def _cameras(words: str) -> tuple[str, ...]:
    """Names of cameras, checked before the work begins."""
    from hmtb_twin import load_arm
    from hmtb_twin.arm.rendering import scene_model

    scene = scene_model(load_arm())
    available = [*(scene.camera(k).name for k in range(scene.ncam)), "deck"]
    chosen: list[str] = []
    for name in (word.strip() for word in words.split(",")):
        if name not in available:
            raise ScenarioError(unknown("camera", name, available))
        chosen += DECK if name == "deck" else (name,)
    return tuple(chosen)


def view(
    name: Annotated[str | None, tyro.conf.Positional, tyro.conf.arg(metavar="[SCENARIO|LOG]")] = None,
    *,
    payload: str = "rpcm",
    speed: float = 1.0,
    loop: bool = False,
    seed: int | None = None,
) -> int:
    """Show the arm, or an experiment, in MuJoCo's viewer.

    Alone, the arm is moved by hand. Needs a display; hmtb video works without one.

    Args:
        name: A scenario, which is simulated first, or a log NAME.nc. When not given: the arm at the approach point,
            its servos on, with the viewer's own controls.
        payload: What the end effector of the arm alone holds: rpcm, none, ballast or mdm.
        speed: Seconds of the experiment per second of playback.
        loop: Play again and again.
        seed: Seed of a scenario's noise; its own when not given.
    """
    from hmtb_twin import load_arm
    from hmtb_twin.parameters.variants import OPERATING_POSE
    from hmtb_twin.run.playback import play
    from scenarios.experiments.film import load_or_simulate, viewer_module

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
