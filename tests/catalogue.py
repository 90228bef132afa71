"""The robots of the catalogue, each built once for all tests of a session."""

from functools import cache

from linkwork import Robot, robots


@cache
def built(name: str) -> Robot:
    """Return a robot of the catalogue."""
    return Robot(getattr(robots, name)())
