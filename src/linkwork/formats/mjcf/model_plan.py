"""How a mechanism is held by MJCF: a tree of bodies, and what ties the loops.

    tree     a minimum spanning tree from ground: fixed joints first, then those that MuJoCo only
             knows inside a tree (with effects, driven or geared; prismatic, screw, cylindrical,
             universal, planar), then revolute, spherical and free ones (three slides and a ball,
             but for free bodies without effects); a body that only rods reach gets a free joint
    cut      a revolute joint is two connects on its axis, or one in a loop that moves in a plane; a
             spherical one is a connect; a rod is a tendon held at its length; any other joint leads
             to a part of its body, with an equal share of its mass, and a weld joins part and body
    massless bodies with one joint in and one out vanish: MJCF puts several joints into one body
    ball     with slides after it, as of a free joint seen from its second body: in a loop it gets a
             body of its own, for MuJoCo's constraints leave out how a ball turns the slides in its
             body (`mj_jacDot`)

All places are at home, where the loops are closed, in the ground's axes; MuJoCo's qpos0 is this
configuration.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from linkwork.equations.joints import complete, held_length, motions_of, pattern, rows_of
from linkwork.equations.topology import Rim
from linkwork.formats import poses
from linkwork.formats.mjcf.tree import Kind, plane_normal
from linkwork.mechanism import (
    GROUND,
    Cable,
    Combination,
    Displacement,
    Mechanism,
    MechanismError,
    PairJoint,
    SliderCrank,
    Thrust,
)
from linkwork.mechanism.effects import Effects

ADVANCE = "advance"  # name of a screw's slide
ARM = 0.2
"""Distance of the two points that hold a revolute joint's axis, as part of the mechanism's size."""
TURN, BALL = ("turn",), ("ball",)  # motions of the joints that are tied where they close a loop
RANKS: dict[tuple[str, ...], int] = {TURN: 2, BALL: 3}
NO_EFFECTS = Effects()


@dataclass(frozen=True)
class Home:
    """Hold a closed configuration: X_ground_body of all bodies and ground, and all joint
    coordinates."""

    poses: Mapping[str, np.ndarray]
    coordinates: Mapping[str, float]

    def frames(self, joint: PairJoint) -> tuple[np.ndarray, np.ndarray]:
        """Return the poses of a joint's two frames in ground."""
        near, far = (
            self.poses[body] @ poses.of_frame(F)
            for body, F in zip(joint.connects, joint.frames, strict=True)
        )
        return near, far

    def turned(self, joint: PairJoint) -> bool:
        """Tell whether a joint's two frames are turned against each other."""
        near, far = self.frames(joint)
        return bool(np.max(abs(near[:3, :3] - far[:3, :3])) > 1e-9)

    def size(self, mechanism: Mechanism) -> float:
        """Return the largest distance of a joint from the first one [m], or 1 where all are in one
        place."""
        points = [X[:3, 3] for joint in mechanism.pairs.values() for X in self.frames(joint)]
        reach = max((float(np.linalg.norm(point - points[0])) for point in points), default=0.0)
        return reach if reach > 1e-9 else 1.0


@dataclass(frozen=True)
class Move:
    """Hold one MuJoCo joint: a point on its axis and the axis, in ground at home; its coordinate
    there; its effects.

    One that is `backwards` moves the first of the joint's two bodies relative to the second.
    """

    kind: Kind
    name: str
    anchor: np.ndarray
    axis: np.ndarray
    ref: float = 0.0
    effects: Effects = NO_EFFECTS
    backwards: bool = False

    def reversed(self) -> Move:
        """Return the joint that moves the first body relative to the second by the same
        coordinate."""
        return replace(self, axis=-self.axis, backwards=not self.backwards)


@dataclass(frozen=True)
class Seat:
    """Hold one MJCF body: a body or a part of it, the seat it stands in, the joints between, and
    its share of the mass."""

    name: str
    body: str
    parent: str
    moves: tuple[Move, ...]
    share: float = 1.0


@dataclass(frozen=True)
class ModelTie:
    """Hold what closes a loop: points of two seats held together or at a distance, or two seats
    welded."""

    kind: Literal["connect", "weld", "rod"]
    name: str
    seats: tuple[str, str]
    points: tuple[np.ndarray, np.ndarray]
    length: float = 0.0


