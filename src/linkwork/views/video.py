"""A video of a run or motion: the mechanism as pictures draw it, one frame after the other, seen
from one place.

GIF is written by Pillow, MP4 by ffmpeg: the one that is installed, or that which comes with the
extra `video`.
"""

from __future__ import annotations

from pathlib import Path
from shutil import which
from subprocess import CalledProcessError
from typing import Any

import numpy as np

from linkwork.checks import file_path, writing
from linkwork.errors import LinkworkError
from linkwork.patience import announced
from linkwork.robot import Motion, Robot, State
from linkwork.scene.scene import scene_of
from linkwork.scene.seen_runs import shown_robot
from linkwork.simulation import Run
from linkwork.views import plane, space
from linkwork.views.canvas import Canvas
from linkwork.views.drawing import new_axes, paint
from linkwork.views.motion import laid_over, nearest_samples, timed_states
from linkwork.views.style import styled

MOST = 600  # frames
DOTS = 100  # per inch
FASTEST = 50  # frames per second, which is what GIF holds
FAINT, BELOW = 0.3, -1.0  # how strong what is laid over is drawn, and how far below the run
AROUND = 0.06  # room about a plane mechanism, relative to its size


@announced("drawing the video")
def write_video(
    robot: Robot,
    run: Run | Motion,
    path: str | Path,
    *,
    fps: float = 20.0,
    speed: float = 1.0,
    over: Run | Motion | None = None,
) -> Path:
    """Write a run, or a motion along a path, as a video; a file that exists is replaced.

    Args:
        robot: whose run it is, shown with the numbers that it had in it.
        run: the run, of which frames show the saved samples, and those between them where it can be
            run again; or a motion, of which they show the samples.
        path: of the video, ending in .gif, or in .mp4 where there is ffmpeg.
        fps: frames per second of the video, up to 50.
        speed: seconds of the run in one second of the video.
        over: another run or motion of the robot, which is shown faintly at the same times.

    Returns:
        The path.

    Raises:
        LinkworkError: a run of another robot or of no length, another suffix, no ffmpeg, more than
            600 frames, a file that cannot be written.
    """
    # What is asked for, and what can be written.
    path = file_path(path, "the path of a video")
    for name, value, most in (("fps", fps, FASTEST), ("speed", speed, np.inf)):
        plain = isinstance(value, int | float) and not isinstance(value, bool)
        if not plain or not 0 < value <= most or value == np.inf:
            bound = f" up to {most}" if most < np.inf else ""
            raise LinkworkError(f"{name} is {value!r}; give a number above 0{bound}")
    writer = writer_for(path, fps)
    robot = shown_robot(robot, run)
    time, states = timed_states(robot, run)
    length = float(np.ptp(time)) / speed
    if not length > 0:
        raise LinkworkError("the run has no length in time; there is nothing to move")
    count = round(length * fps) + 1
    if count > MOST:
        raise LinkworkError(
            f"the video would have {count} frames, more than {MOST}; give a higher speed than "
            f"{speed:g} or a lower fps than {fps:g}"
        )
    # Of every frame the sample that is the nearest in time.
    shown = np.linspace(time[0], time[-1], count)
    chosen, order = np.unique(nearest_samples(time, shown), return_inverse=True)
    faint = None
    if over is not None:
        other, moved = laid_over(robot, over)
        faint = moved.at(nearest_samples(other, shown))
    try:
        with writing(path), styled():
            draw_all(robot, states.at(chosen), order, faint, writer, path)
    except CalledProcessError as error:
        raise LinkworkError(
            f"'{path}' cannot be written: ffmpeg ends with {error.returncode}; write a .gif"
        ) from None
    return path


def writer_for(path: Path, fps: float) -> Any:
    """Return what writes a video of a suffix."""
    from matplotlib.animation import FFMpegWriter, PillowWriter

    class Encoder(FFMpegWriter):
        @classmethod
        def bin_path(cls) -> str:
            return program

    match path.suffix.lower():
        case ".gif":
            return PillowWriter(fps=fps)  # pyright: ignore[reportArgumentType]
        case ".mp4" if program := ffmpeg():
            return Encoder(fps=fps)  # pyright: ignore[reportArgumentType]
        case ".mp4":
            raise LinkworkError(
                "ffmpeg, which writes .mp4, is not installed; pip install 'linkwork[video]' brings "
                "it, or write a .gif"
            )
    raise LinkworkError(f"a video is written as .gif or .mp4, not as {path.name!r}")


def ffmpeg() -> str:
    """Return the path of ffmpeg: of the one that is installed, else that of imageio-ffmpeg; empty
    without either."""
    import matplotlib

    installed = which(str(matplotlib.rcParams["animation.ffmpeg_path"]))
    if installed:
        return installed
    try:
        from imageio_ffmpeg import get_ffmpeg_exe

        return get_ffmpeg_exe()
    except (ImportError, RuntimeError):  # the extra is missing, or brings none for this system
        return ""


def draw_all(
    robot: Robot, states: State, order: np.ndarray, faint: State | None, writer: Any, path: Path
) -> None:
    """Draw the states (K,) in an order (F,) of their numbers, on the same axes; faint: states (F,)
    that are laid over."""
    # Axes that all states fit on.
    points = scene_of(robot, states.at(-1), states).points
    if faint is not None:
        points = np.concatenate([points, scene_of(robot, faint.at(-1), faint).points])
    axes = fixed_axes(robot, states, points)
    # One frame after the other; states that stay are drawn once.
    last = -1
    with writer.saving(axes.figure, str(path), DOTS):
        for count, number in enumerate(order):
            if number != last or faint is not None:
                clear(axes)
                if faint is not None:
                    frame(robot, faint, count, Canvas.on(axes, points).at(FAINT, BELOW))
                frame(robot, states, int(number), Canvas.on(axes, points))
                last = number
            writer.grab_frame()


def fixed_axes(robot: Robot, states: State, points: np.ndarray) -> Any:
    """Return axes that states (K,) with these points fit on, with the first one drawn, and that
    stay as they are."""
    axes = new_axes(points, robot.planar)
    frame(robot, states, 0, Canvas.on(axes, points))
    (plane if robot.planar else space).finish(Canvas.on(axes, points))
    if robot.planar:
        axes.set_aspect("equal", adjustable="box")
        limits = axes.get_xlim(), axes.get_ylim()
        room = AROUND * float(np.ptp(points[:, :2], axis=0).max())
        for own, column, put in zip(limits, points.T, (axes.set_xlim, axes.set_ylim), strict=False):
            put(min(own[0], column.min() - room), max(own[1], column.max() + room))
        axes.figure.draw_without_rendering()
    else:
        space.fit(axes)
    axes.figure.set_layout_engine("none")
    axes.set_autoscale_on(False)
    return axes


def clear(axes: Any) -> None:
    """Take away what is drawn on axes."""
    for artist in (*axes.collections, *axes.lines, *axes.patches, *axes.texts):
        artist.remove()


def frame(robot: Robot, states: State, number: int, canvas: Canvas) -> None:
    """Draw one of the states; rails are as long as all of them need. Of a faint one only what
    moves is drawn."""
    for part in scene_of(robot, states.at(number), states).parts:
        if canvas.strength == 1.0 or not (part.look.grounded or part.role == "tool"):
            paint(canvas, part)
