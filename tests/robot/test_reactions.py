"""Joint reactions against Lagrange's multipliers, published ones, statics by hand, and Newton's
laws for the whole."""

from __future__ import annotations

from functools import cache, partial

import numpy as np
import pytest

import linkwork as lw

from tests.catalogue import built
from tests.equations.evaluation import close
from tests.oracle import andrews, pairs
from tests.oracle.random_joints import curved, random_loops, random_tree, tilted
from tests.products import first
from tests.robot.oracle_state import Seen

X, Y, Z = np.eye(3)


def moving(robot: lw.Robot, seed: int = 3, scale: float = 1.0) -> tuple[lw.State, np.ndarray]:
    """Return a state with random rates at home, and random actuator forces."""
    random = np.random.default_rng(seed)
    return robot.home.with_rates(scale * random.normal(size=robot.mobility)), random.normal(
        size=len(robot.actuators)
    )


def agrees(robot: lw.Robot, tolerance: float = 1e-9) -> lw.robot.reactions.Reactions:
    """Compare the constraint parts with the wrenches of the oracle's multipliers, of least norm in
    SI units."""
    state, forces = moving(robot)
    seen = Seen.of(robot, state)
    found, wanted = (
        robot.reactions(state, forces, length=1.0),
        seen.oracle.reactions(seen.poses, seen.twists, forces),
    )
    gears = {name: wanted.pop(name) for name in robot.mechanism.gears}
    assert found.joints == tuple(wanted)
    close(found.constraint, np.array([*wanted.values()]), tolerance)
    for name, multiplier in gears.items():
        close(found.gears[name], multiplier[0], tolerance)
    return found


@pytest.mark.parametrize(
    "name",
    first(4, ["prr3", "stewart", "pendulum", "spatial_slider_crank", "delta", "hexaglide"]),
)
def test_multipliers_of_the_catalogue(name):
    agrees(built(name))


@pytest.mark.parametrize("name", ["bricard", "bennett", "agile_wrist", "tripteron"])
def test_least_multipliers_where_constraints_depend_on_each_other(name):
    """The oracle takes the pseudo-inverse of all constraint rows: the least multipliers."""
    found = agrees(built(name))
    assert found.indeterminate


MIXED = {
    "tree": partial(random_tree, 4, 9, effects=True, gears=1),
    "planar loops": lambda: tilted(random_loops(4, 2, planar=True, effects=True), 4),
    "spatial loops": partial(random_loops, 5, 2, effects=True),
    "geared loop with a rod": lambda: curved(random_loops(6, 1, gears=1, rods=1, effects=True)),
    "platform on rods": partial(random_loops, 7, 1, platform="free"),
}


@cache
def mixed(case: str) -> lw.Robot:
    return lw.Robot(MIXED[case]())


@pytest.mark.sample(1)
@pytest.mark.parametrize("case", MIXED)
def test_all_joint_types_and_effects(case):
    """Trees and loops of all joint types with springs, friction, rotors, gears, rods and springs
    between points."""
    agrees(mixed(case), 1e-8)


def test_what_acts_along_a_joint_belongs_to_its_wrench():
    """A turn's moment about its axis is u - k (q - rest) - d w - J w'; the same force drives the
    body behind it."""
    spring, friction = lw.Spring(stiffness=3.0, rest=0.2, damping=0.1), lw.Friction(viscous=0.4)
    arm = lw.Body(mass=2.0, centre_of_mass=(0.5, 0, 0), inertia=lw.Inertia(zz=0.3))
    hinge = lw.RevoluteJoint(
        connects=("ground", "arm"), spring=spring, friction=friction, rotor_inertia=0.7
    )
    robot = lw.Robot(
        lw.Mechanism(
            bodies={"arm": arm},
            joints={"hinge": hinge},
            actuators=("hinge",),
            gravity=(0, -9.81, 0),
        )
    )
    q, w, u = 0.6, 1.5, 0.9
    state = robot.state([q], [w])
    (a,) = robot.forward_dynamics(state, [u])
    found = robot.reactions(state, [u])
    moment = u - 3.0 * (q - 0.2) - 0.5 * w - 0.7 * a
    e, n = np.array([np.cos(q), np.sin(q), 0]), np.array([-np.sin(q), np.cos(q), 0])
    force = 2.0 * (0.5 * a * n - 0.5 * w**2 * e + 9.81 * Y)
    close(found["hinge"], np.concatenate([moment * Z, force]), 1e-12)
    close(moment, (0.3 + 2.0 * 0.25) * a + 2.0 * 9.81 * 0.5 * np.cos(q), 1e-12)
    close(found.constraint[0], np.concatenate([0 * Z, force]), 1e-12)
    assert not found.indeterminate


