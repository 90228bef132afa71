"""Maximal coordinates with multipliers for every joint type and effect: an independent formulation
to test against.

Every body is free, with the twist t_i = [omega_i; v_i] (v of the mass centre, ground's axes); t
stacks them (6r). The second frame of a joint has, seen in the first, the twist s = [omega; u]
(see `pairs`):

    s = G t,    s' = G t' + g          w = F t,  w' = F t' + b        rates of all joints
                                       0 = A t,  0  = A t' + a        constraints of all joints

Newton and Euler, with rotors J, joint forces f along the rates, and wrenches W (weight, gyroscopic,
point springs):

    [M + F'J F   -A'] [t'    ]   [W + F'(f - J b)]
    [A            0 ] [lambda] = [-a             ]

Dependent rows of A are met by its singular values: with the pseudo-inverse A+ and the null space N,
t' = N y - A+ a and N'M N y = N'(right - M (-A+ a)); lambda is the least one. Bodies without mass or
with zz alone are thereby allowed wherever the joints hold them. Nothing is shared with the library
but the description. Units SI.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property, lru_cache

import networkx as nx
import numpy as np
from numpy.polynomial import Polynomial

from linkwork.mechanism import (
    GROUND,
    Friction,
    GearJoint,
    Mechanism,
    PairJoint,
    RodJoint,
    Spring,
)

from tests.oracle import pairs
from tests.oracle.arithmetic import skew
from tests.oracle.lagrange import OracleError, pivoted

Poses = Mapping[str, tuple[np.ndarray, np.ndarray]]  # body -> (p of the frame's origin, R_0B)
Twists = Mapping[
    str, tuple[np.ndarray, np.ndarray]
]  # body -> (omega, v of the mass centre), ground's axes

DEPENDENT = 1e-9  # singular values of A below this part of the largest count as zero


@dataclass(frozen=True)
class Relative:
    """Hold F2 seen in F1: pose (R, p), twist s = [omega; u], G and g in s' = G t' + g; R_1, o_1
    place F1 in ground."""

    R: np.ndarray
    p: np.ndarray
    s: np.ndarray
    G: np.ndarray
    g: np.ndarray
    R_1: np.ndarray
    o_1: np.ndarray


@dataclass(frozen=True)
class Rows:
    """Hold all rows: w' = F t' + b, 0 = A t' + a, and the joint that each row of A belongs to."""

    F: np.ndarray
    b: np.ndarray
    A: np.ndarray
    a: np.ndarray
    owner: np.ndarray


@dataclass(frozen=True)
class Freedom:
    """Hold a freedom with its effects: where its rates are among all rates, its coordinate or
    rotation vector."""

    rates: slice
    q: np.ndarray
    friction: Friction
    spring: Spring
    rotor: float


