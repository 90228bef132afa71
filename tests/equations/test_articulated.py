"""Accelerations by articulated inertias: those of the tree's generalised inertia and of Pinocchio,
at a cost that grows as the tree does; motions that move no mass stay refused."""

from __future__ import annotations

import numpy as np
import pytest

import linkwork as lw
from linkwork.equations import articulated, derive, functions
from linkwork.lab.engines.pinocchio import PinocchioEngine

from tests.equations.evaluation import close, values
from tests.oracle.hinges import hinges
from tests.oracle.random_joints import random_tree

KINDS = {  # how many bodies, and their joints over and over
    "all kinds": (10,),
    "hinges": (22, "revolute"),
    "free bodies": (8, "free", "revolute", "spherical", "revolute"),
    "in the plane": (24, "revolute", "revolute", "prismatic"),
}


@pytest.mark.sample(2)
@pytest.mark.parametrize("kind", KINDS)
def test_inverse_dynamics_gives_the_forces_back(kind):
    """The inverse dynamics knows neither M nor articulated inertias."""
    bodies, planar = KINDS[kind][0], kind == "in the plane"
    kinds = KINDS[kind][1:]
    mechanism = random_tree(11, bodies, planar=planar, kinds=kinds, effects=True, actuation=-2)
    equations, rng = derive(mechanism), np.random.default_rng(1)
    assert equations.recursive
    q, u = equations.reference, rng.normal(size=len(mechanism.actuators))
    v = rng.normal(size=equations.mobility)
    q = q + 0.2 * values(functions.motion(equations), q, v, u)["derivatives"]
    for places, _ in equations.tree.quaternions:
        q[list(places)] /= np.linalg.norm(q[list(places)])
    found = values(functions.motion(equations), q, v, u)["accelerations"]
    forces = values(functions.inverse_dynamics(equations), q, v, found)["forces"]
    S = values(functions.actuation(equations), q)["S"].reshape(u.size, v.size)
    close(forces, S.T @ u, 1e-10)
    terms = values(functions.terms(equations), q, v)
    right = S.T @ u - terms["Cv"] - terms["G"] + terms["f"]
    M = terms["M"].reshape(v.size, v.size)
    close(found, np.linalg.solve(M, right), 1e-14 * np.linalg.cond(M))


@pytest.mark.parametrize("limbs", [1, 4])
def test_hinges_accelerate_as_in_pinocchio(limbs):
    mechanism = hinges(24, limbs)
    equations, rng = derive(mechanism), np.random.default_rng(limbs)
    q, v, u = rng.normal(size=(3, 24))
    names = list(mechanism.rates)
    assert equations.recursive and list(equations.independent) == names
    found = values(functions.motion(equations), q, v, u)["accelerations"]
    expected = PinocchioEngine(mechanism).joint_accelerations(q, v, u)
    close(found, expected, 1e-10)


def test_small_trees_and_loops_keep_the_generalised_inertia():
    assert not derive(hinges(8)).recursive
    assert not derive(lw.robots.n_four_bar(20)).recursive
    assert not derive(lw.robots.stewart()).recursive


def test_the_cost_grows_as_the_tree_does():
    counts = [functions.motion(derive(hinges(N, 2))).n_instructions() for N in (15, 20, 30)]
    assert counts[2] - counts[1] < 2.1 * (counts[1] - counts[0])


def test_no_motion_has_more_inertia_than_its_bound():
    mechanism = random_tree(2, 9)
    equations, rng = derive(mechanism), np.random.default_rng(0)
    tree = equations.tree
    bounds = tree.evaluated("bounds", [articulated.largest(mechanism, tree)])
    for _ in range(5):
        q = rng.normal(size=equations.nq)
        for places, _ in tree.quaternions:
            q[list(places)] /= np.linalg.norm(q[list(places)])
        M = values(functions.terms(equations), q, np.zeros(equations.mobility))["M"]
        own = np.array(bounds(q)[0]).ravel()[list(equations.chart.independent)]
        assert (np.diag(M.reshape(len(own), -1)) <= own * (1 + 1e-12)).all()


@pytest.mark.sample(3)
@pytest.mark.parametrize("apart", [(0.0,), (1e-17,), (1e-9,), (1e-9, 1e-9, 1e-9, 1e-9)])
def test_motions_that_move_no_mass_are_refused_in_large_trees_too(apart):
    """Hinges on nearly one axis with bodies without mass between, beside a chain of twelve."""
    mechanism, last = hinges(12), "ground"
    bodies, joints = dict(mechanism.bodies), dict(mechanism.joints)
    for k, x in enumerate((0.0, *apart)):
        body = f"link_{k}"
        bodies[body] = bodies["body_0"] if k == len(apart) else lw.Body(mass=0.0)
        joints[f"extra_{k}"] = lw.RevoluteJoint(
            connects=(last, body), frames=(lw.Frame(position=(x, 0, 0)), lw.Frame())
        )
        last = body
    robot = lw.Robot(lw.Mechanism(bodies=bodies, joints=joints, actuators=("hinge_0",)))
    assert robot.equations.recursive
    state = robot.state(np.linspace(0.1, 0.9, robot.mobility))
    with pytest.raises(lw.LinkworkError, match="generalised inertia is singular"):
        robot.forward_dynamics(state, [0.0])


