"""Videos of runs: as many frames as the time takes, which show the poses of their times."""

from __future__ import annotations

import numpy as np
import pytest
from matplotlib.animation import FFMpegWriter
from PIL import Image, ImageSequence

import linkwork as lw
from linkwork.errors import LinkworkError
from linkwork.views import write_video

ORANGE = np.array([230, 159, 0])


def spots(frame) -> np.ndarray:
    """Return the middle of what is driven in a frame [px]."""
    pixels = np.asarray(frame.convert("RGB"), dtype=float)
    return np.argwhere(np.abs(pixels - ORANGE).sum(axis=2) < 30).mean(axis=0)


@pytest.fixture(scope="module")
def slider():
    """Return a slider that is pushed along x, and a run of it over 0.4 m."""
    joint = lw.PrismaticJoint(connects=("ground", "cart"), axis=(1.0, 0.0, 0.0))
    bodies = {"cart": lw.Body(mass=1.0)}
    robot = lw.Robot(lw.Mechanism(bodies=bodies, joints={"x": joint}, actuators=("x",)))
    return robot, robot.simulate(robot.home, [0.2], duration=2.0)


def test_frames_show_the_run_at_their_times(slider, tmp_path):
    """x = F t^2 / (2 m): to the right as the square of the time, without jumps."""
    robot, run = slider
    path = write_video(robot, run, tmp_path / "cart.gif", fps=5)
    with Image.open(path) as video:
        assert video.n_frames == 11 and video.info["duration"] == 200 and video.info["loop"] == 0
        places = np.array([spots(frame) for frame in ImageSequence.Iterator(video)])
    way = places[:, 1] - places[0, 1]
    assert np.ptp(places[:, 0]) < 1
    assert way / way[-1] == pytest.approx(np.linspace(0, 1, 11) ** 2, abs=0.02)


def test_robots_in_space_and_slower(spatial, tmp_path):
    run = spatial.simulate(spatial.home, duration=0.02)
    path = write_video(spatial, run, tmp_path / "space.gif", fps=10, speed=0.1)
    with Image.open(path) as video:
        lengths = [frame.info["duration"] for frame in ImageSequence.Iterator(video)]
        assert sum(lengths) == 300 and video.size == (500, 500)


@pytest.mark.parametrize(
    ("name", "options", "words"),
    [
        ("x.avi", {}, "a video is written as .gif or .mp4, not as 'x.avi'"),
        ("x.gif", {"fps": 0}, "fps is 0; give a number above 0 up to 50"),
        ("x.gif", {"speed": float("nan")}, "speed is nan; give a number above 0"),
        ("x.gif", {"speed": 0.01}, "would have 4001 frames, more than 600; give a higher speed"),
        ("no/x.gif", {}, "x.gif' cannot be written: no such file"),
    ],
)
def test_refusals(slider, tmp_path, name, options, words):
    with pytest.raises(LinkworkError, match=words):
        write_video(*slider, tmp_path / name, **options)


def test_mp4_needs_ffmpeg(slider, tmp_path):
    if FFMpegWriter.isAvailable():
        assert write_video(*slider, tmp_path / "x.mp4", fps=2).stat().st_size > 1000
    else:
        with pytest.raises(LinkworkError, match=r"ffmpeg, which writes \.mp4, is not installed"):
            write_video(*slider, tmp_path / "x.mp4")
