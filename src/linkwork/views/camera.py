"""Pictures of a robot as arrays of pixels, one state at a time, seen from one place."""

from __future__ import annotations

from itertools import product
from typing import Any

import numpy as np

from linkwork.robot import Robot, State
from linkwork.scene.scene import scene_of
from linkwork.views.canvas import Canvas
from linkwork.views.style import styled
from linkwork.views.video import clear, fixed_axes, frame


class Camera:
    """Take pictures of a robot.

    What is seen is as large as all states that were shown need, so that pictures of a robot that
    stays within them have one scale.
    """

    def __init__(self, robot: Robot):
        self.robot = robot
        self._box = np.empty((0, 3))  # corners of all that was drawn
        self._axes: Any = None

    def picture(self, states: State) -> np.ndarray:
        """Return the pixels (height, width, 3) of a picture of a state, a stack of one: red, green
        and blue, from 0 to 255."""
        drawn = np.concatenate([self._box, scene_of(self.robot, states.at(0), states).points])
        box = np.array([*product(*zip(drawn.min(axis=0), drawn.max(axis=0), strict=True))])
        with styled():
            if not np.array_equal(box, self._box):
                self._box, self._axes = box, fixed_axes(self.robot, states, box)
            clear(self._axes)
            frame(self.robot, states, 0, Canvas.on(self._axes, box))
            return pixels(self._axes.figure)


def pixels(figure: Any) -> np.ndarray:
    """Return the pixels (height, width, 3) of a figure."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg

    canvas = FigureCanvasAgg(figure)
    canvas.draw()
    return np.asarray(canvas.buffer_rgba())[..., :3].copy()
