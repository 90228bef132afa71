"""A mechanism along a motion: poses at equal distances, the last in full, and the path of its
tool."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from linkwork.checks import MOST, count, needed, shown, switch
from linkwork.errors import LinkworkError
from linkwork.robot import Motion, Robot, State
from linkwork.scene.colours import BLUE
from linkwork.scene.seen_runs import require_lengths, shown_robot
from linkwork.simulation import Run
from linkwork.views import space
from linkwork.views.drawing import plot_mechanism
from linkwork.views.style import styled

if TYPE_CHECKING:
    from matplotlib.axes import Axes

POSES = 6


def plot_motion(
    robot: Robot,
    motion: Run | Motion | State,
    ax: Axes | None = None,
    *,
    poses: int = POSES,
    path: bool = True,
) -> Axes:
    """Draw a stroboscopic picture of a motion: the later the stronger, at equal distances along it.

    Args:
        robot: whose motion it is; of a run with the numbers that it had.
        motion: a run, a motion along a path, or a stack (K,) of states in the order of time.
        ax: where to draw, three-dimensional for a spatial robot; left out: axes of a new figure.
        poses: how many to draw, at most.
        path: draw the path of the tool, if the robot has one.

    Returns:
        The axes; `axes.figure` is the figure.

    Raises:
        LinkworkError: a run of another robot, or one that holds no sample; no pose to draw.
    """
    count(poses, "poses", MOST)
    switch(path, "path")
    needed(robot, Robot)
    robot = shown_robot(robot, motion)
    states = states_of(robot, motion.smooth if isinstance(motion, Run) else motion)
    axes: Any = plot_mechanism(robot, states.at(spaced(robot, states, poses)), ax)
    if path and robot.mechanism.tools and len(states.q) > 1:
        place = tool_places(robot, states)[:, : 2 if robot.planar else 3]
        with styled():
            axes.plot(*place.T, color="white", lw=3, zorder=5)
            axes.plot(*place.T, color=BLUE, lw=1.3, zorder=5.1)
            if not robot.planar:
                space.take_in(axes, place)
                if ax is None:
                    space.fit(axes)
    return axes


def tool_places(robot: Robot, states: State) -> np.ndarray:
    """Return the origin (K, 3) [m] of the first tool in the ground's axes, whatever body its
    pose is told relative to."""
    tool = robot.mechanism.first_tool
    place, turn = robot.body_poses(states)[tool.body]
    return place + turn @ np.array(tool.frame.position)


def states_of(robot: Robot, motion: Run | Motion | State) -> State:
    """Return the states (K,) of a motion of this robot.

    Raises:
        LinkworkError: a run of another robot, or without samples; states that are no stack.
    """
    needed(robot, Robot)
    if isinstance(motion, Run):
        return run_states(robot, motion)
    states = motion.state if isinstance(motion, Motion) else motion
    robot.own(states)
    if len(states.batch) != 1 or not states.batch[0]:
        raise LinkworkError(
            f"a stack of states of shape {states.batch} is no motion; give one dimension, not empty"
        )
    return states


def timed_states(robot: Robot, motion: Run | Motion) -> tuple[np.ndarray, State]:
    """Return the times (K,) [s] of a motion's samples, and the states (K,) at these; of a run those
    that it shows smoothly.

    Raises:
        LinkworkError: neither a run nor a motion; one of another robot, or without samples.
    """
    if not isinstance(motion, Run | Motion):
        raise LinkworkError(f"the motion is {shown(motion)}; give a run, or a motion along a path")
    drawn = motion.smooth if isinstance(motion, Run) else motion
    return np.asarray(drawn.time, float), states_of(robot, drawn)


def laid_over(robot: Robot, over: Run | Motion) -> tuple[np.ndarray, State]:
    """Return the times (K,) [s] and the states (K,) of a motion that is shown over another one of
    the robot.

    Raises:
        LinkworkError: as `timed_states`; a run of other lengths.
    """
    needed(robot, Robot)
    require_lengths(robot, over)
    return timed_states(robot, over)


def run_states(robot: Robot, run: Run) -> State:
    """Return the configurations (K,) of a run, at rest."""
    name, found = robot.mechanism.name, tuple(map(str, run.coords["coordinate"].values))
    strange = [label for label in found if label not in robot.coordinates]
    lacking = [label for label in robot.coordinates if label not in found]
    if strange or lacking:
        what = f"it has the joint {strange[0]!r}" if strange else f"it has no joint {lacking[0]!r}"
        raise LinkworkError(f"the run is not one of the robot {name!r}: {what}")
    if not len(run.coords["time"].values):
        raise LinkworkError("the run holds no sample; there is nothing to draw (see save_at)")
    values = run.variables["joint_position"].values
    try:
        return robot.state(dict(zip(found, values.T, strict=True)))
    except LinkworkError as error:
        raise LinkworkError(f"the run is not one of the robot {name!r}: {error}") from None


def nearest_samples(time: np.ndarray, wanted: np.ndarray) -> np.ndarray:
    """Return the numbers of the samples, at increasing times (K,), that are nearest to times
    (F,)."""
    if len(time) < 2:
        return np.zeros(len(wanted), int)
    later = np.searchsorted(time, wanted).clip(1, len(time) - 1)
    return later - (wanted - time[later - 1] < time[later] - wanted)


def spaced(robot: Robot, states: State, count: int) -> np.ndarray:
    """Return the places of so many states at equal distances along a motion, its first and its last
    among them.

    Distance is the way of all bodies' origins together.
    """
    places = np.stack([p for p, _ in robot.body_poses(states).values()], axis=1)
    steps = np.linalg.norm(np.diff(places, axis=0), axis=2).sum(axis=1)
    way = np.concatenate([[0.0], np.cumsum(steps)])
    marks = np.linspace(1, 0, count) * way[-1]
    return np.unique(np.searchsorted(way, marks).clip(0, len(way) - 1))