@dataclass(frozen=True)
class ModelPlan:
    """Hold how MJCF holds a mechanism.

    Attributes:
        tree: parent and body by the joint between them (or, for bodies that only rods reach, by a
            name given here), parents first.
        seats: the bodies of the model, depth first.
        ties: what closes the loops.
        light: the seats that move and have no mass, nor has what is fixed to them.
        dropped: the joints that the model does not hold.
        floating: the names in `tree` that are no joints.
    """

    tree: Mapping[str, tuple[str, str]]
    seats: dict[str, Seat]
    ties: tuple[ModelTie, ...]
    light: frozenset[str]
    dropped: tuple[str, ...]
    floating: tuple[str, ...]

    def chain(self, seat: str) -> list[str]:
        """Return the seats from one to the one that stands in ground."""
        chain = []
        while seat != GROUND:
            chain.append(seat)
            seat = self.seats[seat].parent
        return chain


def plan(mechanism: Mechanism, home: Home, kept: Collection[str] = ()) -> ModelPlan:
    """Choose tree and ties.

    Args:
        home: a configuration in which the loops are closed.
        kept: joints that stay joints wherever they are, like those with effects, driven or geared.

    Raises:
        MechanismError: MJCF has no place for a joint.
    """
    return _Planner(mechanism, home, kept).plan()