def test_statics_of_a_four_bar_by_hand():
    """Held still, the three links' balances of forces and moments give the four pins and the
    torque: 9 equations."""
    robot = built("four_bar")
    state, described = robot.home, robot.mechanism
    torque = robot.inverse_dynamics(state, np.zeros(1))
    found, poses = robot.reactions(state, torque), robot.body_poses(state)
    pins = described.pairs
    A, b = (
        np.zeros((3 * len(described.bodies), 2 * len(pins) + 1)),
        np.zeros(3 * len(described.bodies)),
    )
    for i, (name, body) in enumerate(described.bodies.items()):
        p, R = poses[name]
        centre = p + R @ body.centre_of_mass
        b[3 * i : 3 * i + 2] = -body.mass * np.array(described.gravity)[:2]
        for k, joint in enumerate(pins.values()):
            if name in joint.connects:
                side, sign = joint.connects.index(name), 2 * joint.connects.index(name) - 1
                x, y, _ = p + R @ joint.frames[side].position - centre
                A[3 * i : 3 * i + 3, 2 * k : 2 * k + 2] = sign * np.array([[1, 0], [0, 1], [-y, x]])
                if described.actuators == (list(pins)[k],):
                    A[3 * i + 2, -1] = sign
    by_hand = np.linalg.solve(A, b)
    close(found.wrenches[:, 3:5], by_hand[:-1].reshape(-1, 2), 1e-10)
    close(torque, by_hand[-1:], 1e-10)
    across = ("moment_x", "moment_y", "force_z")
    assert found.indeterminate == {
        name: across for name in pins
    }  # a plane's loop does not tell what acts across it


PUBLISHED = {  # IVP test set: angles, rate of beta, multipliers at 0 and 0.03 s
    0.0: "-0.0617138900142764 0 0.455279819163070 0.222668390165886 0.487364979543843 "
    "-0.222668390165886 1.23054744454982 0 98.5668703962410896 -6.12268834425566265 0 0 0 0",
    0.03: "15.81077119629904 -15.75637105984298 0.04082224013073101 -0.5347301163226948 "
    "0.5244099658805304 0.5347301163226948 1.048080741042263 1139.920302151208 "
    "199.1753333731910 -29.75531228015052 23.06654119098399 31.45271365475927 "
    "22.64249232082739 11.61740700019673",
}


@pytest.mark.parametrize("time", PUBLISHED)
def test_published_multipliers_of_the_squeezer(time):
    """lambda are the forces of K2 on K3, K4 and K6 at the point P; printed to 1e-6."""
    robot = built("andrews")
    be, th, ga, ph, de, om, ep, rate, *multipliers = map(float, PUBLISHED[time].split())
    closing = [ga - be - th, ph + de - be - th, om + ep - be - th]
    state = robot.state([be, th, ga, ph, de, om, ep, *closing], {"beta": rate}, tolerance=1e-6)
    found = robot.reactions(state, [andrews.torque])
    forces = [found[name][3:5] for name in ("P_3", "P_4", "P_6")]
    close(np.ravel(forces), np.array(multipliers), 2e-6)


