"""Films and pictures of an experiment."""

import os
import subprocess
import sys
from unittest.mock import MagicMock, Mock

import av
import mujoco
import numpy as np
import pytest
from PIL import Image

from hmtb_twin import JointLog, TwinError, load_arm, render, simulate
from hmtb_twin.arm.rendering import Stage
from hmtb_twin.parameters.resources import model_file
from hmtb_twin.parameters.values import LARGE_MOTION
from hmtb_twin.parameters.variants import OPERATING_POSE
from hmtb_twin.run.playback import frame_times, frames, play
from scenarios import Excitation, Scenario
from scenarios.experiments.film import load_or_simulate, write_film
from tests.refusals import refused


@pytest.fixture(scope="module")
def opengl():
    """Leaves a test out where the machine cannot render."""
    try:
        render(load_arm(), width=16, height=16)
    except TwinError as error:
        pytest.skip(str(error))


@pytest.fixture(scope="module")
def log(tmp_path_factory):
    fast = Excitation("sine", {"frequency": 0.5, "amplitude": 4.0})
    (log,) = simulate([Scenario("swing", ("shoulder_yaw",), (fast,), duration=2.0, hand_controller=LARGE_MOTION)]).logs
    return log.save(tmp_path_factory.mktemp("film") / "swing.nc")


@pytest.mark.slow
@pytest.mark.usefixtures("opengl")
def test_a_film_shows_the_arm_move(log, tmp_path, result):
    film = tmp_path / "swing.mp4"
    shown = result("video", log, "--out", film, "--fps", 5, "--width", 160, "--height", 120)
    assert shown == {"film": str(film), "scenario": "swing", "frames": 10, "cameras": ["overview"]}
    with av.open(str(film)) as container:
        pictures = [frame.to_ndarray(format="rgb24") for frame in container.decode(video=0)]
    assert (len(pictures), pictures[0].shape) == (10, (120, 160, 3))
    moved = np.abs(pictures[5][20:].astype(float) - pictures[0][20:])
    assert (moved > 40).mean() > 0.005, "the arm swings 10 degrees in half a second"


@pytest.mark.slow
@pytest.mark.usefixtures("opengl")
def test_an_empty_hand_is_shown_empty():
    bare, loaded = (render(load_arm(payload=name), "overview", 160, 120) for name in ("none", "rpcm"))
    assert np.ptp(bare) > 100
    assert (np.abs(bare.astype(float) - loaded).max(axis=2) > 40).sum() > 10


@pytest.mark.slow
@pytest.mark.usefixtures("opengl")
def test_several_cameras_in_one_picture(log, tmp_path, printed):
    deck = tmp_path / "deck.png"
    printed("video", log, "--camera", "deck", "--width", 80, "--height", 60, "--out", deck)
    picture = np.asarray(Image.open(deck))
    assert picture.shape == (120, 160, 3)
    quarters = [picture[a : a + 60, b : b + 80] for a in (0, 60) for b in (0, 80)]
    assert all(quarter.std() > 10 for quarter in quarters)
    assert not np.array_equal(quarters[1], quarters[2])


@pytest.mark.usefixtures("opengl")
def test_a_gif_and_a_speed(log, tmp_path, printed):
    gif = tmp_path / "swing.gif"
    words = ("--fps", 4, "--speed", 2, "--width", 64, "--height", 48, "--start", 0.5, "--duration", 1)
    printed("video", log, "--out", gif, *words)
    with Image.open(gif) as animation:
        assert animation.n_frames == 3


@pytest.mark.slow
@pytest.mark.usefixtures("opengl")
def test_edges_of_films_are_smooth():
    arm = load_arm()
    with Stage(arm, 160, 120, draft=True) as stage:
        shown = stage.picture("overview", arm.pose(OPERATING_POSE)).astype(int)
    with Stage(arm, 640, 480, draft=True) as stage:
        fine = np.asarray(Image.fromarray(stage.picture("overview", arm.pose(OPERATING_POSE))).reduce(4))
    # 129 with one sample a pixel, 11 with four.
    assert (np.abs(shown - fine).max(axis=2) > 40).sum() < 40


@pytest.mark.slow
@pytest.mark.usefixtures("opengl")
def test_views_of_one_film_are_named(log):
    record, times = JointLog.load(log), frame_times((0.0, 0.1), rate=10)
    one = next(frames(record, ("port",), size=(160, 120), times=times))
    two = next(frames(record, ("port", "starboard"), size=(160, 120), times=times))
    assert two.shape == (120, 320, 3)
    for left in (0, 160):
        corner = two[-19:, left : left + 30]
        assert corner.min() == 0 and corner.max() > 200
        assert (corner[0] == 0).all(), "letters stand on black"
    assert not np.array_equal(one[-19:, :30], two[-19:, :30])


