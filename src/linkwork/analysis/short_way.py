"""The shortest way from Python through a kernel: at one state below a microsecond.

The numbers of one state go to the machine code as bytes, for an array tells its address slowly;
those of stacks go in one call. The code keeps watch over its result itself, and Python reads one
number of each state instead of looking arrays through. What is not plain, or is doubted, is left to
others: None.
"""

from __future__ import annotations

import ctypes
import threading
from collections.abc import Callable

import numpy as np

from linkwork.kernels import Kernel, KernelError
from linkwork.model.checks import DOUBLE
from linkwork.model.state import State
from linkwork.robot import Robot

Quick = Callable[..., np.ndarray | None]
MACHINE_CODE = ctypes.PYFUNCTYPE(None, ctypes.c_void_p, ctypes.c_void_p)


def short_way(
    kernel: Kernel, robot: Robot, shape: tuple[int, ...], least: float, of_state: bool
) -> Quick:
    """Return a function of states, and of vectors where the kernel takes one, that gives results as
    an array (..., *shape), or None.

    kernel: (q, rates of the state or a vector, least, p) -> result, whether it is sound
    least: determinant that is doubted
    of_state: whether the kernel takes the states' own rates, in the robot's home chart
    """
    room, code = ResultRoom(kernel.n_out, shape), None
    join: Callable[..., bytes] = b"".join
    coordinates, independent, p = robot.coordinates, robot.independent, robot.p
    tail, bound = np.array([least, *p]).tobytes(), np.array([least])
    length = 8 * kernel.n_in
    numbers = kernel.n_in - robot.equations.nq - len(p) - 1

    def found(state: State, given: np.ndarray | None = None) -> np.ndarray | None:
        nonlocal code
        # What the code takes, as bytes; states and vectors that are not plain go another way.
        try:
            q = state.q
            if state.coordinates is not coordinates:
                return None
            if of_state:
                if state.independent is not independent and state.independent != independent:
                    return None
                given = state.rates
            if q.ndim != 1:
                return stacked(q, given)
            if not numbers:
                taken = join((q, tail))
            elif isinstance(given, np.ndarray) and given.dtype is DOUBLE and given.ndim == 1:
                taken = join((q, given, tail))
            else:
                return stacked(q, given)
        except (AttributeError, TypeError, BufferError):
            return None
        if len(taken) != length:
            return None
        # What it gives, and what watches that; the code is made when it is first needed.
        code = code or MACHINE_CODE(kernel.address)
        address, result, sound = room.parts
        code(taken, address)
        return result.copy() if sound[0] else None

    def stacked(q: np.ndarray, given: np.ndarray | None) -> np.ndarray | None:
        """Return the results at states (..., nq), given vectors (..., k) or both."""
        if numbers and not (isinstance(given, np.ndarray) and given.dtype == DOUBLE):
            return None
        try:
            result, sound = kernel(q, *((given,) if numbers else ()), bound, p)  # pyright: ignore[reportArgumentType]
        except KernelError:
            return None
        return result.reshape(*result.shape[:-1], *shape) if sound.min(initial=1.0) else None

    return found


class ResultRoom(threading.local):
    """Room for one result, each thread its own.

    parts: its address, the result in it, and what watches it
    """

    def __init__(self, size: int, shape: tuple[int, ...]):
        y = np.empty(size)
        self.parts = y.ctypes.data, y[:-1].reshape(shape), memoryview(y)[-1:]  # pyright: ignore[reportArgumentType]
