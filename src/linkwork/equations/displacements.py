"""Lengths between two bodies that no joint and no cable has: of a slider-crank that is not drawn,
and of one frame seen from another; and what a unit force along them does.

    slider-crank   l = a . v - s,  s = sqrt((a . v)^2 + rod^2 - v . v)
                   dl/dv = (1 - a . v / s) a + v / s,   dl/da = (1 - a . v / s) v
    displacement   l = f . R' p + m . phi(R' R_2)         p: from the base's frame to the other,
                                                          R: axes of the base's frame

The force on the slider-crank's pin is dl/dv; its body has the opposite one and the moment
a x dl/da. A displacement acts at the other frame's origin, on both bodies, with R f and R m.

Source: MuJoCo 4's transmissions of cranksite and refsite, as its MJCF reference describes them.
"""

from __future__ import annotations

from dataclasses import dataclass

import casadi as ca

from linkwork.equations.algebra import SX, cross, dot, present, vector
from linkwork.equations.cables import Places
from linkwork.equations.frames import frame_matrix
from linkwork.mechanism import Displacement, Frame, SliderCrank

TINY = 1e-30  # of squared lengths and sines that have no direction


@dataclass(frozen=True)
class MeasuredLength:
    """Hold a length, and the forces on bodies by a unit force along it: body, point in the ground's
    axes, moment about it, force."""

    length: ca.SX
    acting: tuple[tuple[str, ca.SX, ca.SX, ca.SX], ...]

    def wrenches(self, place: Places) -> list[tuple[str, ca.SX]]:
        """Return the forces as wrenches about the origins of the bodies' frames."""
        return [
            (body, ca.vertcat(moment + cross(point - place(body)[1], force), force))
            for body, point, moment, force in self.acting
        ]


def measured(line: SliderCrank | Displacement, place: Places) -> MeasuredLength:
    """Return the length of a slider-crank or displacement, and what acts along it."""
    return _crank(line, place) if isinstance(line, SliderCrank) else _displacement(line, place)


def _crank(line: SliderCrank, place: Places) -> MeasuredLength:
    R, slider = _put(line.frame, line.body, place)
    R_pin, pin = place(line.pin.body)
    pin = pin + ca.mtimes(R_pin, vector(line.pin.point))
    a, v = R[:, 2], pin - slider
    ahead = dot(a, v)
    square = ahead**2 + line.rod**2 - dot(v, v)
    reaches, s = square > 0, ca.sqrt(ca.fmax(square, TINY))
    length = ca.if_else(reaches, ahead - s, ahead)
    by_v = ca.if_else(reaches, (1 - ahead / s) * a + v / s, a)
    by_a = ca.if_else(reaches, (1 - ahead / s) * v, v)
    none = SX.zeros(3)
    return MeasuredLength(
        length, ((line.pin.body, pin, none, by_v), (line.body, slider, cross(a, by_a), -by_v))
    )


def _displacement(line: Displacement, place: Places) -> MeasuredLength:
    R, origin = _put(line.base_frame, line.base, place)
    R_2, point = _put(line.frame, line.body, place)
    force, moment = (ca.mtimes(R, vector(part)) for part in (line.force, line.moment))
    length = dot(force, point - origin)
    if any(map(present, line.moment)):
        length += dot(SX(vector(line.moment)), _turned(ca.mtimes(R.T, R_2)))
    return MeasuredLength(
        length, ((line.body, point, moment, force), (line.base, point, -moment, -force))
    )


def _turned(R: ca.SX) -> ca.SX:
    """Return the rotation vector of a matrix, of length below pi."""
    u = ca.vertcat(R[2, 1] - R[1, 2], R[0, 2] - R[2, 0], R[1, 0] - R[0, 1]) / 2
    sine = ca.sqrt(dot(u, u) + TINY)
    return ca.atan2(sine, (R[0, 0] + R[1, 1] + R[2, 2] - 1) / 2) / sine * u


def _put(frame: Frame, body: str, place: Places) -> tuple[ca.SX, ca.SX]:
    """Return R and the origin of a frame of a body."""
    R, origin = place(body)
    return ca.mtimes(R, SX(frame_matrix(frame))), origin + ca.mtimes(R, vector(frame.position))
