"""Videos of runs: as many frames as the time takes, which show the poses of their times."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from PIL import Image, ImageSequence

import linkwork as lw
from linkwork.errors import LinkworkError
from linkwork.views import video, write_video

from tests.processes import PATIENCE

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


@pytest.mark.long
def test_frames_show_the_run_at_their_times(slider, tmp_path):
    """x = F t^2 / (2 m): to the right as the square of the time, without jumps."""
    robot, run = slider
    path = write_video(robot, run, tmp_path / "cart.gif", fps=5)
    with Image.open(path) as found:
        assert found.n_frames == 11 and found.info["duration"] == 200 and found.info["loop"] == 0
        assert_pushed(ImageSequence.Iterator(found))


@pytest.mark.long
def test_a_motion_is_shown_at_its_times(slider, tmp_path):
    """Speeding up by 0.8 m/s^2 for half a second, on at 0.4 m/s, and slowing down likewise."""
    robot, run = slider
    limits = lw.motions.AxisLimits(speed=0.4, acceleration=0.8)
    timed = lw.motions.point_to_point(robot.home, {"x": 0.4}, limits, law="trapezoidal")
    motion = lw.motions.follow(robot, timed, samples=151)
    for over, name in ((run, "run.gif"), (motion, "motion.gif")):
        path = write_video(robot, motion, tmp_path / name, fps=10, over=over)
        with Image.open(path) as found:
            places = np.array([spots(frame)[1] for frame in ImageSequence.Iterator(found)])
        time = np.linspace(0, 1.5, 16)
        way = np.where(time < 0.5, 0.4 * time**2, 0.4 * time - 0.1)
        way = np.where(time > 1, 0.4 - 0.4 * (1.5 - time) ** 2, way)
        assert (places - places[0]) / np.ptp(places) == pytest.approx(way / 0.4, abs=0.02)


def test_what_is_no_motion_is_refused(slider, tmp_path):
    robot, run = slider
    with pytest.raises(LinkworkError, match="the motion is 3; give a run, or a motion along"):
        write_video(robot, 3, tmp_path / "x.gif")
    with pytest.raises(LinkworkError, match="the motion is 'x'; give a run"):
        write_video(robot, run, tmp_path / "x.gif", over="x")


def assert_pushed(frames) -> None:
    """Hold what eleven frames show against the closed solution."""
    places = np.array([spots(frame) for frame in frames])
    way = places[:, 1] - places[0, 1]
    assert len(places) == 11 and np.ptp(places[:, 0]) < 1
    assert way / way[-1] == pytest.approx(np.linspace(0, 1, 11) ** 2, abs=0.02)


def test_robots_in_space_and_slower(spatial, tmp_path):
    run = spatial.simulate(spatial.home, duration=0.02)
    path = write_video(spatial, run, tmp_path / "space.gif", fps=10, speed=0.1)
    with Image.open(path) as found:
        lengths = [frame.info["duration"] for frame in ImageSequence.Iterator(found)]
        assert sum(lengths) == 300 and found.size == (500, 500)


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


COPY = """#!{python}
import sys
open(sys.argv[-1], "wb").write(sys.stdin.buffer.read())
"""


def test_mp4_is_made_of_the_same_frames(slider, tmp_path, monkeypatch):
    """A program in ffmpeg's place keeps the frames as they are handed to it."""
    program, path = tmp_path / "ffmpeg", tmp_path / "cart.mp4"
    program.write_text(COPY.format(python=sys.executable))
    program.chmod(0o755)
    monkeypatch.setattr(video, "ffmpeg", lambda: str(program))
    write_video(*slider, path, fps=5)
    frames = np.frombuffer(path.read_bytes(), np.uint8).reshape(-1, 500, 500, 4)
    assert_pushed(Image.fromarray(frame) for frame in frames)


def test_mp4_by_ffmpeg(slider, tmp_path):
    program, path = video.ffmpeg(), tmp_path / "cart.mp4"
    if not program:
        pytest.skip("no ffmpeg: the extra 'video' brings one")
    write_video(*slider, path, fps=5)
    read = [program, "-v", "error", "-i", str(path), "-f", "rawvideo", "-pix_fmt", "rgb24", "-"]
    found = subprocess.run(read, capture_output=True, check=True, timeout=PATIENCE).stdout
    frames = np.frombuffer(found, np.uint8).reshape(-1, 500, 500, 3)
    assert_pushed(Image.fromarray(frame) for frame in frames)


@pytest.mark.skipif(not Path("/bin/false").exists(), reason="no program that fails")
def test_an_ffmpeg_that_fails_is_told(slider, tmp_path, monkeypatch):
    monkeypatch.setattr(video, "ffmpeg", lambda: "/bin/false")
    with pytest.raises(LinkworkError, match="cannot be written: "):
        write_video(*slider, tmp_path / "x.mp4", fps=5)


def test_mp4_without_ffmpeg_is_refused(slider, tmp_path, monkeypatch):
    monkeypatch.setattr(video, "which", lambda _: None)
    monkeypatch.setitem(sys.modules, "imageio_ffmpeg", None)
    with pytest.raises(LinkworkError, match=r"ffmpeg, which writes \.mp4, is not installed; pip"):
        write_video(*slider, tmp_path / "x.mp4")


@pytest.mark.long
def test_another_run_is_laid_over_faintly(slider, tmp_path):
    """Only the run's own joint is orange; the one that stands at the start is pale."""
    robot, run = slider
    still = robot.simulate(robot.home, duration=1.0)
    for over, name in ((None, "alone.gif"), (still, "both.gif")):
        write_video(robot, run, tmp_path / name, fps=5, over=over)
    with Image.open(tmp_path / "both.gif") as both, Image.open(tmp_path / "alone.gif") as alone:
        assert_pushed(ImageSequence.Iterator(both))
        both.seek(10)
        alone.seek(10)
        places = [np.argwhere(pale(frame)) for frame in (both, alone)]
        assert len(places[0]) > 50 > len(places[1])
        assert places[0][:, 1].mean() < spots(both)[1] - 100


def pale(frame) -> np.ndarray:
    """Tell which pixels are of an orange mixed with white."""
    pixels = np.asarray(frame.convert("RGB"), dtype=float)
    return np.abs(pixels - (255 - 0.3 * (255 - ORANGE))).sum(axis=2) < 12