@pytest.mark.parametrize("name", ["prr3", "stewart"])
def test_what_ground_brings_changes_the_whole_momentum(name):
    """The wrenches from ground give the rates of momentum and of its moment about the origin,
    beside weight.

    The 3-PRR's run goes through poses where charts change.
    """
    robot = built(name)
    forces, duration = ([5.0, 0.0, 0.0], 1.0) if name == "prr3" else (np.ones(6), 0.1)
    run = robot.simulate(robot.home, forces, duration=duration, save_at=np.linspace(0, duration, 5))
    assert ("; from " in run.attrs["charts"]) == (name == "prr3")
    reactions, data = run.reactions(), run.dataset
    assert reactions.dims == ("time", "joint", "component")
    for i in range(len(data.time)):
        state = robot.state(
            data.joint_position[i].values,
            dict(data.joint_rate[i].to_series()[list(robot.independent)]),
        )
        close(
            reactions[i].values,
            robot.reactions(state, data.actuator_force[i].values).wrenches,
            1e-9,
        )
        seen = Seen.of(robot, state)
        accelerations = seen.oracle.accelerations(
            seen.poses, seen.twists, data.actuator_force[i].values
        )
        force, moment = np.zeros(3), np.zeros(3)
        for body, part in robot.mechanism.bodies.items():
            (p, R), (omega, _), (alpha, a) = (
                seen.poses[body],
                seen.twists[body],
                accelerations[body],
            )
            inertia, needed = (
                R @ part.inertia.tensor() @ R.T,
                part.mass * (a - robot.mechanism.gravity),
            )
            force += needed
            moment += np.cross(p + R @ part.centre_of_mass, needed)
            moment += inertia @ alpha + np.cross(omega, inertia @ omega)
        for joint, described in robot.mechanism.pairs.items():
            if "ground" in described.connects:
                sign = 1 if described.connects[0] == "ground" else -1
                body, R = robot.body_poses(state).get(
                    described.connects[0], (np.zeros(3), np.eye(3))
                )
                wrench = sign * reactions[i].sel(joint=joint).values
                force -= wrench[3:]
                moment -= wrench[:3] + np.cross(body + R @ described.frames[0].position, wrench[3:])
        scale = np.abs(reactions[i].values).max()
        assert max(np.abs(force).max(), np.abs(moment).max()) < 1e-9 * scale


def test_frames():
    """F1's axes and origin, F2's axes and origin, and the ground's hold the same wrench."""
    robot = mixed("spatial loops")
    state, forces = moving(robot)
    ground, first, second = (
        robot.reactions(state, forces, frame=frame) for frame in ("ground", "first", "second")
    )
    poses = robot.body_poses(state) | {"ground": (np.zeros(3), np.eye(3))}
    for name, joint in robot.mechanism.pairs.items():
        (p_1, R_1), (p_2, R_2) = (
            (
                poses[body][0] + poses[body][1] @ frame.position,
                poses[body][1] @ pairs.exponential(frame.rotation),
            )
            for body, frame in zip(joint.connects, joint.frames, strict=True)
        )
        close(ground[name], np.concatenate([R_1 @ first[name][:3], R_1 @ first[name][3:]]), 1e-10)
        moment, force = R_2 @ second[name][:3], R_2 @ second[name][3:]
        close(ground[name], np.concatenate([moment + np.cross(p_2 - p_1, force), force]), 1e-10)


def test_the_length_matters_only_where_reactions_are_open():
    """What is named as open depends on the length that moments are divided by; all else does
    not."""
    for name in ("bricard", "stewart", "four_bar"):
        robot = built(name)
        state, forces = moving(robot)
        short, long = (robot.reactions(state, forces, length=length) for length in (0.3, 3.0))
        assert short.indeterminate == long.indeterminate
        is_open = np.array(
            [[c in short.indeterminate.get(j, ()) for c in short.components] for j in short.joints]
        )
        close(short.wrenches[~is_open], long.wrenches[~is_open], 1e-9)
        assert (name == "stewart") == (not is_open.any())
    state, forces = moving(built("bricard"))
    short, long = (
        built("bricard").reactions(state, forces, length=length).wrenches for length in (0.3, 3.0)
    )
    assert np.abs(short - long).max() > 1e-3


