"""Uniform solids as bodies, and checks of what the catalogue is asked for: kinds, sizes, masses."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Mapping, Sequence
from math import isfinite, pi
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from linkwork.checks import amount, reals, shown, whole
from linkwork.mechanism import Body, Inertia, MechanismError

ALONG_X, ALONG_Y, ALONG_Z = (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)


def require_kinds(describe: Callable[..., Any], given: Mapping[str, Any]) -> None:
    """Refuse arguments of a robot's function that are of another kind than their defaults, by name:
    numbers, lists of numbers, truth values, frames."""
    for name, parameter in inspect.signature(describe).parameters.items():
        value, usual = given[name], parameter.default
        free = "..." in str(parameter.annotation) or "Sequence" in str(parameter.annotation)
        if wanted := lacking(value, usual, free):
            raise MechanismError(f"is {shown(value)}; give {wanted}", (name,))


def lacking(value: Any, usual: Any, any_length: bool) -> str:
    """Return what is asked for where a value is of another kind than the usual one, else nothing;
    any_length: whether a list may be longer or shorter."""
    if isinstance(usual, bool):
        return "" if isinstance(value, bool | np.bool_) else "True or False"
    if isinstance(usual, int):
        return "" if whole(value) else "a whole number"
    if not isinstance(usual, float | Sequence):
        return "" if isinstance(value, type(usual)) else f"a linkwork.{type(usual).__name__}"
    numbers, shape = reals(value), np.shape(usual)
    if shape[1:]:
        return ""  # points, which `six_points` looks at
    if numbers is not None and (numbers.shape == shape or (any_length and numbers.ndim > 0)):
        return ""
    if any_length:
        return "a list of numbers"
    return amount(shape[0], "number") if shape else "a number"


def require_sizes(**sizes: float) -> None:
    """Refuse sizes that are not finite and above zero, by name."""
    for name, value in sizes.items():
        if not (isfinite(value) and value > 0):
            raise MechanismError(f"is {value}; give a size above zero [m]", (name,))


def require_masses(**masses: float) -> None:
    """Refuse masses and densities that are not finite or below zero, by name."""
    for name, value in masses.items():
        if not (isfinite(value) and value >= 0):
            raise MechanismError(f"is {value}; give zero or more", (name,))


def rod(mass: float, length: float, radius: float, start: float, axis: ArrayLike) -> Body:
    """Return a round rod that lies along a coordinate axis from `start` times it to
    (`start` + `length`) times it.

    About the mass centre: m r^2 / 2 along the axis, m (3 r^2 + l^2) / 12 across it.
    """
    return tube(mass, length, (0.0, radius), start, axis)


def tube(
    mass: float, length: float, radii: tuple[float, float], start: float, axis: ArrayLike
) -> Body:
    """Return a round tube along a coordinate axis from `start` on: as a rod, with r^2 the sum of
    the radii's squares."""
    direction = np.asarray(axis, float)
    square = radii[0] ** 2 + radii[1] ** 2
    along, across = mass * square / 2, mass * (3 * square + length**2) / 12
    xx, yy, zz = across + (along - across) * np.abs(direction)
    centre = (start + length / 2) * direction
    return Body(mass=mass, centre_of_mass=vector(centre), inertia=Inertia(xx=xx, yy=yy, zz=zz))


def tube_mass(density: float, length: float, radii: tuple[float, float]) -> float:
    """Return density pi (outer^2 - inner^2) length [kg]."""
    return density * pi * (radii[1] ** 2 - radii[0] ** 2) * length


def disc(mass: float, radius: float, thickness: float) -> Body:
    """Return a round disc about z with its mass centre in the origin: m r^2 / 2 about z."""
    return rod(mass, thickness, radius, -thickness / 2, ALONG_Z)


def cube(mass: float, side: float) -> Body:
    """Return a cube with its mass centre in the origin: m a^2 / 6 about every axis."""
    inertia = mass * side**2 / 6
    return Body(mass=mass, inertia=Inertia(xx=inertia, yy=inertia, zz=inertia))


def vector(values: np.ndarray | Sequence[float]) -> tuple[float, float, float]:
    """Return three plain floats; what is zero but for rounding is zero."""
    size = max(abs(float(value)) for value in values)
    x, y, z = (0.0 if abs(value) <= 1e-15 * size else float(value) for value in values)
    return x, y, z
