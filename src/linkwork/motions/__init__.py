"""Motions: joints or the tool over time, within limits, in the least time.

Motion laws in closed form (`trapezoidal`, `s_curve`, `polynomial`, `cycloidal`), coordinates that
are led by them from point to point, through points, with blended corners or along a path, and the
robot that follows.
"""

from linkwork.motions._fastest import ActuatorLimits, fastest
from linkwork.motions._flat import flat
from linkwork.motions._follow import follow
from linkwork.motions._gcode import gcode
from linkwork.motions.laws import (
    LAWS,
    AxisLimits,
    cycloidal,
    polynomial,
    s_curve,
    trapezoidal,
)
from linkwork.motions.profiles import Profile
from linkwork.motions.tables import read_csv, write_csv
from linkwork.motions.timed_paths import (
    TimedPath,
    along,
    blended,
    pick_and_place,
    point_to_point,
    through,
)

__all__ = [
    "LAWS",
    "ActuatorLimits",
    "AxisLimits",
    "Profile",
    "TimedPath",
    "along",
    "blended",
    "cycloidal",
    "fastest",
    "flat",
    "follow",
    "gcode",
    "pick_and_place",
    "point_to_point",
    "polynomial",
    "read_csv",
    "s_curve",
    "through",
    "trapezoidal",
    "write_csv",
]
