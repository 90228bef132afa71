"""The catalogue: one file per robot, each a function that returns a `Mechanism`, its source
cited."""

from linkwork.robots._agile_wrist import agile_wrist
from linkwork.robots._andrews import andrews
from linkwork.robots._bennett import bennett
from linkwork.robots._bricard import bricard
from linkwork.robots._delta import delta
from linkwork.robots._five_bar import five_bar
from linkwork.robots._flyball_governor import flyball_governor
from linkwork.robots._four_bar import four_bar, n_four_bar
from linkwork.robots._hexaglide import hexaglide
from linkwork.robots._linear_delta import linear_delta
from linkwork.robots._orthoglide import orthoglide
from linkwork.robots._par4 import par4
from linkwork.robots._pendulum import double_pendulum, pendulum
from linkwork.robots._prr3 import prr3
from linkwork.robots._puma560 import puma560
from linkwork.robots._rpr3 import rpr3
from linkwork.robots._rrr3 import rrr3
from linkwork.robots._rrs3 import rrs3
from linkwork.robots._slider_crank import slider_crank
from linkwork.robots._spatial_slider_crank import spatial_slider_crank
from linkwork.robots._stewart import stewart
from linkwork.robots._tripteron import tripteron

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
    "par4",
    "pendulum",
    "prr3",
    "puma560",
    "rpr3",
    "rrr3",
    "rrs3",
    "slider_crank",
    "spatial_slider_crank",
    "stewart",
    "tripteron",
]
