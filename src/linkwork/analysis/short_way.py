"""The shortest way from Python through a kernel: at one state below a microsecond.

The numbers of one state go straight to the machine code (`kernels.from_python`), those of stacks in
one call. The code keeps watch over its result itself, so that nobody looks arrays through. What is
not plain, or is doubted, is left to others: None.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from linkwork.kernels import Kernel, KernelError
from linkwork.kernels.from_python import AskedOutputs, Direct, direct
from linkwork.model.checks import DOUBLE
from linkwork.model.state import State
from linkwork.robot import Robot

Quick = Callable[..., np.ndarray | None]


def short_way(
    kernel: Kernel, robot: Robot, shape: tuple[int, ...], least: float, of_state: bool
) -> Quick:
    """Return a function of states, and of vectors where the kernel takes one, that gives results as
    an array (..., *shape), or None.

    kernel: (q, rates of the state or a vector, least, p) -> result, whether it is sound
    least: determinant that is doubted
    of_state: whether the kernel takes the states' own rates, in the robot's home chart
    """
    coordinates, independent, p = robot.coordinates, robot.independent, robot.p
    tail, bound = np.array([least, *p]), np.array([least])
    nq = robot.equations.nq
    numbers = kernel.n_in - nq - tail.size
    sizes = (nq, numbers) if numbers else (nq,)
    call: Direct | None = None

    def found(state: State, given: object = None) -> np.ndarray | None:
        nonlocal call
        # What the code takes, if the state is one of the robot's own; it is made when first needed.
        try:
            q = state.q
            if state.coordinates is not coordinates:
                return None
            if of_state:
                if state.independent is not independent and state.independent != independent:
                    return None
                given = state.rates
        except AttributeError:
            return None
        # Compiled code takes it; if it does not, stacks and all else go the way of NumPy.
        call = call or direct(kernel, sizes, tail, AskedOutputs(0, shape, 0.0))
        result = call(q, given) if numbers else call(q)
        return stacked(q, given) if result is None else result

    def stacked(q: np.ndarray, given: object) -> np.ndarray | None:
        """Return the results at states (..., nq), given vectors (..., k) or both."""
        parts = [q, bound, p]
        if numbers:
            if not (isinstance(given, np.ndarray) and given.dtype == DOUBLE):
                return None
            parts.insert(1, given)
        try:
            result, sound = kernel(*parts)
        except KernelError:
            return None
        return result.reshape(*result.shape[:-1], *shape) if sound.min(initial=1.0) else None

    return found
