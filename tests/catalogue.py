"""The robots of the catalogue, each built once for all tests of a session, those that stand for
their kinds, and two small ones."""

import os
from functools import cache

import linkwork as lw

WHOLE = os.environ.get("LINKWORK_HOSTILE") == "all"
"""Whether every case is wanted, as of `make hostile`, or a sample of them."""
KINDS = (
    "double_pendulum",  # an open chain in a plane
    "puma560",  # an open chain in space
    "five_bar",  # a planar loop
    "prr3",  # a planar platform
    "bennett",  # a loop with more rows than it needs
    "agile_wrist",  # a spherical platform
    "rrs3",  # a platform that turns freely
    "delta",  # parallelograms of rods
    "flyball_governor",  # springs and dampers
)
SAMPLE = tuple(lw.robots.__all__) if WHOLE else KINDS


@cache
def built(name: str) -> lw.Robot:
    """Return a robot of the catalogue."""
    return lw.Robot(getattr(lw.robots, name)())


def with_a_hand() -> lw.Robot:
    """Return a four-bar that carries a hand, whose hinge is in no loop."""
    bar, hand = lw.robots.four_bar(), lw.Body(mass=0.2, inertia=lw.Inertia(zz=1e-3))
    pin = lw.RevoluteJoint(connects=(next(iter(bar.bodies)), "hand"))
    return lw.Robot(
        lw.Mechanism(bodies=bar.bodies | {"hand": hand}, joints=bar.joints | {"pin": pin})
    )


def open_chain() -> lw.Robot:
    """Return an arm on a hinge."""
    own = lw.Body(mass=1.0, inertia=lw.Inertia(xx=1, yy=1, zz=1))
    pin = lw.RevoluteJoint(connects=("ground", "arm"))
    return lw.Robot(lw.Mechanism(bodies={"arm": own}, joints={"pin": pin}))
