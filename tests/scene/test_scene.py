"""The list of what is drawn: symbols follow from motions, painters show the same, poses only move
what is there."""

import importlib
from math import pi

import numpy as np
import pytest

import linkwork as lw
from linkwork.equations.joints import KINDS, Kind, Row
from linkwork.equations.joints.kind import ElementaryMotion, slide, turn
from linkwork.mechanism import Box
from linkwork.mechanism.shapes import Outline, SimpleShape
from linkwork.scene.colours import DRIVEN, LOOKS, WHITE, rgb
from linkwork.scene.fixtures import fixtures_of
from linkwork.scene.meshes import BALL, BLOCK, PIN, PlacedMesh, piece_of
from linkwork.scene.parts import Bar, Hull, moved
from linkwork.scene.scene import scene_of
from linkwork.viewer.session import Session
from linkwork.views import plot_mechanism
from linkwork.views.film import film
from linkwork.views.motion import run_states
from linkwork.views.run_report import render

X, Y, Z = np.eye(3)
SYMBOLS = {  # what moves: the meshes that show it, and along or about what their own z is
    "turn": ((turn(X),), [(PIN, X)]),
    "slide": ((slide(Y),), [(BLOCK, Y)]),
    "turn and slide on one axis": ((turn(Z), slide(Z)), [(PIN, Z)]),
    "pin in a slot": ((slide(X), turn(Z)), [(BLOCK, X), (PIN, Z)]),
    "two turns": ((turn(X), turn(Y)), [(PIN, X), (PIN, Y)]),
    "free turn": ((ElementaryMotion(ball=True),), [(BALL, Z)]),
    "ball on a rail": ((slide(X), ElementaryMotion(ball=True)), [(BLOCK, X), (BALL, Z)]),
    "ball on a plane": ((slide(X), slide(Y), ElementaryMotion(ball=True)), [(BLOCK, Z), (BALL, Z)]),
    "plane": ((slide(X), slide(Y), turn(Z)), [(BLOCK, Z)]),
    "two slides": ((slide(Y), slide(Z)), [(BLOCK, X)]),
    "weld": ((), [(BLOCK, Z)]),
}


@pytest.fixture(scope="module")
def stone():
    """Return a body on a ball joint above the ground, at home where its two frames agree."""
    body = lw.Body(mass=1.0, centre_of_mass=(0, 0, 1), inertia=lw.Inertia(xx=0.1, yy=0.1, zz=0.1))
    joints = {
        "mount": lw.SphericalJoint(
            connects=("ground", "stone"), frames=(lw.Frame(position=(0, 0, 1)), lw.Frame())
        )
    }
    return lw.Robot(lw.Mechanism(bodies={"stone": body}, joints=joints))


@pytest.mark.sample(6)
@pytest.mark.parametrize("name", SYMBOLS)
def test_a_kind_of_joint_of_its_own_is_drawn_everywhere_by_its_motions(name, stone, monkeypatch):
    motions, expected = SYMBOLS[name]
    monkeypatch.setitem(
        KINDS, "spherical", Kind(lambda joint: motions, lambda joint, preferred: (Row("any", X),))
    )
    parts = [part for part in scene_of(stone, stone.home, stone.home).parts if part.role == "joint"]
    assert [part.form.mesh for part in parts] == [mesh for mesh, _ in expected]
    for part, (_, axis) in zip(parts, expected, strict=True):
        np.testing.assert_allclose(part.form.position, (0, 0, 1))
        assert abs(part.form.turn[:, 2] @ axis) == pytest.approx(1)
    axes = plot_mechanism(stone, stone.home)
    assert [artist.get_gid() for artist in axes.get_children() if artist.get_gid()] == ["mount"]
    states = stone.make_state(np.stack([stone.home.q] * 2), np.zeros((2, stone.mobility)))
    drawn = film(stone, np.array([0.0, 1.0]), states)
    assert sum(stroke.kind in ("box", "dot") for stroke in drawn.parts) == len(expected)
    assert [part.mesh for part in fixtures_of(stone).parts if part.role == "joint"] == [
        mesh for mesh, _ in expected
    ]


@pytest.mark.parametrize("name", ["prr3", "stewart", "flyball_governor"])
def test_plots_films_and_the_viewer_show_every_part_in_its_colour(name):
    robot = lw.Robot(getattr(lw.robots, name)())
    states = robot.make_state(np.stack([robot.home.q] * 2), np.zeros((2, robot.mobility)))
    parts = [
        part for part in scene_of(robot, robot.home, robot.home).parts if not part.look.grounded
    ]
    colours = {
        role: {rgb(part.colour) for part in parts if part.role == role}
        for role in {part.role for part in parts}
    }
    viewer = fixtures_of(robot).parts
    for role in colours:
        assert {rgb(part.colour) for part in viewer if part.role == role} >= colours[role], role
    strokes = film(robot, np.array([0.0, 1.0]), states).parts
    assert {rgb(stroke.colour) for stroke in strokes} == set.union(*colours.values())
    assert {rgb(part.colour) for part in parts if part.role in ("joint", "tube")} >= {rgb(DRIVEN)}
    assert LOOKS["joint"].colour == WHITE


