"""The derived equations against maximal coordinates with multipliers, on random mechanisms of all
joint types and effects."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import partial

import casadi as ca
import numpy as np
import pytest

from linkwork.equations import Equations, derive, functions
from linkwork.equations.algebra import SX
from linkwork.mechanism import GROUND, Mechanism

from tests.equations.evaluation import close, values
from tests.oracle.maximal import MaximalOracle, Poses, Twists
from tests.oracle.random_joints import curved, grown, random_loops, random_tree, tilted

CASES = {
    "tree": partial(random_tree, 1, 9, effects=True, gears=1, actuation=-2),
    "large tree": partial(random_tree, 6, 12, effects=True, actuation=-2),
    "planar tree": partial(random_tree, 2, planar=True, effects=True, gears=1),
    "loops": partial(random_loops, 3, 2),
    "loops with everything": lambda: curved(
        random_loops(5, 2, effects=True, rods=1, gears=1, freedoms=2, actuation=1)
    ),
    "loop of a screw": partial(
        random_loops, 7, 1, kinds=("screw", "universal", "revolute", "spherical"), effects=True
    ),
    "loop closed by a free joint": partial(random_loops, 8, 1, effects=True, platform="free"),
    "platform on rods": partial(random_loops, 0, 1, effects=True, platform="bare"),
    "planar loops": partial(
        random_loops, 5, 2, planar=True, effects=True, rods=1, gears=1, actuation=-1
    ),
    "springs and friction that grow": lambda: grown(random_tree(1, 9, effects=True, actuation=-2)),
    "planar loops, tilted": lambda: tilted(
        random_loops(3, 2, planar=True, effects=True, rods=1), 3
    ),
}


@dataclass(frozen=True)
class Sample:
    """Hold a closed state of a mechanism, as the equations have it and as the oracle has it, and
    actuator forces."""

    mechanism: Mechanism
    equations: Equations
    q: np.ndarray
    v: np.ndarray
    u: np.ndarray
    oracle: MaximalOracle
    poses: Poses
    twists: Twists
    made: dict[str, ca.Function] = field(default_factory=dict)

    @classmethod
    def of(cls, mechanism: Mechanism, seed: int) -> Sample:
        """Move a mechanism from its reference, by its independent rates, and give it random rates
        and forces."""
        rng, equations = np.random.default_rng(seed), derive(mechanism)
        v, u = rng.normal(size=equations.mobility), rng.normal(size=len(mechanism.actuators))
        q = displaced(equations, rng.uniform(-0.3, 0.3, v.size))
        bodies = values(functions.bodies_motion(equations), q, v)
        p, R = bodies["origins"].reshape(-1, 3), bodies["orientations"].reshape(-1, 3, 3)
        t = bodies["twists"].reshape(-1, 2, 3)
        shown = values(functions.joints_motion(equations), q, v, 0 * v)["positions"]
        oracle = MaximalOracle(mechanism, dict(zip(mechanism.coordinates, shown, strict=True)))
        poses = {name: (p[i], R[i]) for i, name in enumerate(mechanism.bodies)}
        twists = {name: (t[i, 0], t[i, 1]) for i, name in enumerate(mechanism.bodies)}
        return cls(mechanism, equations, q, v, u, oracle, poses, twists)

    def values(self, name: str, *more: np.ndarray) -> dict[str, np.ndarray]:
        """Evaluate a derived function at this state."""
        if name not in self.made:
            self.made[name] = getattr(functions, name)(self.equations)
        function = self.made[name]
        return values(
            function,
            *[(self.q, self.v)[: function.n_in() - 1], (self.q, self.v, *more)][bool(more)],
        )

    def maps(self) -> tuple[np.ndarray, np.ndarray]:
        """Return L (m x n) and T (6r x n)."""
        maps, n = self.values("maps"), self.v.size
        return maps["L"].reshape(-1, n), maps["T"].reshape(-1, n)


def displaced(equations: Equations, step: np.ndarray) -> np.ndarray:
    """Return q after a step of the independent rates from the reference, the loops closed; a step
    that is too far is halved."""
    q, close_up = equations.reference, functions.closure_step(equations)
    q = (
        q
        + values(
            functions.motion(equations), q, step, np.zeros(len(equations.mechanism.actuators))
        )["derivatives"]
    )
    for _ in range(8):
        after = values(close_up, q)
        if after["residual"][0] < 1e-13:
            return q
        q = after["q_next"]
    return displaced(equations, step / 2)


@pytest.fixture(params=CASES, scope="module")
def sample(request):
    return Sample.of(CASES[request.param](), 1)


@pytest.mark.sample(4)
def test_the_state_is_closed_and_its_rates_belong_to_it(sample):
    residuals = sample.oracle.residuals(sample.poses)
    assert max(np.abs(residual).max(initial=0) for residual in residuals.values()) < 1e-12
    assert sample.oracle.constraint_velocity_error(sample.poses, sample.twists) < 1e-12
    assert sample.equations.mobility == sample.oracle.mobility(sample.poses)


def test_coordinates_and_rates_of_all_joints(sample):
    motion = sample.values("joints_motion", 0 * sample.v)
    close(motion["positions"], sample.oracle.coordinates(sample.poses), 1e-12)
    close(motion["rates"], sample.oracle.rates(sample.poses, sample.twists), 1e-12)


def test_accelerations_under_actuator_forces(sample):
    v_dot = sample.values("motion", sample.u)["accelerations"]
    found = sample.values("joints_motion", v_dot)["accelerations"]
    accelerations = sample.oracle.accelerations(sample.poses, sample.twists, sample.u)
    close(
        found, sample.oracle.joint_accelerations(sample.poses, sample.twists, accelerations), 1e-10
    )


@pytest.mark.sample(5)
def test_inverse_after_forward_dynamics(sample):
    """M v' + C v + G - f = S' u, whether there are as many actuators as freedoms or not."""
    v_dot = sample.values("motion", sample.u)["accelerations"]
    S = sample.values("actuation")["S"].reshape(-1, sample.v.size)
    forces = sample.values("inverse_dynamics", v_dot)["forces"]
    close(forces, S.T @ sample.u, 1e-9)
    terms = sample.values("terms")
    close(terms["M"] @ v_dot + terms["Cv"] + terms["G"] - terms["f"], forces, 1e-9)
    actuated = [sample.mechanism.rates.index(name) for name in sample.mechanism.actuators]
    close(S, sample.maps()[0][actuated], 1e-12)


@pytest.mark.sample(4)
def test_energy_and_inertia(sample):
    """T = v' M v / 2, and with it M itself: M_ij from the energies of unit rates, one and two at a
    time."""
    energy = sample.values("energy")
    close(
        [energy["kinetic"][0], energy["potential"][0]],
        sample.oracle.energy(sample.poses, sample.twists),
        1e-10,
    )
    M, n = sample.values("terms")["M"], sample.v.size
    close(sample.v @ M @ sample.v / 2, energy["kinetic"][0], 1e-12)
    _, T = sample.maps()

    def kinetic(v):
        return sample.oracle.energy(sample.poses, sample.oracle.by_body(T @ v))[0]

    unit = np.eye(n)
    single = np.array([kinetic(e) for e in unit])
    for i in range(min(n, 4)):
        expected = [kinetic(unit[i] + unit[j]) - single[i] - single[j] for j in range(n)]
        close(M.reshape(n, n)[i], expected, 1e-10)


def test_power_balance(sample):
    """Along the motion dE/dt = u . S v less what friction and dampers take."""
    equations = sample.equations
    dq, dv = SX.sym("dq", equations.nq), SX.sym("dv", equations.mobility)
    kinetic, potential, _ = functions.energy(equations)(equations.tree.q, equations.v, equations.p)
    state, along = ca.vertcat(equations.tree.q, equations.v), ca.vertcat(dq, dv)
    slope = ca.Function("slope", [state, along], [ca.jtimes(kinetic + potential, state, along)])
    motion = sample.values("motion", sample.u)
    found = slope(
        np.append(sample.q, sample.v), np.append(motion["derivatives"], motion["accelerations"])
    )
    expected = sample.oracle.power(sample.poses, sample.twists, sample.u)
    close(float(found), expected, 1e-9)


def test_the_orthogonal_complement_annihilates_constraint_wrenches(sample):
    """T' A' lambda = 0 for any multipliers, and for the reactions that the oracle finds in the
    joints."""
    _, T = sample.maps()
    A = sample.oracle.rows(sample.poses, sample.twists).A
    assert np.abs(A @ T).max(initial=0) < 1e-11
    if sample.mechanism.gears:
        return
    wrenches = {name: np.zeros(6) for name in sample.mechanism.bodies}
    reactions = sample.oracle.reactions(sample.poses, sample.twists, sample.u)
    for name, joint in sample.mechanism.pairs.items():
        p, R = (sample.poses | {GROUND: (np.zeros(3), np.eye(3))})[joint.connects[0]]
        origin, (moment, force) = p + R @ joint.frames[0].position, reactions[name].reshape(2, 3)
        for body, sign in zip(joint.connects, (-1, 1), strict=True):
            if body != GROUND:
                p, R = sample.poses[body]
                centre = p + R @ sample.mechanism.bodies[body].centre_of_mass
                wrenches[body] += sign * np.append(moment + np.cross(origin - centre, force), force)
    stacked = np.concatenate(list(wrenches.values()))
    assert np.abs(stacked).max() > 1
    assert np.abs(T.T @ stacked).max() < 1e-10 * np.abs(stacked).max()
