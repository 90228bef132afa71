"""The catalogue: one file per robot, each a function that returns a `Mechanism`, its source cited."""

from linkwork.robots.prr3 import prr3

__all__ = ["prr3"]
