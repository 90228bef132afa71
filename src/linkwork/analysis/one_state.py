"""The shortest way from Python through a kernel at one state: below a microsecond.

The numbers go to the machine code as bytes, for an array tells its address slowly; the code keeps
watch over its result itself (pivot, determinant, sum), and Python reads three numbers instead of
looking arrays through. What is not plain, or is doubted, is left to others: None.
"""

from __future__ import annotations

import ctypes
import threading
from collections.abc import Callable
from math import isfinite

import numpy as np

from linkwork.kernels import Kernel
from linkwork.model.checks import DOUBLE, PIVOT_BOUND
from linkwork.model.state import State
from linkwork.robot import Robot

Quick = Callable[..., np.ndarray | None]
MACHINE_CODE = ctypes.PYFUNCTYPE(None, ctypes.c_void_p, ctypes.c_void_p)
WATCHED = 3  # numbers after the result


def one_state(
    kernel: Kernel, robot: Robot, shape: tuple[int, ...], least: float, of_state: bool
) -> Quick:
    """Return a function of one state, and of a vector where the kernel takes one, that gives the
    result as an array of a shape, or None.

    kernel: (q, rates of the state or a vector, p) -> result, pivot, determinant, sum
    least: determinant that is doubted
    of_state: whether the kernel takes the state's own rates, in the robot's home chart
    """
    room, code = ResultRoom(kernel.n_out, shape), None
    join: Callable[..., bytes] = b"".join
    coordinates, independent, tail = robot.coordinates, robot.independent, robot.p.tobytes()
    length = 8 * kernel.n_in
    numbers = kernel.n_in - robot.equations.nq - len(robot.p)

    def found(state: State, given: np.ndarray | None = None) -> np.ndarray | None:
        nonlocal code
        # What the code takes, as bytes; states and vectors that are not plain go another way.
        try:
            q = state.q
            if state.coordinates is not coordinates or q.ndim != 1:
                return None
            if of_state:
                if state.independent is not independent and state.independent != independent:
                    return None
                taken = join((q, state.rates, tail))
            elif not numbers:
                taken = join((q, tail))
            elif isinstance(given, np.ndarray) and given.dtype is DOUBLE and given.ndim == 1:
                taken = join((q, given, tail))
            else:
                return None
        except (AttributeError, TypeError, BufferError):
            return None
        if len(taken) != length:
            return None
        # What it gives, and what watches that; the code is made when it is first needed.
        code = code or MACHINE_CODE(kernel.address)
        address, result, watch = room.parts
        code(taken, address)
        if watch[0] > PIVOT_BOUND and watch[1] > least and isfinite(watch[2]):
            return result.copy()
        return None

    return found


class ResultRoom(threading.local):
    """ResultRoom for one result, each thread its own.

    parts: its address, the result in it, and what watches it
    """

    def __init__(self, size: int, shape: tuple[int, ...]):
        y = np.empty(size)
        self.parts = y.ctypes.data, y[:-WATCHED].reshape(shape), memoryview(y)[-WATCHED:]  # pyright: ignore[reportArgumentType]
