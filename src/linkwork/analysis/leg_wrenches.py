"""Legs between base and platform, and the wrenches that they transmit and hold.

    twists    t = [omega; v]    v of the body's point at the ground's origin
    wrenches  w = [m; f]        m about the ground's origin; power w . t

A leg is what of a mechanism stays together without base and platform. V are the platform's twists
that its joints allow, V_0 those with its actuator locked; the wrenches V_0^ (those with no power on
V_0) are what the leg can exert, V^ those that it holds anyway. Its transmission wrench T is the one
that V_0^ has beside V^, taken perpendicular to V^ at the place where the leg meets the platform, or
else at the tool. It is unique where that does not depend on the length by which forces are compared
with moments, as where V^ consists of forces through this place and of couples.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import networkx as nx
import numpy as np

from linkwork.equations.algebra import cross_product, rotation_matrix, skew
from linkwork.equations.joints import Row, motions_of, rows_of
from linkwork.errors import LinkworkError
from linkwork.mechanism.joints import PairJoint
from linkwork.robot import Robot

RANK = 1e-9  # singular value, over the largest, of dependent rows
ALIKE = 1e-6  # sine between two wrenches that are one
AT_POINT = 1e-9  # distance, over the own length, of a tool that sits on a joint's axis
PIN = "(pin)"
Poses = dict[str, tuple[np.ndarray, np.ndarray]]


@dataclass(frozen=True, eq=False)
class Link:
    """Hold a joint at a configuration, or at a stack of them: bodies, what it holds (..., k, 6),
    the places (..., 2, 3) of its two frames, the direction (..., 3) of an axis that it turns
    about, zero without one.

    twist: (..., 6) of the second body for a unit rate, where the joint is driven
    """

    name: str
    bodies: tuple[str, str]
    held: np.ndarray
    places: np.ndarray
    axis: np.ndarray
    twist: np.ndarray | None = None

    def at(self, k: int) -> Link:
        """Return it at one of its configurations."""
        twist = None if self.twist is None else self.twist[k]
        return Link(self.name, self.bodies, self.held[k], self.places[k], self.axis[k], twist)

    def place(self, body: str) -> np.ndarray:
        """Return where it is on one of its bodies, at one configuration."""
        return self.places[self.bodies.index(body)]


@dataclass(frozen=True, eq=False)
class PlatformLeg:
    """Hold the links of a leg at a configuration, or at a stack of them."""

    links: tuple[Link, ...]

    def at(self, k: int) -> PlatformLeg:
        """Return it at one of its configurations."""
        return PlatformLeg(tuple(link.at(k) for link in self.links))

    @property
    def drives(self) -> list[Link]:
        """The driven links."""
        return [link for link in self.links if link.twist is not None]

    @property
    def driven(self) -> Link | None:
        """The first of them, if there is one."""
        return next(iter(self.drives), None)

    @property
    def bodies(self) -> list[str]:
        return sorted({name for link in self.links for name in link.bodies})

    def attached(self, body: str) -> list[Link]:
        """Return the links at a body but for the driven one."""
        return [link for link in self.links if body in link.bodies and link is not self.driven]

    def held(self, base: str, platform: str, length: float, locked: bool) -> np.ndarray:
        """Return orthonormal wrenches (6, k) that have no power on the twists of the platform that
        the leg allows, moments over a length."""
        moving = [name for name in self.bodies if name != base]
        place = {name: slice(6 * k, 6 * k + 6) for k, name in enumerate(moving)}
        rows = []
        for link in self.links:
            held = np.eye(6) if locked and link is self.driven else link.held / widths(length)
            row = np.zeros((len(held), 6 * len(moving)))
            for body, sign in zip(link.bodies, (-1, 1), strict=True):
                if body != base:
                    row[:, place[body]] = sign * held
            rows.append(row)
        U, sigma, _ = np.linalg.svd(null_space(np.vstack(rows))[place[platform]])
        return U[:, int(np.sum(sigma > RANK)) :]


def widths(length: float) -> np.ndarray:
    """Return what twists [omega; v] are multiplied, and wrenches [m; f] divided by, to be alike in
    unit."""
    return np.repeat([length, 1.0], 3)


def null_space(A: np.ndarray) -> np.ndarray:
    """Return an orthonormal basis (columns) of the null space of rows of about unit size."""
    _, sigma, V = np.linalg.svd(A)
    return V[int(np.sum(sigma > RANK * max(1.0, sigma.max(initial=0.0)))) :].T


def span(A: np.ndarray) -> np.ndarray:
    """Return an orthonormal basis of the columns of a matrix."""
    U, sigma, _ = np.linalg.svd(A, full_matrices=False)
    return U[:, sigma > RANK]


def moved(wrenches: np.ndarray, place: np.ndarray) -> np.ndarray:
    """Return wrenches (6, k) with moments about another place."""
    found = np.array(wrenches)
    found[:3] -= skew(place) @ wrenches[3:]
    return found


def transmitted(
    leg: PlatformLeg, base: str, platform: str, length: float
) -> tuple[np.ndarray, np.ndarray]:
    """Return T (6), nan where the actuator does not move the platform, and what the leg holds
    anyway (6, k), moments about the origin.

    Raises:
        LinkworkError: a transmission wrench that is not unique.
    """
    width = widths(length)[:, None]
    free = leg.held(base, platform, length, locked=False) * width
    if leg.driven is None:
        return np.full(6, np.nan), free
    exerted = leg.held(base, platform, length, locked=True) * width
    if exerted.shape[1] == free.shape[1]:
        return np.full(6, np.nan), free
    for place in (meeting(leg, platform), np.zeros(3)):
        one, other = (beside(exerted, free, place, scale) for scale in (length, 3 * length))
        sizes = (np.linalg.norm(w / width[:, 0]) for w in (one, other))
        if same_line(
            *(w / width[:, 0] / size for w, size in zip((one, other), sizes, strict=True))
        ):
            return one, free
    raise LinkworkError(
        f"the leg of {leg.driven.name!r} has no unique transmission wrench: beside it the leg "
        f"holds what is neither a force through the place where it meets {platform!r} nor a couple"
    )


def beside(exerted: np.ndarray, free: np.ndarray, place: np.ndarray, length: float) -> np.ndarray:
    """Return the wrench (6) of the first space that is perpendicular to the second at a place,
    moments over a length."""
    width = widths(length)[:, None]
    held, every = (moved(part, place) / width for part in (free, exerted))
    Q = span(held / np.maximum(np.linalg.norm(held, axis=0), 1e-300))
    U, *_ = np.linalg.svd(every - Q @ (Q.T @ every), full_matrices=False)
    return moved(U[:, :1] * width, -place)[:, 0]


def same_line(one: np.ndarray, other: np.ndarray) -> bool:
    """Tell whether two vectors of length 1 are one but for their sign."""
    return bool(np.linalg.norm(other - one * (one @ other)) < ALIKE)


def meeting(leg: PlatformLeg, platform: str) -> np.ndarray:
    """Return the place where a leg meets the platform: the mean of its joints there."""
    places = [link.place(platform) for link in leg.links if platform in link.bodies]
    return np.mean(places, axis=0)


def on_line(wrench: np.ndarray, links: Sequence[Link], body: str) -> np.ndarray:
    """Return the point of a wrench's axis that is nearest to links at a body: to the axis that a
    single one turns about, or to the mean of their places; the latter of a pure couple."""
    near = np.mean([link.place(body) for link in links], axis=0)
    m, f = wrench[:3], wrench[3:]
    if not f.any():
        return near
    along = f / np.linalg.norm(f)
    start = cross_product(f, m) / (f @ f)
    axis = links[0].axis if len(links) == 1 else np.zeros(3)
    across = cross_product(along, axis)
    if across @ across > ALIKE:
        normal = cross_product(axis, across)
        return start + along * ((near - start) @ normal) / (along @ normal)
    return start + along * (along @ (near - start))


@dataclass(frozen=True, eq=False)
class LinkForm:
    """Hold what of a joint does not change: its bodies, its frames on them as places (3) and
    matrices (3, 3), its rows, the one direction (3) that it turns about in its first frame, zero
    without one, and that along which it slides (3), where it is driven."""

    name: str
    bodies: tuple[str, str]
    frames: tuple[tuple[np.ndarray, np.ndarray], ...]
    rows: tuple[Row, ...]
    turn: np.ndarray
    slide: np.ndarray | None


def forms_of(robot: Robot) -> tuple[LinkForm, ...]:
    """Return the joints of a robot, whose bodies move anyhow; refuse gears."""
    found = []
    for name, joint in robot.mechanism.joints.items():
        if not isinstance(joint, PairJoint):
            raise LinkworkError(
                f"the gear {name!r} couples joints, so that legs do not stand for themselves; "
                "transmission indices are those of legs that the platform alone connects"
            )
        frames = [
            (np.array(frame.position, float), rotation_matrix(frame.orientation))
            for frame in joint.frames
        ]
        motions = motions_of(joint)
        turns = [motion.turn for motion in motions if motion.turns and not motion.ball]
        turn = np.array(turns[0], float) if len(turns) == 1 else np.zeros(3)
        slide = np.array(motions[0].slide, float) if name in robot.actuators else None
        found.append(
            LinkForm(name, joint.connects, tuple(frames), tuple(rows_of(joint)), turn, slide)
        )
    return tuple(found)


def links_at(robot: Robot, poses: Poses) -> list[Link]:
    """Return the joints of a robot at configurations (N)."""
    return [link_at(form, poses) for form in robot.once(forms_of)]


def link_at(form: LinkForm, poses: Poses) -> Link:
    """Return a joint at configurations (N)."""
    at = [poses[body] for body in form.bodies]
    (p1, R1), (p2, R2) = (
        (p + R @ own, R @ turn) for (p, R), (own, turn) in zip(at, form.frames, strict=True)
    )
    held = []
    for row in form.rows:
        f, couple = R1 @ row.e, np.zeros_like(p1)
        if row.length is not None:
            f = (p2 - p1) / np.linalg.norm(p2 - p1, axis=-1, keepdims=True)
        if row.f is not None:
            couple, f = np.cross((R2 if row.crossing else R1) @ row.f, f), np.zeros_like(p1)
        if row.pitch is not None:
            couple = -float(row.pitch) * f
        held.append(np.hstack([couple + np.cross(p2, f), f]))
    axis = R1 @ form.turn
    twist = None
    if form.slide is not None:
        twist = np.hstack([axis, np.cross(p1, axis) + R1 @ form.slide])
    wrenches = np.stack(held, axis=1) if held else np.zeros((len(p1), 0, 6))
    return Link(form.name, form.bodies, wrenches, np.stack([p1, p2], axis=1), axis, twist)


def legs_at(links: Sequence[Link], base: str, platform: str) -> Iterator[PlatformLeg]:
    """Yield the legs between base and platform; what hangs on one of them alone is none."""
    graph = nx.MultiGraph()
    ends = (base, platform)
    for number, link in enumerate(links):
        first, second = ((body, number) if body in ends else body for body in link.bodies)
        graph.add_edge(first, second, number)
    for part in nx.connected_components(graph):
        numbers = sorted({number for *_, number in graph.edges(part, keys=True)})
        own = tuple(links[number] for number in numbers)
        if not {*ends} <= {name for link in own for name in link.bodies}:
            continue
        yield PlatformLeg(own)


def pinned(robot: Robot, links: Sequence[Link]) -> list[Link] | None:
    """Return the links where the pin of a hinge is a body of its own, `PIN`: one in which the tool,
    which is at the origin, sits, where it is led in its place alone; none if there is none."""
    tool, away = robot.mechanism.first_tool, AT_POINT * robot.equations.tree.length
    if not {*robot.task} <= {"x", "y", "z"}:
        return None
    for link in links:
        place, here = link.places[:, 0], np.zeros_like(link.places)
        along = link.axis * np.sum(link.axis * place, axis=-1, keepdims=True)
        aside = np.linalg.norm(place - along, axis=-1)
        hinge = link.held.shape[1] == 5 and link.axis.any() and link.twist is None
        if hinge and (aside < away).all() and tool.body in link.bodies:
            others = [other for other in links if other is not link]
            halves = [Link(link.name, (n, PIN), link.held, here, link.axis) for n in link.bodies]
            return [*others, *halves]
    return None
