"""The stepper of Rosenbrock methods, compiled."""

from numba import types

from linkwork.simulation.compiled import compiled_once
from linkwork.simulation.native_rosenbrock import advance
from linkwork.stepping.native_stepping import CELLS, taking

take = taking(advance)


@compiled_once("the stepper of stiff methods", (CELLS, types.intp))
def steps(cells, count):
    """Take so many steps; return OK, or why not all of them could be taken."""
    return take(cells, count)