def test_stacks_and_one_state_agree():
    robot = built("stewart")
    state, forces = moving(robot)
    rates = np.linspace(-1, 1, 12).reshape(2, 1, 6) * np.ones((2, 3, 6))
    stack = robot.state(np.broadcast_to(state.positions, (2, 3, state.positions.size)), rates)
    found = robot.reactions(stack, forces)
    assert found.wrenches.shape == (2, 3, len(robot.joints), 6)
    close(
        found.wrenches[1, 2], robot.reactions(state.with_rates(rates[1, 2]), forces).wrenches, 1e-10
    )


def test_refusals(tmp_path):
    robot = built("pendulum")
    forces = np.zeros(len(robot.actuators))
    with pytest.raises(
        lw.LinkworkError, match="frame is 'world'; give 'ground' or 'first' or 'second'"
    ):
        robot.reactions(robot.home, forces, frame="world")
    with pytest.raises(lw.LinkworkError, match="length is -1"):
        robot.reactions(robot.home, forces, length=-1)
    with pytest.raises(lw.LinkworkError, match="there is no joint between two bodies 'gear'"):
        robot.reactions(robot.home, forces)["gear"]
    run = robot.simulate(robot.home, duration=0.1)
    loaded = lw.Run.load(run.save(tmp_path / "run.nc"))
    with pytest.raises(lw.LinkworkError, match="a run from a file does not hold its robot"):
        loaded.reactions()


def test_free_numbers():
    """Reactions with free numbers are those of the robot described with these values; nothing is
    compiled anew."""
    inertia = lw.Inertia(xx=0.1, yy=0.2, zz=0.25)
    joints = {
        "thread": lw.ScrewJoint(
            connects=("ground", "nut"), pitch=0.1, friction=lw.Friction(viscous=0.2)
        ),
        "hinge": lw.RevoluteJoint(
            connects=("nut", "arm"),
            axis=(1, 0, 0),
            frames=(lw.Frame(position=(0.2, 0.1, 0)), lw.Frame()),
        ),
    }
    bodies = {
        name: lw.Body(mass=1.5, centre_of_mass=(0.1, 0.3, 0.2), inertia=inertia)
        for name in ("nut", "arm")
    }
    robot = lw.Robot(lw.Mechanism(bodies=bodies, joints=joints, actuators=("thread", "hinge")))
    values = {
        "thread.pitch": 0.3,
        "thread.friction.viscous": 0.5,
        "arm.mass": 2.5,
        "arm.com.y": 0.4,
        "gravity.x": 3.0,
    }
    values |= {"arm.inertia.xx": 0.15, "hinge.frames.0.position.x": 0.5}
    free = robot.free(*values)
    for given in (values, {path: 1.01 * value for path, value in values.items()}):
        other = free.with_parameters(given)
        found = other.reactions(other.state([0.4, 0.7], [1.0, -2.0]), [0.3, 0.2])
        plain = lw.Robot(other.mechanism)
        wanted = plain.reactions(plain.state([0.4, 0.7], [1.0, -2.0]), [0.3, 0.2])
        close(found.wrenches, wanted.wrenches, 1e-11)
        close(found.constraint, wanted.constraint, 1e-11)
    assert (
        np.abs(
            found.wrenches
            - robot.reactions(robot.state([0.4, 0.7], [1.0, -2.0]), [0.3, 0.2]).wrenches
        ).max()
        > 1
    )


@pytest.mark.parametrize("times", [1e-5, 1e5])
def test_lengths_that_drown_forces_or_moments_are_refused(times):
    robot = built("prr3")
    forces = np.array([1.0, 2.0, 3.0])
    own = robot.reactions(robot.home, forces)
    near = robot.reactions(robot.home, forces, length=own.length * times**0.75)
    np.testing.assert_allclose(near.wrenches, own.wrenches, atol=1e-7)
    with pytest.raises(lw.LinkworkError, match="m; give one within"):
        robot.reactions(robot.home, forces, length=own.length * times)
