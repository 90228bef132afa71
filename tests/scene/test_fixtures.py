"""Parts of all robots of the catalogue: fixed in their bodies, stretched between the right points,
in every pose."""

import numpy as np
import pytest
from scipy.spatial import ConvexHull

from linkwork import Robot, robots
from linkwork.equations.algebra import rotation_matrix
from linkwork.mechanism import (
    GROUND,
    Body,
    Box,
    Capsule,
    Cylinder,
    Frame,
    Mechanism,
    Polygon,
    RevoluteJoint,
    Sphere,
)
from linkwork.scene.colours import LOOKS, rgb
from linkwork.scene.fixtures import Fixture, Stretch, fixtures_of
from linkwork.scene.layout import PartLayout, of_mesh, product, quaternions, turned_by
from linkwork.scene.meshes import piece_of
from linkwork.viewer.pursuit import Pursuit
from linkwork.viewer.stage import points_of

SOME = ("stewart", "prr3", "delta", "andrews", "bennett", "flyball_governor", "agile_wrist", "rpr3")


def elsewhere(robot: Robot):
    """Return another closed state, not far from home."""
    pursuit = Pursuit(robot, fixtures_of(robot).size)
    rates = np.random.default_rng(5).standard_normal(robot.mobility)
    w = robot.chart.tree_rates(robot.home.q, rates)
    out = pursuit.assembler.still(robot.home.q)
    return pursuit.at(
        pursuit.close(robot.home.q + out["derivatives"] @ (0.05 * w / np.abs(w).max()))
    )


def seen(part: Fixture, position, turn, scale) -> np.ndarray:
    """Return the vertices of a part where a placement puts it."""
    points = part.mesh.vertices * scale
    return position + turned_by(np.repeat(turn[None], len(points), axis=0), points)


@pytest.mark.parametrize("name", SOME)
def test_parts_move_with_their_bodies(name):
    robot = Robot(getattr(robots, name)())
    parts = fixtures_of(robot)
    state = elsewhere(robot)
    poses = {GROUND: (np.zeros(3), np.eye(3)), **robot.body_poses(state)}
    placement = PartLayout(robot, parts).place(state)
    for k, part in enumerate(parts.parts):
        vertices = seen(part, placement.positions[k], placement.turns[k], placement.scales[k])
        if isinstance(part.carrier, str):
            p, R = poses[part.carrier]
            own = part.position + (part.mesh.vertices * part.scale) @ part.turn.T
            assert vertices == pytest.approx(p + own @ R.T, abs=1e-12 * parts.size)
        else:
            start, end = (ends(parts.spans[part.carrier], which, poses) for which in (0, 1))
            along = (vertices - start) @ (end - start) / ((end - start) @ (end - start))
            assert along.min() == pytest.approx(0, abs=1e-12)
            assert along.max() == pytest.approx(part.scale[2], rel=1e-12)


def ends(span: Stretch, which: int, poses) -> np.ndarray:
    p, R = poses[span.bodies[which]]
    return p + R @ span.points[which]


def test_the_legs_of_a_hexapod_end_at_its_joints():
    robot = Robot(robots.stewart())
    state, parts = elsewhere(robot), fixtures_of(robot)
    poses = {GROUND: (np.zeros(3), np.eye(3)), **robot.body_poses(state)}
    lengths = [np.linalg.norm(ends(span, 1, poses) - ends(span, 0, poses)) for span in parts.spans]
    assert lengths == pytest.approx([float(state[name]) for name in robot.actuators], abs=1e-12)


@pytest.mark.parametrize("name", robots.__all__)
def test_every_robot_has_something_to_show(name):
    try:
        robot = Robot(getattr(robots, name)())
    except TypeError:
        pytest.skip(f"{name} needs arguments")
    parts = fixtures_of(robot)
    shown = {part.carrier for part in parts.parts}
    assert len(shown) > 1
    assert all(part.mesh.volume > 0 and (part.scale > 0).all() for part in parts.parts)


def test_groups_of_one_mesh_hold_each_chosen_part_once():
    parts = fixtures_of(Robot(robots.prr3())).parts
    chosen = np.arange(len(parts)) % 2 == 0
    groups = of_mesh(parts, chosen)
    assert sorted(np.concatenate(groups)) == list(np.flatnonzero(chosen))
    assert all(len({id(parts[k].mesh) for k in group}) == 1 for group in groups)


def test_quaternions_follow_rotation_matrices():
    from scipy.spatial.transform import Rotation

    A, B = Rotation.random(20, random_state=1), Rotation.random(20, random_state=2)
    p, q = quaternions(A.as_matrix()), quaternions(B.as_matrix())
    both, expected = product(p, q), quaternions((A * B).as_matrix())
    assert both * np.sign(both[:, :1]) == pytest.approx(expected)
    points = np.random.default_rng(3).standard_normal((20, 3))
    assert turned_by(p, points) == pytest.approx(A.apply(points))


def test_shapes_are_shown_instead_of_bars_and_enclose_what_pictures_show():
    shapes = [
        shape.model_copy(
            update={"frame": Frame(position=(0.3, -0.2, 0.5), rotation=(0.3, 0.7, -0.4))}
        )
        for shape in (
            Box(size=(0.1, 0.2, 0.4), colour=(1.0, 0.5, 0.0)),
            Cylinder(radius=0.2, length=0.5),
            Sphere(radius=0.3),
            Capsule(radius=0.1, length=0.7),
            Polygon(points=((0, 0), (0, 1), (2, 1)), thickness=0.1),
        )
    ]
    body = Body(mass=1.0, centre_of_mass=(0.5, 0.0, 0.0), shapes=shapes)
    joints = {"hinge": RevoluteJoint(connects=("ground", "arm"), axis=(1.0, 1.0, 0.0))}
    robot = Robot(Mechanism(bodies={"arm": body}, joints=joints))
    members = [part for part in fixtures_of(robot).parts if part.role == "member"]
    for part, shape in zip(members, shapes, strict=True):
        vertices = part.position + (part.mesh.vertices * part.scale) @ part.turn.T
        picture = (
            piece_of(shape)
            .moved(np.array(shape.frame.position), rotation_matrix(shape.frame.rotation))
            .corners
        )
        assert ConvexHull(vertices).volume == pytest.approx(ConvexHull(picture).volume, rel=0.03)
        assert vertices.min(axis=0) == pytest.approx(picture.min(axis=0), abs=0.01)
        assert vertices.max(axis=0) == pytest.approx(picture.max(axis=0), abs=0.01)
        assert part.mesh.volume > 0
    assert [rgb(part.colour) for part in members] == [(255, 128, 0)] + [
        rgb(LOOKS["member"].colour)
    ] * 4


def test_the_lowest_and_the_highest_point_are_those_of_what_is_shown():
    block = Box(size=(0.2, 0.2, 6.0), frame=Frame(position=(0.0, 0.0, 1.0)))
    plate = Polygon(points=((0, 0), (0.1, 0), (0, 0.1)), thickness=0.1)  # its mesh is not scaled
    body = Body(mass=1.0, shapes=(block, plate))
    robot = Robot(
        Mechanism(bodies={"arm": body}, joints={"hinge": RevoluteJoint(connects=("ground", "arm"))})
    )
    parts = fixtures_of(robot)
    found = points_of(parts.parts, PartLayout(robot, parts).place(robot.home))[:, 2]
    assert (found.min(), found.max()) == pytest.approx((-2.0, 4.0))
