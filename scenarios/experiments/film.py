"""Experiments to look at: their logs, files of films and pictures, and MuJoCo's viewer."""

import os
import sys
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import replace
from itertools import chain, islice
from pathlib import Path
from typing import Any

import numpy as np

from hmtb_twin import JointLog, simulate
from hmtb_twin.files.atomic_write import replacing
from scenarios.experiments.registry import load
from scenarios.files.errors import ScenarioError

ENDINGS = (".mp4", ".gif", ".png")
"""Endings of the files that can be written: a film, an animated picture, one picture."""


MOST_GIF = 50
"""Frames per second of a `.gif`: browsers show shorter ones than 20 ms for 100 ms."""

HELD = 200
"""Frames of a `.gif` that are held back to choose its colours from."""

SAMPLED = 8
"""How many of these the colours are chosen from."""


def load_or_simulate(name: str, *, seed: int | None = None, until: float | None = None) -> JointLog:
    """Return a log by name.

    Args:
        name: A file that ends in `.nc`, else a registered scenario or a TOML file, which is simulated.
        seed: Draws other noise, for a scenario.
        until: Last time that is needed of a scenario, s: it is not simulated much further.

    Raises:
        ScenarioError: There is no such scenario, a seed for a file, or the simulation failed.
        TwinError: The file is no joint log.
    """
    if name.endswith(".nc"):
        if seed is not None:
            raise ScenarioError(f"{name} is recorded: a seed belongs to a scenario that is yet to run")
        return JointLog.load(Path(name))
    scenario = load(name, seed=seed)
    if until is not None and 0.0 <= until < scenario.duration:
        # Refused where something is to happen after it, such as a change of payload.
        with suppress(ScenarioError):
            scenario = replace(scenario, duration=min(until + 1.0, scenario.duration))
    result = simulate([scenario])
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
    if path.suffix == ".gif" and rate > MOST_GIF:
        raise ScenarioError(f"{rate:g} frames per second given, expected at most {MOST_GIF} in a .gif; .mp4 holds more")
    with replacing(path) as partial:
        if path.suffix == ".mp4":
            _write_mp4(pictures, partial, rate)
        elif path.suffix == ".gif":
            _write_gif(pictures, partial, rate)
        else:
            from PIL import Image

            Image.fromarray(next(pictures)).save(partial, format="PNG")
    return path


def _write_gif(pictures: Iterator[np.ndarray], path: Path, rate: float) -> None:
    """Write with one palette and without dithering: what stands still is stored once, and grey stays grey."""
    from PIL import Image

    held_back = list(islice(pictures, HELD))
    chosen = np.linspace(0, len(held_back) - 1, min(len(held_back), SAMPLED)).round().astype(int)
    sample = Image.fromarray(np.vstack([held_back[index] for index in chosen]))
    palette = sample.quantize(256, method=Image.Quantize.MEDIANCUT, kmeans=1)
    # Pillow looks up the lowest of each four neighbouring values, which would make all darker by 1 to 2 of 255.
    colours = np.array(palette.getpalette())
    triples = colours.reshape(-1, 3)
    # The mean of paper and the lightest tints is not quite white.
    triples[triples.min(axis=1) > 247] = 255
    palette.putpalette(np.maximum(colours - 1, 0).tolist())

    def reduced() -> Iterator[Image.Image]:
        for index, picture in enumerate(chain(held_back, pictures)):
            image = Image.fromarray(picture).quantize(palette=palette, dither=Image.Dither.NONE)
            image.putpalette(colours.tolist())
            # a file has whole hundredths of a second: rounded so that the errors do not add up
            image.info["duration"] = 10 * (round(100 * (index + 1) / rate) - round(100 * index / rate))
            yield image

    images = reduced()
    next(images).save(path, "GIF", save_all=True, append_images=images, loop=0)


def _write_mp4(pictures: Iterator[np.ndarray], path: Path, rate: float) -> None:
    try:
        import av
    except ImportError as error:
        raise ScenarioError(
            "an .mp4 needs the encoder: pip install 'hmtb-twin[video]'; a .gif or .png does without"
        ) from error
    from fractions import Fraction

    from av.video.reformatter import ColorRange, Colorspace

    # With its index at the front a browser plays it while it loads.
    with av.open(str(path), "w", format="mp4", options={"movflags": "+faststart"}) as container:
        stream = None
        for picture in pictures:
            if stream is None:
                # Rates such as 29.97 per second are multiples of 1/1001.
                stream = container.add_stream("libx264", rate=Fraction(rate).limit_denominator(1001))
                stream.height, stream.width = picture.shape[0] // 2 * 2, picture.shape[1] // 2 * 2
                stream.pix_fmt, stream.options = "yuv420p", {"crf": "17", "preset": "medium"}
                # Named, because players guess the matrix by the size.
                codec = stream.codec_context
                codec.colorspace = codec.color_primaries = codec.color_trc = Colorspace.ITU709
                codec.color_range = ColorRange.MPEG
            # The encoder takes even sizes only: the last odd row or column is cut off.
            even = np.ascontiguousarray(picture[: stream.height, : stream.width])
            frame = av.VideoFrame.from_ndarray(even, format="rgb24")
            container.mux(stream.encode(frame.reformat(format="yuv420p", dst_colorspace=Colorspace.ITU709)))
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
