"""The catalogue: one file per robot, each a function that returns a `Mechanism`, its source cited."""

from linkwork.robots.bricard import bricard
from linkwork.robots.five_bar import five_bar
from linkwork.robots.four_bar import four_bar, n_four_bar
from linkwork.robots.prr3 import prr3

__all__ = ["bricard", "five_bar", "four_bar", "n_four_bar", "prr3"]