@dataclass(frozen=True)
class MaximalOracle:
    """Evaluate a mechanism in maximal coordinates.

    Poses are {body: (p, R)}, the frames' origins [m] and orientations in ground; twists {body:
    (omega, v)} with v of the mass centre, in ground's axes; forces (u) are those of the actuators,
    in their order. Angles are read within half a turn of `near` (by coordinate; the reference where
    left out), which springs and gears need.

    Raises:
        OracleError: loops that do not close; rates, forces or accelerations that contradict or
            leave open the motion.
    """

    mechanism: Mechanism
    near: Mapping[str, float] = field(default_factory=dict)

    # Places

    def poses(self, coordinates: Mapping[str, float], guess: Poses | None = None) -> Poses:
        """Place the bodies by shortest paths of joints from ground; a body that only rods reach
        stays at its guess."""
        graph = self.mechanism.graph()
        for name, joint in self.mechanism.pairs.items():
            if isinstance(joint, RodJoint):
                graph.remove_edge(*joint.connects, key=name)
        bodies = [GROUND, *self.mechanism.bodies]
        poses = {body: (np.zeros(3), np.eye(3)) for body in bodies} | dict(guess or {})
        for island in nx.connected_components(graph):
            for body, path in nx.single_source_shortest_path(
                graph, min(island, key=bodies.index)
            ).items():
                if path[1:]:
                    poses[body] = self._hung(body, min(graph[path[-2]][body]), poses, coordinates)
        return {body: poses[body] for body in self.mechanism.bodies}

    def reference_poses(self, guess: Poses | None = None) -> Poses:
        """Return the poses at the reference, the loops closed."""
        return self.assemble(self.poses(self.mechanism.reference, guess))

    def assemble(self, poses: Poses, held: Mapping[str, float] | None = None) -> Poses:
        """Close the loops near the given poses by Gauss and Newton's method, least steps; `held`
        fixes coordinates.

        Only angles and slides can be held.
        """
        held = dict(held or {})
        fixed = [self.mechanism.rates.index(name) for name in held]
        shown = [self.mechanism.coordinates.index(name) for name in held]
        near = MaximalOracle(self.mechanism, {**self.near, **held})
        for _ in range(50):
            seen = self._seen(poses, self._rest)
            rows, here = self._rows(seen), near._coordinates(seen)
            gap = np.concatenate([*near._residuals(seen).values(), here[shown] - [*held.values()]])
            step = np.linalg.lstsq(np.vstack([rows.A, rows.F[fixed]]), -gap, rcond=DEPENDENT)[0]
            poses = self.moved(poses, step * min(1, 0.5 / np.max(abs(step), initial=0.5)))
            if np.max(abs(step), initial=0) < 1e-9:
                break
        worst = max((np.max(abs(r), initial=0) for r in near.residuals(poses).values()), default=0)
        if not worst < 1e-9:
            raise OracleError(
                f"{self.mechanism.name}: the loops do not close from here, {worst:.3g} remains"
            )
        return poses

    def moved(self, poses: Poses, step: np.ndarray) -> Poses:
        """Turn each body about its mass centre and shift it, by step (6r) in the order of t."""
        moved = {}
        for (name, body), (turn, shift) in zip(
            self.mechanism.bodies.items(), step.reshape(-1, 2, 3), strict=True
        ):
            p, R = poses[name]
            c, R_new = p + R @ body.centre_of_mass + shift, pairs.exponential(turn) @ R
            moved[name] = c - R_new @ body.centre_of_mass, R_new
        return moved

    def residuals(self, poses: Poses) -> dict[str, np.ndarray]:
        """Return by joint how far it is from its own motion [m, rad], one number per constraint;
        gears in their unit."""
        return self._residuals(self._seen(poses, self._rest))

    def _residuals(self, seen: Mapping[str, Relative]) -> dict[str, np.ndarray]:
        shown = dict(zip(self.mechanism.coordinates, self._coordinates(seen), strict=True))
        gears = {
            name: np.array([sum(P(shown[of]) for of, P in law(gear).items()) - gear.offset])
            for name, gear in self.mechanism.gears.items()
        }
        parts = {
            name: pairs.residual(joint, seen[name].R, seen[name].p)
            for name, joint in self.mechanism.pairs.items()
        }
        return {name: (parts | gears)[name] for name in self.mechanism.joints}

    def coordinates(self, poses: Poses) -> np.ndarray:
        """Return all joint coordinates in the mechanism's order [m, rad]; quaternions with w >=
        0."""
        return self._coordinates(self._seen(poses, self._rest))

    def _coordinates(self, seen: Mapping[str, Relative]) -> np.ndarray:
        near, shown = {**self.mechanism.reference, **self.near}, [np.zeros(0)]
        for name, joint in self.mechanism.pairs.items():
            R, p, close = (
                seen[name].R,
                seen[name].p,
                [near.get(n, 0) for n in joint.coordinates(name)],
            )
            shown.append(pairs.coordinates(joint, R, p, close))
        return np.concatenate(shown)

    def motions(self, poses: Poses) -> np.ndarray:
        """Return N (6r, mobility): an orthonormal basis of all t with A t = 0."""
        return pseudo_inverse(self.rows(poses, self._rest).A)[1]

    def mobility(self, poses: Poses) -> int:
        """Return 6r - rank(A): all freedoms at these poses, idle ones and those of a singular pose
        included."""
        return self.motions(poses).shape[1]

    def independent_rates(self, poses: Poses) -> tuple[str, ...]:
        """Return the names of as few rates as determine all rates, those that do it best first.

        They are the pivots of F N. They are fewer than the freedoms where bodies move that no rate
        shows.
        """
        F, N = self.rows(poses, self._rest).F, self.motions(poses)
        if not (F @ N).size:
            return ()
        R, pivots = pivoted((F @ N).T)
        return tuple(
            self.mechanism.rates[i]
            for i in pivots[: np.sum(abs(np.diag(R)) > DEPENDENT * abs(R[0, 0]))]
        )

    # Motion

    def by_body(self, t: np.ndarray) -> Twists:
        """Split t (6r) into the twists of the bodies."""
        return {
            name: (t[6 * i : 6 * i + 3], t[6 * i + 3 : 6 * i + 6])
            for name, i in self._order.items()
        }

    def rates(self, poses: Poses, twists: Twists) -> np.ndarray:
        """Return all joint rates w in the mechanism's order [m/s, rad/s]."""
        return self.rows(poses, twists).F @ self._stacked(twists)

    def constraint_velocity_error(self, poses: Poses, twists: Twists) -> float:
        """Return the largest |A t|."""
        return float(np.max(abs(self.rows(poses, twists).A @ self._stacked(twists)), initial=0))

    def twists(self, poses: Poses, rates: Mapping[str, float]) -> Twists:
        """Return the twists at which these joints have these rates: A t = 0, F t = w; as small as
        that allows."""
        rows, chosen = (
            self.rows(poses, self._rest),
            [self.mechanism.rates.index(name) for name in rates],
        )
        return self.by_body(
            self._met(rows, chosen, np.zeros(len(rows.A)), np.array([*rates.values()]))
        )

    def accelerations(
        self, poses: Poses, twists: Twists, forces: Sequence[float] | np.ndarray = ()
    ) -> Twists:
        """Return (alpha, a of the mass centre) of every body in ground's axes, from the actuator
        forces."""
        return self.by_body(self._dynamics(poses, twists, forces)[0])

    def joint_accelerations(
        self, poses: Poses, twists: Twists, accelerations: Twists
    ) -> np.ndarray:
        """Return w' of all joints in the order of the rates [m/s^2, rad/s^2]."""
        rows = self.rows(poses, twists)
        return rows.F @ self._stacked(accelerations) + rows.b

    def accelerations_of(self, poses: Poses, twists: Twists, rates: Mapping[str, float]) -> Twists:
        """Return the bodies' accelerations at which these rates have these derivatives (as small as
        that allows)."""
        rows, chosen = (
            self.rows(poses, twists),
            [self.mechanism.rates.index(name) for name in rates],
        )
        return self.by_body(
            self._met(rows, chosen, -rows.a, np.array([*rates.values()]) - rows.b[chosen])
        )

    def inverse_dynamics(self, poses: Poses, twists: Twists, accelerations: Twists) -> np.ndarray:
        """Return the least actuator forces u that bring about the bodies' accelerations: N'F_a' u =
        N'(M t' - W ...)."""
        seen, no_forces = self._seen(poses, twists), np.zeros(len(self.mechanism.actuators))
        M, applied = self._newton_euler(poses, twists, no_forces, seen)
        N, S = self.motions(poses), self._rows(seen).F[self._actuated]
        wanted = N.T @ (M @ self._stacked(accelerations) - applied)
        u = np.linalg.lstsq((S @ N).T, wanted, rcond=DEPENDENT)[0]
        require_small(
            (S @ N).T @ u - wanted,
            wanted,
            f"{self.mechanism.name}: the actuators cannot bring this about",
        )
        return u

    # Forces

    def reactions(
        self, poses: Poses, twists: Twists, forces: Sequence[float] | np.ndarray = ()
    ) -> dict[str, np.ndarray]:
        """Return each joint's constraint wrench on its second body: [moment about F1's origin;
        force], ground's axes.

        The first body gets the opposite about the same point. Actuator, spring, friction and rotor
        forces are left out. A gear has one number, its multiplier: it pushes every geared rate by
        its slope times that. Parts that dependent constraints leave open are the least ones.
        """
        _, multipliers, rows = self._dynamics(poses, twists, forces)
        reactions, relatives = {}, self._seen(poses, twists)
        for name, joint in self.mechanism.joints.items():
            own = multipliers[rows.owner == name]
            if isinstance(joint, PairJoint):
                seen = relatives[name]
                wrench = pairs.rows(joint, seen.R, seen.p)[1].T @ own
                moment, force = wrench[:3] + pairs.cross(seen.p, wrench[3:]), wrench[3:]
                own = np.concatenate([seen.R_1 @ moment, seen.R_1 @ force])
            reactions[name] = own
        return reactions

    def energy(self, poses: Poses, twists: Twists) -> tuple[float, float]:
        """Return the kinetic energy, rotors included, and the potential energy of weight and
        springs [J]."""
        t, seen = self._stacked(twists), self._seen(poses, twists)
        w = self._rows(seen).F @ t
        kinetic, potential = t @ self._body_inertia(poses) @ t / 2, 0.0
        for name, body in self.mechanism.bodies.items():
            p, R = poses[name]
            potential -= body.mass * np.dot(self.mechanism.gravity, p + R @ body.centre_of_mass)
        for freedom in self._freedoms(seen):
            kinetic += freedom.rotor * np.sum(w[freedom.rates] ** 2) / 2
            size = reach(freedom)
            for power, k in enumerate(freedom.spring.pulls, start=2):
                potential += k * size**power / power
        for spring, _, stretch, _ in self._point_springs(poses, twists):
            potential += spring.stiffness * (stretch - spring.rest_length) ** 2 / 2
        return float(kinetic), float(potential)

    def power(
        self, poses: Poses, twists: Twists, forces: Sequence[float] | np.ndarray = ()
    ) -> float:
        """Return the rate of the energy: the actuators' power less what friction and dampers take
        [W]."""
        seen = self._seen(poses, twists)
        w = self._rows(seen).F @ self._stacked(twists)
        power = np.dot(np.asarray(forces, dtype=float), w[self._actuated])
        for freedom in self._freedoms(seen):
            power -= resistance(freedom, w[freedom.rates]) @ w[freedom.rates]
        for spring, _, _, stretching in self._point_springs(poses, twists):
            power -= spring.damping * stretching**2
        return float(power)

    # Mechanics

    def _dynamics(self, poses: Poses, twists: Twists, forces: Sequence[float] | np.ndarray):
        """Return t', the multipliers and the rows."""
        seen, name = self._seen(poses, twists), self.mechanism.name
        rows = self._rows(seen)
        M, applied = self._newton_euler(poses, twists, forces, seen)
        inverse, N = pseudo_inverse(rows.A)
        given = -inverse @ rows.a
        require_small(
            rows.A @ given + rows.a,
            rows.a,
            f"{name}: the constraints contradict each other at these rates",
        )
        reduced, pushed = N.T @ M @ N, N.T @ (applied - M @ given)
        y = np.linalg.lstsq(reduced, pushed, rcond=1e-13)[0]
        require_small(
            reduced @ y - pushed, pushed, f"{name}: something without inertia moves freely"
        )
        t_dot = given + N @ y
        return t_dot, inverse.T @ (M @ t_dot - applied), rows

    def _newton_euler(
        self, poses: Poses, twists: Twists, forces, seen: Mapping[str, Relative]
    ) -> tuple[np.ndarray, np.ndarray]:
        """Return M + F'J F and W + F'(f - J b)."""
        rows, M = self._rows(seen), self._body_inertia(poses)
        w = rows.F @ self._stacked(twists)
        applied, f, J = np.zeros(len(M)), np.zeros(len(w)), np.zeros(len(w))
        for i, (name, body) in enumerate(self.mechanism.bodies.items()):
            turn, shift = slice(6 * i, 6 * i + 3), slice(6 * i + 3, 6 * i + 6)
            omega = twists[name][0]
            applied[turn] = -pairs.cross(omega, M[turn, turn] @ omega)
            applied[shift] = body.mass * np.array(self.mechanism.gravity)
        for spring, D, stretch, stretching in self._point_springs(poses, twists):
            applied -= D * (
                spring.stiffness * (stretch - spring.rest_length) + spring.damping * stretching
            )
        for freedom in self._freedoms(seen):
            size = reach(freedom)
            grown = sum(k * size**n for n, k in enumerate(freedom.spring.pulls))
            f[freedom.rates] -= grown * freedom.q + resistance(freedom, w[freedom.rates])
            J[freedom.rates] = freedom.rotor
        f[self._actuated] += np.asarray(forces, dtype=float)
        return M + rows.F.T @ (J[:, None] * rows.F), applied + rows.F.T @ (f - J * rows.b)

    def _body_inertia(self, poses: Poses) -> np.ndarray:
        M = np.zeros((6 * len(self.mechanism.bodies),) * 2)
        for i, (name, body) in enumerate(self.mechanism.bodies.items()):
            R = poses[name][1]
            M[6 * i : 6 * i + 3, 6 * i : 6 * i + 3] = R @ body.inertia.tensor() @ R.T
            M[6 * i + 3 : 6 * i + 6, 6 * i + 3 : 6 * i + 6] = body.mass * np.eye(3)
        return M

    def _freedoms(self, seen: Mapping[str, Relative]):
        """Yield every freedom with its effects; q is measured from the spring's rest."""
        shown = dict(zip(self.mechanism.coordinates, self._coordinates(seen), strict=True))
        done = 0
        for name, joint in self.mechanism.pairs.items():
            for freedom, own in joint.effects().items():
                friction, spring, rotor = own.friction, own.spring, own.rotor
                if freedom == "turn":
                    q, width = pairs.logarithm(seen[name].R), 3
                else:
                    label = name if joint.coordinates(name) == (name,) else f"{name}.{freedom}"
                    q, width = np.array([shown[label] - spring.rest]), 1
                yield Freedom(slice(done, done + width), q, friction, spring, rotor)
                done += width

    def _point_springs(self, poses: Poses, twists: Twists):
        """Yield every point spring with D, its length l and l' = D t."""
        for spring in self.mechanism.springs.values():
            (x_1, V_1), (x_2, V_2) = (
                self._point(body, point, poses)
                for body, point in zip(spring.connects, spring.points, strict=True)
            )
            length = float(np.linalg.norm(x_2 - x_1))
            D = (x_2 - x_1) / length @ (V_2 - V_1) if length else 0 * V_1[0]
            yield spring, D, length, float(D @ self._stacked(twists))

    @cached_property
    def _actuated(self) -> list[int]:
        return [self.mechanism.rates.index(name) for name in self.mechanism.actuators]

    # Rows

    def rows(self, poses: Poses, twists: Twists) -> Rows:
        """Return the rows of all rates and all constraints, the gears' last."""
        return self._rows(self._seen(poses, twists))

    def _seen(self, poses: Poses, twists: Twists) -> dict[str, Relative]:
        """Return by joint its second frame as the first sees it."""
        joints = self.mechanism.pairs.items()
        return {name: self._relative(joint, poses, twists) for name, joint in joints}

    def _rows(self, relatives: Mapping[str, Relative]) -> Rows:
        size = 6 * len(self.mechanism.bodies)
        F, b, A, a, owner = np.zeros((0, size)), np.zeros(0), np.zeros((0, size)), np.zeros(0), []
        w = np.zeros(0)
        for name, joint in self.mechanism.pairs.items():
            seen = relatives[name]
            free, held = pairs.rows(joint, seen.R, seen.p)
            beta = pairs.rest(joint, seen.R, seen.p, seen.s[:3], seen.s[3:])
            F, b = np.vstack([F, free @ seen.G]), np.append(b, free @ seen.g)
            w = np.append(w, free @ seen.s)
            A, a = np.vstack([A, held @ seen.G]), np.append(a, held @ seen.g + beta)
            owner += [name] * len(held)
        shown = dict(zip(self.mechanism.coordinates, self._coordinates(relatives), strict=True))
        for name, gear in self.mechanism.gears.items():
            slopes, bends = np.zeros(len(w)), np.zeros(len(w))
            for label, P in law(gear).items():
                place = self.mechanism.rates.index(label)
                slopes[place], bends[place] = P.deriv()(shown[label]), P.deriv(2)(shown[label])
            A, owner = np.vstack([A, slopes @ F]), [*owner, name]
            a = np.append(a, slopes @ b + bends @ w**2)
        return Rows(F, b, A, a, np.array(owner, dtype=str))

    def _relative(self, joint: PairJoint, poses: Poses, twists: Twists) -> Relative:
        """Return F2 seen in F1; with r = o_2 - o_1, V_i the velocity of o_i and A_i its
        acceleration at t' = 0,

        omega = R_1'(omega_2 - omega_1),            u = R_1'(V_2 - V_1 - omega_1 x r)
        g = R_1'[-omega_1 x omega_2;   A_2 - A_1 - 2 omega_1 x r' + omega_1 x (omega_1 x r)]
        """
        (R_1, o_1, W_1, V_1, A_1), (R_2, o_2, W_2, V_2, A_2) = (
            self._frame(body, frame, poses, twists)
            for body, frame in zip(joint.connects, joint.frames, strict=True)
        )
        t, r = self._stacked(twists), o_2 - o_1
        omega_1, omega_2, slip = W_1 @ t, W_2 @ t, (V_2 - V_1) @ t
        G = np.vstack([R_1.T @ (W_2 - W_1), R_1.T @ (V_2 - V_1 + skew(r) @ W_1)])
        turning = -pairs.cross(omega_1, omega_2)
        sliding = (
            A_2
            - A_1
            - 2 * pairs.cross(omega_1, slip)
            + pairs.cross(omega_1, pairs.cross(omega_1, r))
        )
        g = np.concatenate([R_1.T @ turning, R_1.T @ sliding])
        return Relative(R_1.T @ R_2, R_1.T @ r, G @ t, G, g, R_1, o_1)

    def _frame(self, body: str, frame, poses: Poses, twists: Twists):
        """Return a joint frame's R and origin o in ground, the rows of its angular velocity and of
        o', and o'' - V t'."""
        o, V = self._point(body, frame.position, poses)
        W = np.zeros_like(V)
        if body == GROUND:
            return frame_turn(frame.rotation), o, W, V, np.zeros(3)
        k = 6 * self._order[body]
        W[:, k : k + 3] = np.eye(3)
        omega, v = twists[body]
        A = pairs.cross(omega, V @ self._stacked(twists) - v)  # omega x (omega x d)
        return poses[body][1] @ frame_turn(frame.rotation), o, W, V, A

    def _point(self, body: str, point, poses: Poses) -> tuple[np.ndarray, np.ndarray]:
        """Return a body's point in ground and the rows V of its velocity V t."""
        V = np.zeros((3, 6 * len(self.mechanism.bodies)))
        if body == GROUND:
            return np.array(point), V
        (p, R), k = poses[body], 6 * self._order[body]
        d = R @ (np.array(point) - self.mechanism.bodies[body].centre_of_mass)
        V[:, k : k + 3], V[:, k + 3 : k + 6] = -skew(d), np.eye(3)
        return p + R @ point, V

    def _hung(self, body: str, name: str, poses: Poses, coordinates: Mapping[str, float]):
        """Return (p, R) of a body that hangs on a placed one by a joint at given coordinates."""
        joint = self.mechanism.pairs[name]
        default = {label: float(label.endswith(".qw")) for label in joint.coordinates(name)}
        R_12, p_12 = pairs.motion(
            joint, [coordinates.get(label, default[label]) for label in default]
        )
        side = joint.connects.index(body)
        (R_near, p_near), (R_far, p_far) = (
            (frame_turn(joint.frames[i].rotation), np.array(joint.frames[i].position))
            for i in (1 - side, side)
        )
        R, p = (R_12, p_12) if side else (R_12.T, -R_12.T @ p_12)
        p_0, R_0 = poses[joint.connects[1 - side]]
        R_body = R_0 @ R_near @ R @ R_far.T
        return p_0 + R_0 @ (p_near + R_near @ p) - R_body @ p_far, R_body

    # Numbers

    @cached_property
    def _order(self) -> dict[str, int]:
        return {name: i for i, name in enumerate(self.mechanism.bodies)}

    @cached_property
    def _rest(self) -> Twists:
        return {name: (np.zeros(3), np.zeros(3)) for name in self.mechanism.bodies}

    def _stacked(self, twists: Twists) -> np.ndarray:
        return np.concatenate(
            [np.zeros(0), *(part for name in self.mechanism.bodies for part in twists[name])]
        )

    def _met(
        self, rows: Rows, chosen: list[int], held: np.ndarray, wanted: np.ndarray
    ) -> np.ndarray:
        """Solve A t = held, F_chosen t = wanted for the least t."""
        left, right = np.vstack([rows.A, rows.F[chosen]]), np.concatenate([held, wanted])
        t = np.linalg.lstsq(left, right, rcond=DEPENDENT)[0]
        require_small(
            left @ t - right, right, f"{self.mechanism.name}: these rates do not go together"
        )
        return t


