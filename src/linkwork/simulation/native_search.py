"""The search for the events within a step, compiled by itself: most runs watch for none, and their
loops, which call it by its address, are compiled without it."""

from numba import types

from linkwork.simulation.compiled import address_of, compiled_once
from linkwork.simulation.native_memory import integration_at
from linkwork.simulation.native_occurrences import take_events
from linkwork.simulation.pointers import POINTER


@compiled_once("the search for events", types.void(POINTER, POINTER))
def search(memory, unused):
    """Take the events within the step of the run in some memory; called as kernels are."""
    take_events(integration_at(memory))


ADDRESS = address_of(search)
