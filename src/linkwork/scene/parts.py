"""Parts: what is drawn of a mechanism in one pose, each with its form, its colour and the bodies
that it moves with."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from linkwork.scene.colours import LOOKS, Colour, RoleLook
from linkwork.scene.meshes import PlacedMesh

Moves = Mapping[str, tuple[np.ndarray, np.ndarray]]


@dataclass(frozen=True, eq=False)
class Bar:
    """Hold a round bar along a polyline (k, 3) [m]; between two points, it may begin hidden in
    another, and end early.

    hidden, until: parts of its length
    """

    points: np.ndarray
    radius: float
    hidden: float = 0.0
    until: float = 1.0

    @property
    def shown(self) -> np.ndarray:
        """Return the polyline (..., k, 3) as far as it is seen."""
        start, end = self.points[..., :1, :], self.points[..., -1:, :]
        if (self.hidden, self.until) == (0.0, 1.0):
            return self.points
        return start + np.array([[self.hidden], [self.until]]) * (end - start)


@dataclass(frozen=True, eq=False)
class Hull:
    """Hold a plate, or a solid, by its corners (k, 3) [m] and by the numbers of these around each
    of its faces."""

    points: np.ndarray
    around: tuple[np.ndarray, ...]

    @classmethod
    def of(cls, faces: Sequence[np.ndarray]) -> Hull:
        """Make one of its faces (., 3)."""
        points, numbers = np.unique(np.concatenate(faces), axis=0, return_inverse=True)
        return cls(
            points, tuple(np.split(numbers.ravel(), np.cumsum([len(face) for face in faces])[:-1]))
        )

    @property
    def faces(self) -> list[np.ndarray]:
        """Return the corners of each face."""
        return [self.points[numbers] for numbers in self.around]


@dataclass(frozen=True, eq=False)
class Coil:
    """Hold a coil spring between two points (2, 3) [m], and the radius of its turns."""

    points: np.ndarray
    radius: float


@dataclass(frozen=True, eq=False)
class ScenePart:
    """Hold one thing that is drawn, in the ground's axes [m].

    name: of the body, joint, spring, cable, gear or tool; role: what it is of it
    bodies: that it moves with: one, or one for each of its points
    own: its own colour, where it has one; standing: whether it stands for the joint of its name, as
    one of its parts does
    """

    name: str
    role: str
    bodies: tuple[str, ...]
    form: PlacedMesh | Bar | Hull | Coil
    own: Colour | None = None
    standing: bool = False

    @property
    def colour(self) -> Colour:
        """Return its own colour, or that of its role."""
        return self.own or self.look.colour

    @property
    def look(self) -> RoleLook:
        """Return how its role looks."""
        return LOOKS[self.role]

    def at(self, moves: Moves) -> ScenePart:
        """Return the part where its bodies have moved to (each point p to  t + R p), or a stack of
        it for a stack of moves."""
        if isinstance(self.form, PlacedMesh):
            return replace(self, form=self.form.moved(*moves[self.bodies[0]]))
        return replace(
            self, form=replace(self.form, points=moved(self.form.points, self.bodies, moves))
        )


def moved(points: np.ndarray, bodies: tuple[str, ...], moves: Moves) -> np.ndarray:
    """Return points (..., k, 3) where their bodies, or their one body, have moved to."""
    if len(bodies) == 1:
        way, turn = moves[bodies[0]]
        return way[..., None, :] + points @ np.swapaxes(turn, -1, -2)
    each = zip(points, (moves[body] for body in bodies), strict=True)
    return np.stack([way + turn @ point for point, (way, turn) in each], axis=-2)


def corners(part: ScenePart) -> np.ndarray:
    """Return the points (k, 3) of a part [m]."""
    return part.form.corners if isinstance(part.form, PlacedMesh) else part.form.points
