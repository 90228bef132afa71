"""The stepper of Rosenbrock methods, compiled."""

from linkwork.simulation.compiled import compiled_once
from linkwork.simulation.native_rosenbrock import advance
from linkwork.stepping.native_stepping import SHAPE, taking

take = taking(advance)


@compiled_once("the stepper of stiff methods", SHAPE)
def steps(forces, cells):
    """Take as many steps as the cells tell under forces; return OK, or why not all of them could be
    taken."""
    return take(forces, cells)
