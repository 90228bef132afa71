"""The catalogue: one file per robot, each a function that returns a `Mechanism`, its source cited."""

from linkwork.robots.agile_wrist import agile_wrist
from linkwork.robots.andrews import andrews
from linkwork.robots.bennett import bennett
from linkwork.robots.bricard import bricard
from linkwork.robots.delta import delta
from linkwork.robots.five_bar import five_bar
from linkwork.robots.flyball_governor import flyball_governor
from linkwork.robots.four_bar import four_bar, n_four_bar
from linkwork.robots.hexaglide import hexaglide
from linkwork.robots.linear_delta import linear_delta
from linkwork.robots.orthoglide import orthoglide
from linkwork.robots.pendulum import double_pendulum, pendulum
from linkwork.robots.prr3 import prr3
from linkwork.robots.puma560 import puma560
from linkwork.robots.rpr3 import rpr3
from linkwork.robots.rrr3 import rrr3
from linkwork.robots.slider_crank import slider_crank
from linkwork.robots.spatial_slider_crank import spatial_slider_crank
from linkwork.robots.stewart import stewart
from linkwork.robots.tripteron import tripteron

__all__ = [
    "agile_wrist",
    "andrews",
    "bennett",
    "bricard",
    "delta",
    "double_pendulum",
    "five_bar",
    "flyball_governor",
    "four_bar",
    "hexaglide",
    "linear_delta",
    "n_four_bar",
    "orthoglide",
    "pendulum",
    "prr3",
    "puma560",
    "rpr3",
    "rrr3",
    "slider_crank",
    "spatial_slider_crank",
    "stewart",
    "tripteron",
]