def test_poses_move_the_parts_and_the_joints_of_the_moved_parts_meet():
    """In each pose the parts are those that are made there anew, for the platform is rigid and its
    legs end on it."""
    robot = lw.Robot(lw.robots.rpr3())
    there = robot.assemble(tool=[0.52, 0.31, 0.3])
    both = robot.make_state(np.stack([robot.home.q, there.q]), np.zeros((2, robot.mobility)))
    scene, anew = scene_of(robot, robot.home, both), scene_of(robot, there, both)
    assert scene.size == pytest.approx(anew.size)
    for part, other in zip(scene.parts, anew.parts, strict=True):
        if isinstance(part.form, Bar | Hull) and not part.look.grounded:
            form = part.at(scene.moves_to(1)).form
            assert isinstance(form, Bar | Hull)
            np.testing.assert_allclose(
                np.sort(form.points, axis=0), np.sort(other.form.points, axis=0), atol=1e-9
            )  # pyright: ignore
    last = scene.parts[-1]
    stack = moved(last.form.points, last.bodies, scene.moves)  # pyright: ignore
    np.testing.assert_allclose(stack[0], scene.parts[-1].form.points, atol=1e-12)  # pyright: ignore


def test_the_second_axis_of_a_universal_joint_turns_with_the_first_angle():
    body = lw.Body(mass=1.0, centre_of_mass=(0, 0, 1), inertia=lw.Inertia(xx=0.1, yy=0.1, zz=0.1))
    robot = lw.Robot(
        lw.Mechanism(
            bodies={"arm": body}, joints={"cross": lw.UniversalJoint(connects=("ground", "arm"))}
        )
    )
    state = robot.state({"cross.angle_1": 0.4, "cross.angle_2": 0.7})
    first, second = (part for part in scene_of(robot, state, state).parts if part.role == "joint")
    assert (first.bodies, second.bodies) == (("ground",), ("arm",))
    np.testing.assert_allclose(first.form.turn[:, 2], X, atol=1e-12)  # pyright: ignore
    axis = second.form.turn[:, 2]  # pyright: ignore
    np.testing.assert_allclose(axis, (0, np.cos(0.4), np.sin(0.4)), atol=1e-12)


@pytest.mark.parametrize("connects", [("ground", "cart"), ("cart", "ground")])
def test_in_the_viewer_rails_reach_as_far_as_the_limits_let_the_slider_go(connects):
    cart = lw.Body(mass=1.0, inertia=lw.Inertia(xx=0.1, yy=0.1, zz=0.1))
    limits = lw.Limits(lower=-0.5, upper=2.0)
    drive = lw.PrismaticJoint(connects=connects, axis=(0.6, 0.8, 0), limits=limits)
    tool = lw.Tool(body="cart", frame=lw.Frame(position=(0, 0, 1)))
    robot = lw.Robot(
        lw.Mechanism(bodies={"cart": cart}, joints={"drive": drive}, tools={"top": tool})
    )
    places = [
        robot.body_poses(robot.state({"drive": q}))["cart"][0] for q in (limits.lower, limits.upper)
    ]
    scene = scene_of(robot, robot.home)
    (rail,) = (part.form for part in scene.parts if part.role == "rail")
    (slider,) = (part.form for part in scene.parts if part.role == "joint")
    along = np.array([0.6, 0.8, 0])
    assert isinstance(rail, Bar) and isinstance(slider, PlacedMesh)
    beyond = slider.scale[2] / 2
    ends, reached = np.sort(rail.points @ along), np.sort(np.array(places) @ along)
    assert ends == pytest.approx(reached + np.array([-beyond, beyond]))


def test_a_film_in_which_the_mechanism_grows_shows_the_same_parts_throughout():
    """A small pendulum beside a slider that drives away: next to all of it, the pendulum's mass is
    no more seen apart."""
    ball = lw.Body(mass=1.0, centre_of_mass=(1.0, 0, 0))
    cart = lw.Body(mass=1.0, centre_of_mass=(0.1, 0, 0), inertia=lw.Inertia(zz=0.1))
    joints = {
        "hinge": lw.RevoluteJoint(connects=("ground", "ball")),
        "drive": lw.PrismaticJoint(connects=("ground", "cart"), axis=(1.0, 0, 0)),
    }
    robot = lw.Robot(lw.Mechanism(bodies={"ball": ball, "cart": cart}, joints=joints))
    states = robot.state({"hinge": np.zeros(3), "drive": np.array([2.0, 5.0, 40.0])})
    found = film(robot, np.arange(3.0), states)
    assert len(found.points) == 3
    rails = [stroke for stroke in found.fixed if np.ptp(stroke.points[:, 0]) > 30]
    assert len(rails) == 1 and rails[0].points[:, 0].max() > 40