def test_a_film_plays_in_a_browser(tmp_path):
    rng = np.random.default_rng(1)
    colours = rng.integers(0, 255, (4, 3), dtype=np.uint8)
    path = write_film((np.tile(colour, (730, 1281, 1)) for colour in colours), tmp_path / "a.mp4", rate=25)
    data = path.read_bytes()
    assert 0 < data.find(b"moov") < data.find(b"mdat"), "its index stands before its pictures"
    with av.open(str(path)) as container:
        codec = container.streams.video[0].codec_context
        assert (codec.name, codec.pix_fmt, codec.width, codec.height) == ("h264", "yuv420p", 1280, 730)
        shown = [frame.to_ndarray(format="rgb24")[300, 600] for frame in container.decode(video=0)]
    assert np.abs(np.array(shown).astype(int) - colours).max() <= 4


def test_a_gif_keeps_grey_and_few_bright_pixels(tmp_path):
    shade = np.linspace(0, 255, 320).astype(np.uint8)
    picture = np.repeat(np.tile(shade, (200, 1))[:, :, None], 3, axis=2)
    picture[:4, :4], picture[:60, 200:300] = (213, 94, 0), np.clip(shade[200:300, None] * [0.9, 0.95, 1.0], 0, 255)
    moving = [np.roll(picture, 5 * number, axis=0) for number in range(12)]
    for rate in (30, 50):
        with Image.open(write_film(iter(moving), tmp_path / f"{rate}.gif", rate=rate)) as gif:
            spans = []
            for number in range(gif.n_frames):
                gif.seek(number)
                spans.append(gif.info["duration"])
        assert abs(sum(spans) - 1000 * len(moving) / rate) <= 10
    refused("60 frames per second given", write_film, iter(moving), tmp_path / "60.gif", rate=60)
    with Image.open(write_film(iter(moving), tmp_path / "a.gif", rate=25)) as gif:
        for number, frame in enumerate(moving):
            gif.seek(number)
            shown = np.asarray(gif.convert("RGB")).astype(int)
            grey = np.ptp(frame.astype(int), axis=2) == 0
            assert np.ptp(shown, axis=2)[grey].mean() < 2.0
            assert np.abs(shown - frame).mean() < 2.0
            assert np.abs(shown[5 * number, 1] - [213, 94, 0]).max() < 12


@pytest.mark.slow
@pytest.mark.parametrize("name", ["siso-8-elbow_pitch", "mimo-5", "rpcm"])
def test_a_scenario_is_simulated_no_further_than_needed(name):
    short, longer = load_or_simulate(name, until=0.5), load_or_simulate(name, until=2.0)
    assert len(short) == 75
    np.testing.assert_array_equal(short.measured, longer.measured[:75])
    np.testing.assert_array_equal(short.commanded, longer.commanded[:75])


@pytest.mark.parametrize(
    ("words", "says"),
    [
        (["--out", "x.avi"], "'.avi'"),
        (["--camera", "moon", "--out", "x.png"], "wrist_camera, deck"),
        (["--start", "500", "--out", "x.png"], "nothing to show from 500 s; swing lasts from 0 to 2 s"),
        (["--start", "5", "--duration", "1", "--out", "x.png"], "nothing to show from 5 s for 1 s; swing"),
        (["--fps", "0"], "--fps must be above 0"),
        (["--width", "5", "--out", "x.png"], "16 to 4096"),
        (["--seed", "3"], "is recorded"),
    ],
)
def test_what_cannot_be_filmed_is_one_line(log, words, says, complaint, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert says in complaint("video", log, *words)
    assert not list(tmp_path.iterdir()), "nothing half-written is left"


def test_a_log_plays_back_tick_by_tick(log):
    """A window that a test can look into, in place of MuJoCo's."""
    poses = []

    def launched(model, data, **_):
        window = MagicMock(cam=mujoco.MjvCamera())
        window.__enter__.return_value = window
        window.sync.side_effect = lambda: poses.append((data.time, data.qpos[:7].copy()))
        return window

    record = JointLog.load(log)
    play(record, Mock(launch_passive=launched), speed=20.0)
    assert len(poses) > 2
    for time, angles in poses:
        np.testing.assert_array_equal(angles, record.true_angles[round(time / record.dt)])


@pytest.mark.slow
def test_an_opengl_back_end_that_does_not_load_is_one_line():
    words = [sys.executable, "-m", "scenarios", "truth"]
    run = subprocess.run(words, env={**os.environ, "MUJOCO_GL": "bogus"}, capture_output=True, text=True, check=False)
    assert (run.returncode, run.stdout, run.stderr.count("\n")) == (2, "", 1)
    assert "MUJOCO_GL='bogus'" in run.stderr


def test_help_names_every_camera(printed):
    scene = mujoco.MjModel.from_xml_path(str(model_file("hmtb/scene.xml")))
    help_text = printed("video", "--help")
    assert all(scene.camera(number).name in help_text for number in range(scene.ncam))


@pytest.mark.skipif(sys.platform != "linux", reason="only there the display is known before a window opens")
def test_without_a_display_nothing_is_simulated_or_announced(monkeypatch, complaint):
    for name in ("DISPLAY", "WAYLAND_DISPLAY"):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setattr("scenarios.experiments.film.load_or_simulate", lambda *_, **__: pytest.fail("simulated"))
    text = complaint("view", "siso-1-elbow_pitch")
    assert "no display here" in text and "hmtb video makes films without one" in text