class _Planner:
    def __init__(self, mechanism: Mechanism, home: Home, kept: Collection[str]):
        self.mechanism, self.home, self.arm = mechanism, home, ARM * home.size(mechanism)
        self.seats: dict[str, Seat] = {}
        combined = [
            line for line in mechanism.transmissions.values() if isinstance(line, Combination)
        ]
        geared = {label for line in (*mechanism.gears.values(), *combined) for label in line.ratios}
        self.needed = {*kept} | {
            name
            for name, joint in mechanism.pairs.items()
            if any(effects != NO_EFFECTS for effects in joint.effects().values())
            or {*joint.rates(name), *joint.coordinates(name)} & {*mechanism.actuators, *geared}
        }

    def plan(self) -> ModelPlan:
        # Joints in MuJoCo's tree; each joint that closes a loop and cannot be tied hangs a part of
        # its body in the tree.
        tree, floating = self._tree()
        cuts = {name: joint for name, joint in self.mechanism.pairs.items() if name not in tree}
        split = {name: joint for name, joint in cuts.items() if self._needs_part(name, joint)}
        # The parts of a body share its mass.
        shares: dict[str, int] = {}
        for joint in split.values():
            shares[carried(joint)] = shares.get(carried(joint), 1) + 1
        # Bodies sit where the tree has them, by the joint that leads there.
        for name, (parent, body) in tree.items():
            floats = name in floating or self._rank(name, self.mechanism.pairs[name]) == 4
            moves = (self._float(name, body),) if floats else self._moves(name, parent)
            self.seats[body] = Seat(body, body, parent, moves, 1 / shares.get(body, 1))
        # Parts sit behind their joints, welded to their bodies.
        ties: list[ModelTie] = []
        for name, joint in split.items():
            body = carried(joint)
            parent = joint.connects[0] if joint.connects[1] == body else joint.connects[1]
            part = f"{body}.{name}"
            self.seats[part] = Seat(part, body, parent, self._moves(name, parent), 1 / shares[body])
            origin = self.home.poses[body][:3, 3]
            ties.append(ModelTie("weld", name, (body, part), (origin, origin)))
        # All other loops are closed by ties; what needs none is dropped.
        dropped = []
        for name, joint in cuts.items():
            if name in split:
                continue
            ties += (closing := self._ties(name, joint))
            if not closing:
                dropped.append(name)
        # What MuJoCo refuses: bodies without mass, and balls that cannot be told in one move.
        self._stack_massless(ties)
        self._part_balls(ties)
        return ModelPlan(
            tree, self._ordered(), tuple(ties), self._light(), tuple(dropped), tuple(floating)
        )

    # ----------------------------------------------------------------------------------------- tree

    def _rank(self, name: str, joint: PairJoint) -> int | None:
        if not complete(joint):
            return None
        if not joint.freedoms:
            return 0
        if name in self.needed:
            return 1
        if not rows_of(joint):
            return 4 if GROUND in joint.connects else 5
        return RANKS.get(pattern(joint), 1)

    def _tree(self) -> tuple[dict[str, tuple[str, str]], list[str]]:
        """Return parent and body by joint (or, for bodies that only rods reach, by a name given
        here), and those names."""
        depth, tree, floating = {GROUND: 0}, {}, []
        pairs = self.mechanism.pairs
        ranks = {name: self._rank(name, joint) for name, joint in pairs.items()}
        order = {name: number for number, name in enumerate(pairs)}
        fit = {name: joint for name, joint in pairs.items() if ranks[name] is not None}
        # By rank, near to ground first; where only rods lead on, a free joint.
        rim = Rim(fit, depth, lambda name, near: (ranks[name], near, order[name]))
        while len(depth) <= len(self.mechanism.bodies):
            branch = rim.entering()
            if branch is not None:
                tree[branch.joint] = branch.parent, branch.body
                continue
            body = next(body for body in self.mechanism.bodies if body not in depth)
            name = next(
                (n for n in (body, f"{body}.free") if n not in self.mechanism.joints),
                f"{body}.float",
            )
            floating.append(name)
            tree[name], depth[body] = (GROUND, body), 1
            rim.widen(body)
        return tree, floating

    def _needs_part(self, name: str, joint: PairJoint) -> bool:
        """Tell whether a joint that closes a loop must stay a joint, leading to a part of its
        body."""
        tied = pattern(joint) in (TURN, BALL) or not rows_of(joint)
        return bool(joint.freedoms) and (name in self.needed or not tied)

    # --------------------------------------------------------------------------------------- joints

    def _moves(self, name: str, parent: str) -> tuple[Move, ...]:
        """Return the MuJoCo joints of a joint, seen from a parent: backwards in order and sense
        from its second body."""
        joint = self.mechanism.pairs[name]
        moves = self._forward(name, joint)
        return (
            moves if joint.connects[0] == parent else tuple(move.reversed() for move in moves[::-1])
        )

    def _forward(self, name: str, joint: PairJoint) -> tuple[Move, ...]:
        near, far = self.home.frames(joint)
        motions, at, moves = motions_of(joint), far[:3, 3], []
        for k, (motion, part) in enumerate(zip(motions, joint.parts(name), strict=True)):
            label = name if len(motions) == 1 else f"{name}.{part.name}"
            # Axes at home, in the ground's axes: no turn before leaves the first frame's alone,
            # none behind the second's.
            turned = any(after.turns for after in motions[k + 1 :])
            R = (near if turned else far)[:3, :3]
            effects, ref = part.effects, self.home.coordinates[part.coordinates[0]]
            # As MuJoCo stacks them: a slide before the hinge of its axis, a screw as both.
            match motion.what:
                case "turn":
                    moves.append(Move("hinge", label, at, R @ motion.turn, ref, effects))
                case "slide":
                    slide = Move("slide", label, at, R @ motion.slide, ref, effects)
                    along = bool(moves) and np.array_equal(moves[-1].axis, slide.axis)
                    moves.insert(len(moves) - along, slide)
                case "screw":
                    hinge = Move("hinge", label, at, R @ motion.turn, ref, effects)
                    advance = float(motion.pitch or 0.0) * ref
                    moves += Move("slide", f"{name}.{ADVANCE}", at, hinge.axis, advance), hinge
                case "ball":
                    self._require_neutral(name, effects)
                    moves.append(Move("ball", label, at, np.zeros(3), effects=effects))
        return tuple(moves)

    def _float(self, name: str, body: str) -> Move:
        """Return MuJoCo's own free joint, for what moves freely in ground without effects."""
        return Move("free", name, self.home.poses[body][:3, 3], np.zeros(3))

    def _require_neutral(self, name: str, effects: Effects) -> None:
        """Refuse what MuJoCo measures from qpos0 and the mechanism from where the two frames
        agree."""
        measured = any(effects.spring.pulls) or effects.limits.upper is not None
        if measured and self.home.turned(self.mechanism.pairs[name]):
            raise MechanismError(
                f"joints.{name}: has a spring or a limit and is turned at home; MuJoCo measures "
                "the turn of a ball joint from home, so that the two frames must agree there"
            )

    # ----------------------------------------------------------------------------------------- ties

    def _ties(self, name: str, joint: PairJoint) -> list[ModelTie]:
        near, far = self.home.frames(joint)
        points = near[:3, 3], far[:3, 3]
        if (length := held_length(joint)) is not None:
            return [ModelTie("rod", name, joint.connects, points, float(length))]
        if pattern(joint) == BALL:
            return [ModelTie("connect", name, joint.connects, points)]
        if pattern(joint) != TURN:
            return []
        axis = near[:3, :3] @ motions_of(joint)[0].turn
        if self._planar(joint, axis):
            return [ModelTie("connect", name, joint.connects, points)]
        reach = self.arm / 2 * axis
        ends = [
            (end, points[0] + way, points[1] + way)
            for end, way in (("near", -reach), ("far", reach))
        ]
        return [ModelTie("connect", f"{name}.{end}", joint.connects, (p, q)) for end, p, q in ends]

    def _planar(self, joint: PairJoint, axis: np.ndarray) -> bool:
        """Tell whether a revolute joint closes a loop that moves in the plane across it."""
        between = self._between(joint.connects)
        normal = plane_normal((move.kind, move.axis) for seat in between for move in seat.moves)
        return normal is not None and bool(abs(abs(normal @ axis) - 1) < 1e-9)

    def _between(self, ends: tuple[str, str]) -> list[Seat]:
        """Return the seats in a loop that is closed between two of them."""
        chains = [self._chain(seat) for seat in ends]
        common = {seat.name for seat in chains[0]} & {seat.name for seat in chains[1]}
        return [seat for chain in chains for seat in chain if seat.name not in common]

    def _chain(self, seat: str) -> list[Seat]:
        chain = []
        while seat != GROUND:
            chain.append(self.seats[seat])
            seat = self.seats[seat].parent
        return chain

    # ------------------------------------------------------------------------------ massless bodies

    def _stack_massless(self, ties: list[ModelTie]) -> None:
        """Put the joints of massless bodies into the one body that stands in each."""
        springs = self.mechanism.springs.values()
        kept = {body for tie in ties for body in tie.seats} | {
            tool.body for tool in self.mechanism.tools.values()
        }
        kept |= {body for spring in springs for body in spring.connects}
        lines = self.mechanism.transmissions.values()
        kept |= {line.body for line in lines if isinstance(line, Thrust)}
        kept |= {lift.body for lift in self.mechanism.lifts.values()}
        between = (Cable, SliderCrank, Displacement)
        kept |= {body for line in lines if isinstance(line, between) for body in line.bodies}
        for name in list(self.seats):
            seat = self.seats[name]
            children = [child for child in self.seats.values() if child.parent == name]
            body = self.mechanism.bodies[seat.body]
            light = body.mass == 0 and not body.inertia.tensor().any()
            if not light or name in kept or len(children) != 1 or not seat.moves:
                continue
            (child,) = children
            if any(move.kind == "free" for move in seat.moves) or turns_after_a_ball(
                seat.moves, child.moves
            ):
                continue
            del self.seats[name]
            self.seats[child.name] = replace(
                child, parent=seat.parent, moves=(*seat.moves, *child.moves)
            )

    def _part_balls(self, ties: list[ModelTie]) -> None:
        """Give balls in loops that slides follow a body of their own, which has no share of the
        mass."""
        for seat in {seat.name: seat for tie in ties for seat in self._between(tie.seats)}.values():
            after = next(
                (k + 1 for k, move in enumerate(seat.moves) if move.kind == "ball"), len(seat.moves)
            )
            if after < len(seat.moves):
                own = f"{seat.name}.{seat.moves[after - 1].name}"
                self.seats[own] = Seat(own, seat.body, seat.parent, seat.moves[:after], 0.0)
                self.seats[seat.name] = replace(seat, parent=own, moves=seat.moves[after:])

    def _light(self) -> frozenset[str]:
        fixed: dict[str, list[Seat]] = {}
        for seat in self.seats.values():
            if not seat.moves:
                fixed.setdefault(seat.parent, []).append(seat)

        def heavy(seat: Seat) -> bool:
            return bool(self.mechanism.bodies[seat.body].mass) or any(
                map(heavy, fixed.get(seat.name, []))
            )

        return frozenset(
            seat.name
            for seat in self.seats.values()
            if seat.moves and seat.share and not heavy(seat)
        )

    def _ordered(self) -> dict[str, Seat]:
        """Return the seats depth first, parents before children: MuJoCo's order."""
        children: dict[str, list[str]] = {}
        for seat in self.seats.values():
            children.setdefault(seat.parent, []).append(seat.name)
        ordered, waiting = {}, children.get(GROUND, [])[::-1]
        while waiting:
            name = waiting.pop()
            ordered[name] = self.seats[name]
            waiting += children.get(name, [])[::-1]
        return ordered


def turns_after_a_ball(first: tuple[Move, ...], then: tuple[Move, ...]) -> bool:
    """Tell whether a ball would be followed by a turn in one body, which MuJoCo refuses."""
    return any(move.kind == "ball" for move in first) and any(
        move.kind in ("hinge", "ball") for move in then
    )


def carried(joint: PairJoint) -> str:
    """Return the body that a joint that closes a loop carries a part of: its second, if that is not
    ground."""
    first, second = joint.connects
    return first if second == GROUND else second