@pytest.mark.long
def test_a_body_that_flies_alone_is_seen_in_pictures_reports_and_the_viewer():
    body = lw.Body(mass=1.0, centre_of_mass=(0, 0, 0.5), inertia=lw.Inertia(xx=0.1, yy=0.1, zz=0.1))
    joints = {"flight": lw.FreeJoint(connects=("ground", "stone"))}
    robot = lw.Robot(lw.Mechanism(bodies={"stone": body}, joints=joints, gravity=(0, 0, -9.81)))
    run = robot.simulate(robot.home, duration=0.1, save_at=np.linspace(0, 0.1, 3))
    made = film(robot, run.coords["time"].values, run_states(robot, run))
    (dot,) = made.parts
    heights = made.drawn(dot)[:, 0, 2]
    assert heights == pytest.approx(0.5 - 9.81 / 2 * run.coords["time"].values ** 2, abs=1e-9)
    assert "<canvas" in render(robot, run)
    assert any(line.get_marker() == "o" for line in plot_mechanism(robot, robot.home).lines)
    assert Session(robot).view().placement.positions == pytest.approx(np.array([(0, 0, 0.5)]))


def test_a_shape_of_its_own_is_a_piece_by_its_outline():
    class Cone(SimpleShape):
        radius: float
        height: float

        @property
        def outline(self):
            return Outline(
                ((1.0, 0.0), (0.0, 1.0)), (self.radius, self.radius, self.height), turned=True
            )

    cone = piece_of(Cone(type="cone", radius=0.3, height=2.0))  # pyright: ignore
    assert cone.mesh.volume * cone.scale.prod() == pytest.approx(pi * 0.3**2 * 2.0 / 3, rel=0.02)
    assert cone.corners[:, 2].max() == 2.0 and len(cone.mesh.flat) == 1
    assert piece_of(Box(size=(1.0, 2.0, 3.0))).mesh is BLOCK


def test_the_viewers_former_name_still_leads_to_it_and_says_so():
    from linkwork import viewer

    with pytest.warns(DeprecationWarning, match=r"linkwork.views.viewer is linkwork.viewer now"):
        from linkwork.views.viewer import View, Viewer
    assert Viewer is viewer.Viewer and View is viewer.View
    with pytest.warns(DeprecationWarning):
        former = importlib.import_module("linkwork.views.viewer.session")
    assert former.Session.__name__ == Session.__name__


def test_cables_are_drawn_straight_from_point_to_point_and_not_where_they_go_round_a_surface():
    point, tip = {"type": "point", "body": "ground"}, {"type": "point", "body": "beam"}
    path = [
        point | {"point": (1, 2, 0)},
        tip | {"point": (1, 0, 0)},
        {"type": "cylinder", "body": "ground", "radius": 0.1},
        point | {"point": (0, 1, 0)},
        tip | {"point": (0.5, 0, 0)},
        {"type": "pulley", "divisor": 2},
        point | {"point": (3, 1, 0)},
        tip | {"point": (1, 0, 0)},
    ]
    cable = {"type": "cable", "path": path}
    beam = lw.Body(mass=1.0, inertia=lw.Inertia(zz=0.1))
    hinge = lw.RevoluteJoint(connects=("ground", "beam"))
    robot = lw.Robot(
        lw.Mechanism(
            bodies={"beam": beam},
            joints={"hinge": hinge},
            transmissions={"rope": cable},
            actuators=("rope",),
            gravity=(0, 0, 0),
        )
    )
    turned = robot.state([0.3])
    scene = scene_of(robot, robot.home, turned)
    drawn = [part.at(scene.moves_to(0)) for part in scene.parts if part.role == "cable"]
    end = np.array([np.cos(0.3), np.sin(0.3), 0])
    expected = [[(1, 2, 0), end], [(0, 1, 0), 0.5 * end], [(3, 1, 0), end]]
    assert [part.colour for part in drawn] == [DRIVEN] * 3
    for part, points in zip(drawn, expected, strict=True):
        np.testing.assert_allclose(part.form.points, points, atol=1e-15)
    assert robot.home.positions[0] == 0 and scene.points[:, 0].max() == 3
    assert sum(isinstance(fixture.carrier, int) for fixture in fixtures_of(robot).parts) == 3
