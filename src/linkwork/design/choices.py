"""Choices: the numbers of a description that a design may change, alone or in proportion."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import casadi as ca
import numpy as np

from linkwork import checks
from linkwork.analysis.freed_numbers import freed
from linkwork.errors import LinkworkError
from linkwork.mechanism.number_patterns import paths_of
from linkwork.mechanism.numbers import edited, located
from linkwork.mechanism.parameter_units import unit_of_parameter
from linkwork.robot import Robot

SIZES = ("m", "kg")  # units of numbers that a factor leaves above 0


@dataclass(frozen=True, eq=False)
class Choices:
    """Hold what is chosen: of each choice a name, the paths of its numbers and its bounds, which
    are those of the number itself, or of the factor by which several are multiplied.

    robot: with all these numbers free; offset, map: p = offset + map z for the choices' values z;
        start: z of the robot
    """

    robot: Robot
    names: tuple[str, ...]
    lower: np.ndarray
    upper: np.ndarray
    start: np.ndarray
    offset: np.ndarray
    map: np.ndarray

    @property
    def width(self) -> np.ndarray:
        return self.upper - self.lower

    def at(self, parts: np.ndarray) -> np.ndarray:
        """Return z at parts of the way from its lower to its upper bounds."""
        return self.lower + self.width * parts

    def parameters(self, part: ca.MX) -> ca.MX:
        """Return p for choices given as parts of the way from their lower to their upper bounds."""
        z = ca.DM(self.lower) + ca.DM(self.width) * part
        return ca.DM(self.offset) + ca.DM(self.map) @ z

    def values(self, z: np.ndarray) -> dict[str, float]:
        """Return the numbers of the description by path."""
        chosen = np.flatnonzero(self.map.any(axis=1))
        p, paths = self.offset + self.map @ z, tuple(self.robot.parameters)
        return {paths[k]: float(p[k]) for k in chosen}


def choices(robot: Robot, numbers: Mapping[Any, tuple[float, float]]) -> Choices:
    """Return what `optimise` is given as numbers, and the robot with all of them free."""
    if not isinstance(numbers, Mapping) or not numbers:
        raise LinkworkError(
            f"the numbers are {checks.shown(numbers)}; give bounds by path, such as "
            "{'platform.mass': (0.5, 2.0)}"
        )
    # Groups of places in the description, each of which is named once.
    if () in numbers:
        raise LinkworkError("() names no number; give a path, a pattern, or a tuple of them")
    groups = [(name_of(key), all_paths(robot, key)) for key in numbers]
    taken: dict[tuple[str, ...], str] = {}
    for name, paths in groups:
        for where, path in ((located(robot.mechanism, path)[0], path) for path in paths):
            if where in taken:
                raise LinkworkError(f"{path!r} is in {taken[where]!r} and {name!r}; name it once")
            taken[where] = name
    opened, _ = freed(robot, (path for _, paths in groups for path in paths))
    # p = offset + map z.
    places = [located(robot.mechanism, path)[0] for path in opened.parameters]
    lower, upper, start = [], [], []
    found = np.zeros((opened.p.size, len(groups)))
    # A number by itself, or several that keep their ratios.
    for k, (key, (name, paths)) in enumerate(zip(numbers, groups, strict=True)):
        rows = [places.index(located(robot.mechanism, path)[0]) for path in paths]
        alone = len(rows) == 1
        found[rows, k] = 1.0 if alone else opened.p[rows]
        own = float(opened.p[rows[0]]) if alone else 1.0
        low, high = bounds_of(name, numbers[key], own, alone)
        if low <= 0:
            least = dict(zip(paths, (low * found[rows, k]).tolist(), strict=True))
            refuse_sign(robot, name, low, least)
        lower, upper, start = [*lower, low], [*upper, high], [*start, own]
    # What is not chosen stays as it is.
    offset = np.where(found.any(axis=1), 0.0, opened.p)
    names = tuple(name for name, _ in groups)
    still = [name for name, column in zip(names, found.T, strict=True) if not column.any()]
    if still:
        raise LinkworkError(f"all numbers of {still[0]!r} are zero, and stay so; give others")
    ends = np.array(lower), np.array(upper)
    return Choices(opened, names, *ends, np.array(start), offset, found)


def name_of(key: Any) -> str:
    """Return what a choice is called."""
    return ", ".join(map(str, key)) if isinstance(key, tuple) else str(key)


def all_paths(robot: Robot, key: Any) -> list[str]:
    """Return the paths that a path, a pattern, or several of them stand for."""
    parts = key if isinstance(key, tuple) else (key,)
    return [path for part in parts for path in paths_of(robot.mechanism, part)]


def bounds_of(name: str, given: Any, own: float, alone: bool) -> tuple[float, float]:
    """Return the bounds of a choice, between which its own value lies."""
    ends = checks.finite(given, f"the bounds of {name!r}")
    if ends.shape != (2,) or not ends[0] < ends[1]:
        raise LinkworkError(
            f"the bounds of {name!r} are {checks.shown(given)}; give a lower and a larger upper one"
        )
    if not ends[0] <= own <= ends[1]:
        what = f"its value {own:g}" if alone else "the factor 1 of the robot as it is"
        raise LinkworkError(
            f"the bounds {ends[0]:g} and {ends[1]:g} of {name!r} leave out {what}; give bounds "
            "around it" + ("" if alone else ", for several numbers are changed by one factor")
        )
    return float(ends[0]), float(ends[1])


def refuse_sign(robot: Robot, name: str, low: float, least: Mapping[str, float]) -> None:
    """Refuse a lower bound that is not above 0 where numbers (by path, at that bound) have to be:
    sizes that are changed by one factor, and what a description takes above 0 alone."""
    with checks.at(f"the lower bound {low:g} of {name!r}: "):
        for path in least if len(least) > 1 else ():
            sized = unit_of_parameter(robot.mechanism, path) in SIZES
            if sized and "centre_of_mass" not in located(robot.mechanism, path)[0]:
                raise LinkworkError(
                    f"{path!r} is a length or a mass, which no factor makes zero or turns round; "
                    "give a factor above 0"
                )
        edited(robot.mechanism, least)
