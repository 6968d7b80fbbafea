"""Experiments to look at: their logs, files of films and pictures, and MuJoCo's viewer."""

import os
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from hmtb_twin import JointLog, simulate
from hmtb_twin.files.atomic_write import replacing
from scenarios.experiments.registry import load
from scenarios.files.errors import ScenarioError

ENDINGS = (".mp4", ".gif", ".png")
"""Endings of the files that can be written: a film, an animated picture, one picture."""


def load_or_simulate(name: str, *, seed: int | None = None) -> JointLog:
    """Return a log by name.

    Args:
        name: A file that ends in `.nc`, else a registered scenario or a TOML file, which is simulated.
        seed: Draws other noise, for a scenario.

    Raises:
        ScenarioError: There is no such scenario, a seed for a file, or the simulation failed.
        TwinError: The file is no joint log.
    """
    if name.endswith(".nc"):
        if seed is not None:
            raise ScenarioError(f"{name} is recorded: a seed belongs to a scenario that is yet to run")
        return JointLog.load(Path(name))
    result = simulate([load(name, seed=seed)])
    for label, reason in result.failed.items():
        raise ScenarioError(f"{label}: {reason}")
    return result.logs[0]


def write_film(pictures: Iterator[np.ndarray], path: Path, *, rate: float) -> Path:
    """Write frames of one size as a film: `.mp4` in H.264, `.gif` animated, `.png` the first frame.

    Args:
        pictures: The frames.
        path: File to write.
        rate: Frames per second.

    Raises:
        ScenarioError: Another ending, or no encoder for `.mp4`.
    """
    if path.suffix not in ENDINGS:
        ending = path.suffix or "a file without ending"
        raise ScenarioError(f"cannot write a film as {ending!r}; there are: {', '.join(ENDINGS)}")
    with replacing(path) as partial:
        if path.suffix == ".mp4":
            _write_mp4(pictures, partial, rate)
            return path
        from PIL import Image

        images = (Image.fromarray(picture) for picture in pictures)
        first = next(images)
        if path.suffix == ".png":
            first.save(partial, format="PNG")
        else:
            rest, pause = [image.quantize(128) for image in images], 1000.0 / rate
            first.quantize(128).save(partial, "GIF", save_all=True, append_images=rest, duration=pause, loop=0)
    return path


def _write_mp4(pictures: Iterator[np.ndarray], path: Path, rate: float) -> None:
    try:
        import av
    except ImportError as error:
        raise ScenarioError(
            "an .mp4 needs the encoder: pip install 'hmtb-twin[video]'; a .gif or .png does without"
        ) from error
    from fractions import Fraction

    with av.open(str(path), "w", format="mp4") as container:
        stream = None
        for picture in pictures:
            if stream is None:
                stream = container.add_stream("libx264", rate=Fraction(rate).limit_denominator(1001))
                stream.height, stream.width = picture.shape[0] // 2 * 2, picture.shape[1] // 2 * 2
                stream.pix_fmt, stream.options = "yuv420p", {"crf": "20"}
            # The encoder takes even sizes only: the last odd row or column is cut off.
            even = np.ascontiguousarray(picture[: stream.height, : stream.width])
            container.mux(stream.encode(av.VideoFrame.from_ndarray(even, format="rgb24")))
        if stream is not None:
            container.mux(stream.encode(None))


def viewer_module() -> Any:
    """Return MuJoCo's viewer; raises `ScenarioError` where there is no display to open its window on."""
    if sys.platform == "linux" and not (os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY")):
        raise ScenarioError(
            "no display here, so no window for the viewer; hmtb station shows the arm in a browser, "
            "hmtb video makes films without one"
        )
    import mujoco.viewer

    return mujoco.viewer
