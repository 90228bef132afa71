"""The stepper of explicit methods, compiled: embedded pairs, and methods of a fixed step."""

from linkwork.simulation.compiled import compiled_once
from linkwork.simulation.native import advance
from linkwork.stepping.native_stepping import SHAPE, taking

take = taking(advance)


@compiled_once("the stepper", SHAPE)
def steps(forces, cells):
    """Take as many steps as the cells tell under forces; return OK, or why not all of them could be
    taken."""
    return take(forces, cells)