def test_a_gimbal_of_massless_rings_is_refused_where_it_locks_only():
    """Three turns about z, x, z on one point: at x = 0 the first and the last are one."""
    mechanism = hinges(12)
    bodies, joints, last = dict(mechanism.bodies), dict(mechanism.joints), "ground"
    for k, rotation in enumerate(((0, 0, 0), (0, np.pi / 2, 0), (0, -np.pi / 2, 0))):
        body = f"ring_{k}"
        bodies[body] = bodies["body_0"] if k == 2 else lw.Body(mass=0.0)
        joints[f"turn_{k}"] = lw.RevoluteJoint(
            connects=(last, body), frames=(lw.Frame(rotation=rotation), lw.Frame())
        )
        last = body
    robot = lw.Robot(lw.Mechanism(bodies=bodies, joints=joints, actuators=("hinge_0",)))
    assert robot.equations.recursive
    free = {f"turn_{k}": x for k, x in enumerate((0.3, 0.7, 0.2))}
    hinged = {f"hinge_{k}": 0.1 * k for k in range(12)}
    assert np.isfinite(robot.forward_dynamics(robot.state(hinged | free), [0.0])).all()
    with pytest.raises(lw.LinkworkError, match="generalised inertia is singular"):
        robot.forward_dynamics(robot.state(hinged | free | {"turn_1": 0.0}), [0.0])


def test_a_body_without_mass_at_the_end_is_refused_by_the_name_of_its_hinge():
    mechanism = hinges(12)
    bodies = mechanism.bodies | {"none": lw.Body(mass=0.0)}
    slack = lw.RevoluteJoint(connects=("body_11", "none"), frames=(lw.Frame(), lw.Frame()))
    joints = mechanism.joints | {"slack": slack}
    robot = lw.Robot(lw.Mechanism(bodies=bodies, joints=joints, actuators=("hinge_0",)))
    assert robot.equations.recursive
    with pytest.raises(lw.LinkworkError, match=r"rounding hides it \(that of slack\)"):
        robot.forward_dynamics(robot.home, [0.0])


@pytest.mark.parametrize("yaw", [0.0, 4e-6, 1e-2])
def test_a_point_on_a_neck_is_refused_where_rounding_hides_what_it_moves(yaw):
    """Pitch and, 1 cm away, roll and yaw of a point mass: at yaw zero a roll and a yaw together
    turn about the line to the point. Near it the pivot of the roll is told, which leads the pitch
    so far that its own is rounding; further away the generalised inertia tells all."""
    mechanism = hinges(12)
    bodies, joints, last = dict(mechanism.bodies), dict(mechanism.joints), "ground"
    point = lw.Body(mass=1.3, centre_of_mass=(0, -0.02, -0.11))
    turns = {"pitch": (0, 0, 0), "roll": (0, np.pi / 2, 0), "yaw": (-np.pi / 2, 0, 0)}
    for name, rotation in turns.items():
        bodies[f"of_{name}"] = point if name == "yaw" else lw.Body(mass=0.1)
        offset = (0.0095 * (name == "roll"), 0, 0)
        frames = (lw.Frame(position=offset, rotation=rotation), lw.Frame())
        joints[name] = lw.RevoluteJoint(connects=(last, f"of_{name}"), frames=frames)
        last = f"of_{name}"
    robot = lw.Robot(lw.Mechanism(bodies=bodies, joints=joints, actuators=("hinge_0",)))
    assert robot.equations.recursive
    neck = {"pitch": 0.0, "roll": 0.0, "yaw": yaw}
    state = robot.state({f"hinge_{k}": 0.1 * k for k in range(12)} | neck)
    if yaw < 1e-5:
        with pytest.raises(lw.LinkworkError, match=r"rounding hides it \(that of roll, yaw\)"):
            robot.forward_dynamics(state, [0.0])
        return
    M = robot.mass_matrix(state)
    forces = robot.passive_forces(state) - robot.coriolis(state) - robot.gravity(state)
    own = np.sqrt(np.diag(M))
    scaled = M / own / own[:, None]
    expected = np.linalg.solve(scaled, forces / own) / own
    found = robot.forward_dynamics(state, [0.0])
    close(found, expected, 1e-14 * np.linalg.cond(scaled))
