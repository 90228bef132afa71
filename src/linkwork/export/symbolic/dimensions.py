"""The numbers of a mechanism as they are printed: exact ones, or symbols.

Free parameters are symbols. Where all are to be symbols, lengths, masses, moments of inertia,
pitches and gravity are: equal ones of bodies that are alike (of equal mass, inertia and distances
between joints and mass centre) share one, and a length that is twice or half another of the same
kind of body is written by it.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from fractions import Fraction
from functools import cached_property
from typing import NamedTuple

import numpy as np

from linkwork.equations.algebra import rotation_matrix
from linkwork.export.symbolic.exact import exact, exact_matrix, exact_vector
from linkwork.export.symbolic.trig import (
    ZERO,
    Matrix,
    Trig,
    Vector,
    applied,
    plus,
    symbol,
    times,
)
from linkwork.mechanism import GROUND, Mechanism
from linkwork.mechanism.numbers import located

SAME = 1e-12  # relative difference of numbers that are one
MULTIPLES = (Fraction(1), Fraction(1, 2), Fraction(2))
AXES = "xyz"


class BodyPoint(NamedTuple):
    """Name a point of a body: the frame of a joint on its first (0) or second (1) body, or the mass
    centre."""

    joint: str | None = None
    side: int = 0


MASS_CENTRE = BodyPoint()
Where = tuple[str, ...]


@dataclass
class Dimensions:
    """Read numbers of a mechanism, and remember which symbols were made.

    free: values of the free numbers, by path; every: whether all numbers become symbols
    found: values of the symbols that were made, by key (kind, number), in their order
    """

    mechanism: Mechanism
    free: Mapping[str, float]
    every: bool
    found: dict[str, float] = field(default_factory=dict)
    classes: dict[str, str] = field(default_factory=dict)

    @cached_property
    def paths(self) -> dict[Where, str]:
        """Where each free number stands in the description."""
        return {located(self.mechanism, path)[0]: path for path in self.free}

    @cached_property
    def kinds(self) -> dict[str, int]:
        """The number of each body's kind: bodies that are alike have one; ground's is the last."""
        seen: dict[object, int] = {}
        found = {}
        for name, body in self.mechanism.bodies.items():
            points = [np.array(self.position(place, name)) for place in self.joints_of(name)]
            centre = np.array(body.centre_of_mass)
            reach = sorted(float(f"{np.linalg.norm(point - centre):.11g}") for point in points)
            alike = (body.mass, body.inertia, tuple(reach))
            found[name] = seen.setdefault(repr(alike), len(seen))
        return found | {GROUND: len(seen)}

    def joints_of(self, body: str) -> list[BodyPoint]:
        """Return the places of the joints' frames on a body."""
        return [
            BodyPoint(name, side)
            for name, joint in self.mechanism.pairs.items()
            for side in (0, 1)
            if joint.connects[side] == body
        ]

    def at(self, where: Where, value: float, kind: str, owner: str = "") -> Trig:
        """Return a number of the description: its symbol where it is free, or all are."""
        if self.every and value and where not in self.paths:
            return self.named(kind, value, owner)
        return self.number(where, value)

    def number(self, where: Where, value: float) -> Trig:
        """Return a number of the description that is written out unless it is free."""
        path = self.paths.get(where)
        return exact(value) if path is None else self.of_path(path)

    def of_path(self, path: str) -> Trig:
        key = f"free:{path}"
        self.found.setdefault(key, self.free[path])
        return symbol(key)

    def named(self, kind: str, value: float, owner: str) -> Trig:
        """Return the symbol of a number, or its multiple, of equal ones with one owner's kind."""
        for key, known in self.found.items():
            own = key.split(":")[:2] == [kind, owner]
            for factor in MULTIPLES[: 3 if kind == "length" else 1]:
                if own and abs(abs(value) - float(factor) * known) <= SAME * abs(value):
                    return symbol(key) * (factor if value > 0 else -factor)
        key = f"{kind}:{owner}:{len(self.found)}"
        self.found[key] = abs(value)
        return symbol(key) * (1 if value > 0 else -1)

    # Geometry

    def position(self, place: BodyPoint, body: str) -> tuple[float, float, float]:
        """Return a place in a body's frame [m]."""
        if place.joint is None:
            return self.mechanism.bodies[body].centre_of_mass
        return self.mechanism.pairs[place.joint].frames[place.side].position

    def field_of(self, place: BodyPoint, body: str) -> Where:
        """Return where the description has a place."""
        if place.joint is None:
            return ("bodies", body, "centre_of_mass")
        return ("joints", place.joint, "frames", str(place.side), "position")

    def axes(self, place: BodyPoint) -> np.ndarray:
        """Return R_BF of a joint's frame; the body's own axes at its mass centre."""
        if place.joint is None:
            return np.eye(3)
        return rotation_matrix(self.mechanism.pairs[place.joint].frames[place.side].orientation)

    def between(
        self, body: str, start: BodyPoint | None, end: BodyPoint, turned: np.ndarray, flat: bool
    ) -> Vector:
        """Return the vector from a place of a body to another in axes that are turned to the
        body's by `turned`.

        start: None for the origin of the body's frame; flat: leave out what is along the ground's z
        """
        ends = [(end, 1)] + ([] if start is None else [(start, -1)])
        if any((*self.field_of(e, body), str(k)) in self.paths for e, _ in ends for k in range(3)):
            found: Vector = (ZERO, ZERO, ZERO)
            for place, sign in ends:
                parts = [ZERO, ZERO, ZERO]
                for k, value in enumerate(self.position(place, body)):
                    where = (*self.field_of(place, body), str(k))
                    parts[k] = self.number(where, value) * sign
                found = plus(found, (parts[0], parts[1], parts[2]))
            x, y, z = applied(exact_matrix(turned), found)
            return (x, y, ZERO if flat else z)
        d = turned @ self.difference(body, ends)
        return self.length_along(np.array([d[0], d[1], 0.0]) if flat else d, str(self.kinds[body]))

    def difference(self, body: str, ends: list[tuple[BodyPoint, int]]) -> np.ndarray:
        """Return the difference of places without what rounding leaves of it."""
        points = np.array([np.multiply(self.position(e, body), sign) for e, sign in ends])
        d, scale = points.sum(axis=0), np.abs(points).max(initial=0.0)
        d[np.abs(d) <= 1e-14 * scale] = 0.0
        for k, column in enumerate(points.T):  # decimals, as they are written
            d[k] = float(sum(Fraction(repr(float(x))) for x in column)) if d[k] else 0.0
        return d

    def length_along(self, d: np.ndarray, kind: str) -> Vector:
        """Return a vector as its length's symbol times its direction, where that is known exactly,
        else by components; as numbers where none are to be symbols."""
        length = float(np.linalg.norm(d))
        if not self.every or not length:
            return exact_vector(d)
        direction = exact_vector(d / length)
        if all(known(x, float(v)) for x, v in zip(direction, d / length, strict=True)):
            return times(direction, self.named("length", length, kind))
        small = VANISHES * length
        parts = [self.named("length", float(x), kind) if abs(x) > small else ZERO for x in d]
        return (parts[0], parts[1], parts[2])

    # Pitches, rods, masses, gravity

    def pitch(self, joint: str) -> Trig:
        """Return the pitch of a screw [m/rad]."""
        value = getattr(self.mechanism.pairs[joint], "pitch", 0.0)
        return self.at(("joints", joint, "pitch"), value, "pitch")

    def mass(self, body: str) -> Trig:
        value = self.mechanism.bodies[body].mass
        return self.at(("bodies", body, "mass"), value, "mass", str(self.kinds[body]))

    def inertia(self, body: str) -> Matrix:
        """Return the inertia about the mass centre in the body's axes."""
        held = self.mechanism.bodies[body].inertia

        def element(i: int, j: int) -> Trig:
            name = AXES[min(i, j)] + AXES[max(i, j)]
            value = getattr(held, name) or 0.0
            kind = "inertia" if name == "zz" and held.planar else f"inertia_{name}"
            return self.at(("bodies", body, "inertia", name), value, kind, str(self.kinds[body]))

        rows = [tuple(element(i, j) for j in range(3)) for i in range(3)]
        return (rows[0], rows[1], rows[2])  # pyright: ignore[reportReturnType]

    def rod(self, joint: str) -> Trig:
        """Return the length of a rod [m]."""
        value = getattr(self.mechanism.pairs[joint], "length", 0.0)
        return self.at(("joints", joint, "length"), value, "length", joint)

    @cached_property
    def gravity(self) -> Vector:
        """The acceleration of gravity in the ground's axes."""
        values = np.array(self.mechanism.gravity)
        where = [("gravity", str(k)) for k in range(3)]
        size = float(np.linalg.norm(values))
        if self.every and size and not any(each in self.paths for each in where):
            return times(exact_vector(values / size), self.named("gravity", size, ""))
        parts = [self.at(where[k], float(values[k]), "gravity", str(k)) for k in range(3)]
        return (parts[0], parts[1], parts[2])


VANISHES = 1e-14


def known(number: Trig, value: float) -> bool:
    """Tell whether a component of a direction is zero or a rational times roots, not a decimal."""
    plain = number.number
    return plain is None or plain.denominator <= 24 or abs(value) <= VANISHES