@lru_cache(maxsize=4096)
def frame_turn(rotation: tuple[float, float, float]) -> np.ndarray:
    """Return the rotation matrix of a frame's rotation vector."""
    R = pairs.exponential(rotation)
    R.flags.writeable = False
    return R


def reach(freedom: Freedom) -> float:
    """Return the displacement with its sign, or the angle of a free turn."""
    return float(freedom.q[0]) if freedom.q.size == 1 else float(np.linalg.norm(freedom.q))


def resistance(freedom: Freedom, w: np.ndarray) -> np.ndarray:
    """Return (viscous + c_1 |w| + ... + damping + coulomb / sqrt(|w|^2 + coulomb_rate^2)) w."""
    friction = freedom.friction
    smooth = friction.coulomb / np.sqrt(w @ w + friction.coulomb_rate**2)
    grown = sum(c * np.linalg.norm(w) ** n for n, c in enumerate(friction.smooth))
    return (grown + freedom.spring.damping + smooth) * w


def pseudo_inverse(A: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return A+ and an orthonormal basis N of A's null space, by singular values."""
    U, s, Vt = np.linalg.svd(A)
    rank = int(np.sum(s > DEPENDENT * max(s, default=0)))
    return Vt[:rank].T @ (U[:, :rank] / s[:rank]).T, Vt[rank:].T


def require_small(gap: np.ndarray, scale: np.ndarray, what: str) -> None:
    """Refuse a gap that is more than rounding."""
    worst = np.max(abs(gap), initial=0)
    if worst > 1e-7 * (1 + np.max(abs(scale), initial=0)):
        raise OracleError(f"{what} ({worst:.3g} remains)")


def law(gear: GearJoint) -> dict[str, Polynomial]:
    """Return the polynomials that a gear adds up, by coordinate."""
    return {
        label: Polynomial([0, ratio, *gear.powers.get(label, ())])
        for label, ratio in gear.ratios.items()
    }
