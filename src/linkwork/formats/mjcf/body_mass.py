"""The mass of an MJCF body: of its <inertial> or its geoms, within the compiler's bounds."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TypeAlias

import numpy as np

from linkwork.formats.mjcf.document import Compiler, Document
from linkwork.formats.mjcf.geoms import SIZES, is_heavy, kind_of, measured, weighed
from linkwork.formats.mjcf.meshes import Meshes
from linkwork.formats.mjcf.principal import principal_axes
from linkwork.formats.notes import Notes
from linkwork.formats.xml import Element
from linkwork.solids.solid import Solid, together

Geoms: TypeAlias = tuple[tuple[Element, np.ndarray], ...]
"""Geoms with their defaults, and the poses of the frames around them in the body."""
LEAST = 1e-14  # mass of a geom that counts [kg]
SLIVER = 1e-9  # part of a moment that rounding lets exceed the sum of the others
ONLY_MESHES = (
    "has no mass here: all of it is that of meshes, which are not weighed; give it an <inertial>"
)


@dataclass(frozen=True)
class BodyMass:
    """Weigh a body of an <inertial>, if it has one, and of some geoms."""

    document: Document
    element: Element
    inertial: Element | None
    geoms: Geoms
    meshes: Meshes
    notes: Notes

    @property
    def compiler(self) -> Compiler:
        return self.document.compiler_of(self.element)

    @property
    def counting(self) -> Element | None:
        """Return the <inertial> that counts: where geoms shall give the inertia, it does if none
        has any mass."""
        from_geoms = self.compiler.from_geoms == "true"
        heavy = from_geoms and any(is_heavy(self.document, geom) for geom, _ in self.geoms)
        return None if heavy else self.inertial

    @property
    def weighing(self) -> Geoms:
        """Return the geoms that count where no <inertial> does."""
        return () if self.compiler.from_geoms == "false" else self.geoms

    def bounded(self) -> tuple[Solid, np.ndarray | None]:
        """Return a solid whose mass and moments are no less than the compiler's bounds, and those
        of some rigid body where it balances them; and the axes of its inertia that the file
        gives, if it does."""
        solid, compiler = self.plain(), self.compiler
        if solid.mass < 0 and compiler.least_mass <= 0:
            raise self.element.refusal(f"mass {solid.mass:g} is below 0; give zero or more")
        moments, axes = np.linalg.eigh(solid.inertia)
        if moments[0] < -SLIVER * moments[-1] and compiler.least_inertia <= 0:
            raise self.element.refusal(f"has a moment of inertia {moments[0]:g} below 0")
        least = np.maximum(moments, compiler.least_inertia)
        a, b, c = sorted(least)
        if a + b < c * (1 - SLIVER) and compiler.balance:
            least = np.full(3, least.mean())
            self.notes.on(
                self.element,
                "has moments of inertia that no rigid body has; balanceinertia took their mean",
            )
        # What is raised keeps the axes that it had.
        given, tensor = self.axes(), solid.inertia
        if (least != moments).any():
            given = principal_axes(tensor) if given is None else given
            tensor = axes @ np.diag(least) @ axes.T
        return Solid(max(solid.mass, compiler.least_mass), solid.centre, tensor), given

    def plain(self) -> Solid:
        """Return the mass from <inertial> or from the geoms; where none has any, MuJoCo puts what
        boundmass gives as far from the body's origin as that stands from its parent's, and so does
        this."""
        if self.counting is not None:
            return self.of_inertial(self.counting)
        solids = [
            solid
            for geom, X in self.weighing
            for solid in weighed(self.document, geom, X, self.meshes, self.notes)
            if solid.mass > LEAST
        ]
        if solids:
            return solids[0] if len(solids) == 1 else together(solids)
        if any(is_heavy(self.document, geom) for geom, _ in self.weighing):
            self.notes.on(self.element, ONLY_MESHES, alters=True)
        away = np.array(self.element.vector("pos", (0.0, 0.0, 0.0)))
        return Solid(0.0, away, np.zeros((3, 3)))

    def axes(self) -> np.ndarray | None:
        """Return the axes that the file gives to the inertia: those of <inertial>, or of the one
        geom that has mass; MuJoCo turns what boundinertia gives as the body in its parent."""
        document = self.document
        if self.counting is not None:
            given = "fullinertia" not in self.counting.attributes
            return document.rotation(self.counting) if given else None
        heavy = [(geom, X) for geom, X in self.weighing if is_heavy(document, geom)]
        if len(heavy) != 1:
            return None if heavy else document.rotation(self.element)
        ((geom, X),) = heavy
        if "mesh" not in geom.attributes and kind_of(geom) in SIZES:
            return (X @ measured(document, geom)[1])[:3, :3]
        axes = self.meshes.axes(geom)
        return None if axes is None else X[:3, :3] @ axes

    def of_inertial(self, element: Element) -> Solid:
        X = self.document.pose(element)
        if "fullinertia" in element.attributes:
            xx, yy, zz, xy, xz, yz = element.numbers("fullinertia", (6,))
            tensor = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
        else:
            tensor = np.diag(element.vector("diaginertia", (0.0, 0.0, 0.0)))
        return Solid(element.number("mass"), np.zeros(3), tensor).seen(X)
