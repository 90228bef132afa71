"""Seeing: a drag step of the viewer, and the size of the paper's report."""

from __future__ import annotations

import tempfile
from collections.abc import Callable
from pathlib import Path
from threading import Event
from time import monotonic, perf_counter

import numpy as np

import linkwork as lw
from linkwork.lab import reproduction
from linkwork.robots import stewart
from linkwork.viewer.session import Session
from linkwork.viewer.viewer import FRAME, Viewer

from benchmarks.table import Figure, Section
from benchmarks.timing import summary

STEP = 5.0  # [ms]
REACH, TURNS = 0.25, 40  # radius of the circle that the hand draws [m], frames to a turn
LARGEST = 3.0  # [MB]
DRAG_METHOD = f"""
    The handle of the Stewart platform's tool is led around a circle of {REACH} m radius, {TURNS}
    positions to a turn at 30 frames a second. A step: the new wish, the robot led towards it with
    its loops closed, and all that is to be seen worked out (places of all parts, forces that hold
    the pose, conditioning, closure). A frame is a step and handing everything to the server, in the
    viewer's own thread, with no browser connected. Medians, and the longest of all.
    """
REPORT_METHOD = """
    The page that `linkwork reproduce` writes: figures, animation and tables in one file that needs
    nothing else.
    """


def drag(steps: int = 200, rounds: int = 3) -> Section:
    """Time steps and frames of a drag, in turn."""
    robot = lw.Robot(stewart())
    session = Session(robot)
    taken = [
        (*dragged(session, lambda wish: stepped(session, wish), steps), framed(robot, steps))
        for _ in range(rounds)
    ]
    alone, frames = (np.concatenate([one[i] for one in taken]) for i in (0, 2))
    gap = max(one[1] for one in taken)
    figures = [
        Figure("a drag step: assemble and update", 1e3 * float(np.median(alone)), "ms", STEP),
        Figure("the same, 99 of 100 steps", 1e3 * float(np.quantile(alone, 0.99)), "ms"),
        Figure("a frame, with everything handed to the server", 1e3 * float(np.median(frames)),
               "ms", note=f"longest {1e3 * frames.max():.3g} ms"),
        Figure("largest closure error along the drag", gap, "m", 1e-9),
    ]  # fmt: skip
    return Section(
        "Dragging the Stewart platform",
        DRAG_METHOD,
        figures,
        {"step": summary(alone), "frame": summary(frames)},
    )


def stepped(session: Session, wish: Callable[[], None]) -> None:
    """Carry out a wish and work out what is to be seen."""
    wish()
    session.advance(FRAME)
    session.view()


def dragged(
    session: Session, frame: Callable[[Callable[[], None]], None], steps: int
) -> tuple[np.ndarray, float]:
    """Lead the tool around; return the time of each frame (steps) [s] and the largest closure
    error."""
    view = session.view()
    assert view.tool is not None
    (middle, R), seconds, gap = view.tool, np.empty(steps), 0.0
    for k in range(steps):
        angle = 2 * np.pi * k / TURNS
        position = middle + REACH * np.array([np.sin(angle), 1 - np.cos(angle), 0.0])
        start = perf_counter()
        frame(lambda position=position: session.drag(position, R))
        seconds[k] = perf_counter() - start
        gap = max(gap, float(session.robot.closure_error(session.state)))
    return seconds, gap


def framed(robot: lw.Robot, steps: int) -> np.ndarray:
    """Return the time of each frame of a viewer that serves (steps) [s]; its own thread takes
    it."""
    found: list[np.ndarray] = []
    done = Event()
    with Viewer(robot) as viewer:

        def measure() -> None:
            found.append(
                dragged(
                    viewer.session, lambda wish: viewer.tick([wish], FRAME, monotonic()), steps
                )[0]
            )
            done.set()

        viewer.post(measure)
        assert done.wait(120.0), "the viewer's thread did not answer"
    return found[0]


def report() -> Section:
    """Write the paper's report and weigh it."""
    start = perf_counter()
    comparison = reproduction.study()
    with tempfile.TemporaryDirectory() as folder:
        page, *_ = reproduction.write(comparison, Path(folder))
        size = page.stat().st_size
    seconds = perf_counter() - start
    figures = [
        Figure("the report's page", 1e-6 * size, "MB", LARGEST),
        Figure(
            "carrying out the study and writing the report",
            seconds,
            "s",
            note=f"{len(comparison.engines)} engines",
        ),
    ]
    return Section("The paper's report", REPORT_METHOD, figures, {"bytes": size})
