"""What the lanes do about events, compiled by itself: most ensembles watch for none, and their
loop, which calls it by its address, is compiled without it."""

from linkwork.simulation.compiled import compiled_once
from linkwork.simulation.lane_events import (
    STARTING,
    STEPPING,
    WHAT_HAPPENS,
    observe_starts,
    pass_occasions,
    take_occasions,
)


@compiled_once("the events of ensembles", WHAT_HAPPENS)
def happen(moment, occasions, alone, method, signals, closure_tol, found, tables, places):
    """Do what events ask for at a moment of the lanes: where members start, within steps that are
    to be accepted, or behind them. Return the rows of events."""
    if moment == STARTING:
        observe_starts(alone, signals, tables, places)
    elif moment == STEPPING:
        found = take_occasions(
            occasions, alone, method, signals, closure_tol, found, tables, places
        )
    else:
        pass_occasions(alone, signals, tables, places)
    return found


(_compiled,) = happen.overloads.values()
ADDRESS = _compiled.library.get_pointer_to_function(_compiled.fndesc.llvm_func_name)
