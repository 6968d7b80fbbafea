"""Films and pictures of an experiment, from its log."""

from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np

from hmtb_twin import JointLog
from hmtb_twin.arm.rendering import Stage
from scenarios.experiments.logged_arm import pictured_arm
from scenarios.files.atomic_write import replacing
from scenarios.files.errors import ScenarioError

ENDINGS = (".mp4", ".gif", ".png")
"""Endings of the files that can be written: a film, an animated picture, one picture."""

MOST_FRAMES = 1_000_000
"""Largest number of frames: more are a typing error."""


def frames(
    log: JointLog,
    cameras: Sequence[str],
    *,
    size: tuple[int, int],
    rate: float,
    speed: float,
    span: tuple[float, float],
) -> Iterator[np.ndarray]:
    """Render a log frame by frame.

    Args:
        log: The log.
        cameras: Views, side by side; four of them as two rows of two.
        size: Width and height of each view, pixels.
        rate: Frames per second of film.
        speed: Seconds of the experiment per second of film.
        span: First and last time to show, s.

    Yields:
        Pictures (height, width, 3), 8-bit RGB.
    """
    arm = pictured_arm(log)
    first, last = span
    count = int((last - first) / speed * rate + 1e-9) + 1
    if count > MOST_FRAMES:
        raise ScenarioError(
            f"{count} frames requested, expected at most {MOST_FRAMES}; play it faster, or show less of it"
        )
    with Stage(arm, *size, draft=count > 1) as stage:
        for number in range(count):
            time = first + number * speed / rate
            tick = min(round(time / log.dt), len(log) - 1)
            unit = None if log.unit_pose is None else log.unit_pose[tick]
            views = [stage.picture(camera, log.true_angles[tick], unit) for camera in cameras]
            force = f"wrist {np.linalg.norm(log.wrench[tick, :3]):5.1f} N"
            yield _labelled(_tiled(views), f"{log.name}   {tick * log.dt:6.2f} s   {force}")


def write_film(pictures: Iterator[np.ndarray], path: Path, *, rate: float) -> Path:
    """Write frames of one size as a film: `.mp4` in H.264, `.gif` animated, `.png` the first frame.

    Args:
        pictures: The frames.
        path: File to write.
        rate: Frames per second.

    Returns:
        The path.

    Raises:
        ScenarioError: Another ending, or no encoder for `.mp4`.
    """
    if path.suffix not in ENDINGS:
        ending = path.suffix or "a file without ending"
        raise ScenarioError(f"cannot write a film as {ending!r}; there are: {', '.join(ENDINGS)}")
    with replacing(path) as partial:
        if path.suffix == ".mp4":
            _write_mp4(pictures, partial, rate)
        else:
            _write_picture(pictures, partial, rate, path.suffix)
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


def _write_picture(pictures: Iterator[np.ndarray], path: Path, rate: float, ending: str) -> None:
    from PIL import Image

    images = (Image.fromarray(picture) for picture in pictures)
    first = next(images)
    if ending == ".png":
        first.save(path, format="PNG")
    else:
        rest = [image.quantize(128) for image in images]
        first.quantize(128).save(path, format="GIF", save_all=True, append_images=rest, duration=1000.0 / rate, loop=0)


def _tiled(views: Sequence[np.ndarray]) -> np.ndarray:
    """Return views side by side, four or more in two rows."""
    if len(views) < 4:
        return np.hstack(views)
    half = -(-len(views) // 2)
    rest = [*views[half:], *[np.zeros_like(views[0])] * (2 * half - len(views))]
    return np.vstack((np.hstack(views[:half]), np.hstack(rest)))


def _labelled(picture: np.ndarray, text: str) -> np.ndarray:
    from PIL import Image, ImageDraw, ImageFont

    image = Image.fromarray(picture)
    draw, height = ImageDraw.Draw(image), max(12, picture.shape[0] // 36)
    font = ImageFont.load_default(size=height)
    draw.rectangle((0, 0, draw.textlength(text, font=font) + height, 1.6 * height), fill=(0, 0, 0))
    draw.text((height / 2, height / 4), text, fill=(255, 255, 255), font=font)
    return np.asarray(image)
