"""Pictures of mechanisms: everything is in them, equal axes with units, poses the paler the longer
ago."""

import tracemalloc

import numpy as np
import pytest

import linkwork as lw
from linkwork.scene.colours import EDGE, ORANGE
from linkwork.scene.skeleton import skeleton
from linkwork.views import plot_mechanism
from linkwork.views.lettering import placed
from linkwork.views.space import on_screen, viewpoint, written_box
from linkwork.views.style import new_figure, svg

from tests.catalogue import built


def empty_axes(robot):
    return new_figure(3, 3).add_subplot(projection=None if robot.planar else "3d")


def symbols(axes):
    """Return the artists that stand for joints, by the joint's name."""
    return {artist.get_gid(): artist for artist in axes.get_children() if artist.get_gid()}


@pytest.mark.sample(14)
@pytest.mark.parametrize("name", lw.robots.__all__)
def test_every_joint_of_every_robot_of_the_catalogue_is_drawn(name):
    robot = built(name)
    axes = plot_mechanism(robot, robot.home, empty_axes(robot))
    drawn = [artist.get_gid() for artist in axes.get_children() if artist.get_gid()]
    pairs = [name for name, joint in robot.mechanism.pairs.items() if joint.type != "free"]
    assert sorted(drawn) == sorted(pairs)


@pytest.mark.parametrize("name", ["prr3", "five_bar", "andrews", "n_four_bar"])
def test_nothing_of_a_robot_lies_under_the_grid(name):
    axes = plot_mechanism(built(name), built(name).home)
    drawn = [*axes.lines, *axes.patches, *axes.collections]
    assert min(artist.get_zorder() for artist in drawn) > axes.xaxis.get_zorder()
    assert len({line.get_zorder() for line in axes.lines}) > 1  # bars lie below joints


@pytest.mark.parametrize("name", ["zoo", "flat"])
def test_every_kind_of_joint_is_drawn(name, request):
    robot = request.getfixturevalue(name)
    axes = plot_mechanism(robot, robot.home)
    assert set(symbols(axes)) == set(robot.mechanism.pairs) - {"free"}
    dashed = [line for line in axes.lines if line.get_linestyle() == "--"]
    assert len(dashed) == len(robot.mechanism.gears)


def test_symbols_stand_where_the_joints_are(robot):
    state = robot.assemble(tool=[0.52, 0.27, 0.42])
    drawn = symbols(plot_mechanism(robot, state))
    for joint in skeleton(robot, state).joints:
        artist = drawn[joint.name]
        middle = (
            artist.get_xydata()[0] if joint.type == "revolute" else artist.get_xy()[:4].mean(axis=0)
        )
        np.testing.assert_allclose(middle, joint.far[:2], atol=1e-12)


def test_driven_joints_are_orange_and_others_are_not(robot):
    from matplotlib.colors import to_hex

    drawn = symbols(plot_mechanism(robot, robot.home))
    orange = [
        name
        for name, artist in drawn.items()
        if "slide" in name and to_hex(artist.get_facecolor()) == ORANGE
    ]
    assert orange == list(robot.actuators)
    assert all(to_hex(drawn[f"wrist_{i}"].get_markerfacecolor()) == "#ffffff" for i in (1, 2, 3))


@pytest.mark.parametrize("name", ["rpr3", "stewart"])
def test_legs_of_variable_length_are_drawn_as_tube_and_rod(name):
    from matplotlib.colors import to_hex

    robot = built(name)
    axes = plot_mechanism(robot, robot.home, empty_axes(robot))
    tubes = [artist for gid, artist in symbols(axes).items() if gid in robot.actuators]
    assert len(tubes) == robot.mobility
    assert {to_hex(tube.get_color()) for tube in tubes} == {ORANGE}


def test_axes_are_equal_and_have_units(robot):
    axes = plot_mechanism(robot, robot.home, names=True)
    assert axes.get_aspect() == 1.0
    assert (axes.get_xlabel(), axes.get_ylabel()) == ("x [m]", "y [m]")
    written = {name for text in axes.texts for name in text.get_text().split("\n")}
    assert set(robot.joints) <= written
    low, high = axes.dataLim.min, axes.dataLim.max
    points = skeleton(robot, robot.home).points[:, :2]
    assert (low <= points.min(axis=0)).all() and (points.max(axis=0) <= high).all()


def test_names_may_be_chosen(robot):
    axes = plot_mechanism(robot, robot.home, names=robot.actuators)
    assert {text.get_text() for text in axes.texts} == {"", *robot.actuators}


def test_names_hide_no_joint_and_not_each_other():
    drawn = np.array([(0, 0), (1, 0), *((x, 0) for x in np.linspace(0, 1, 20))], float)
    half = np.array([0.1, 0.02])
    box = placed(np.array([1.0, 0.0]), half, drawn)
    assert (np.abs(drawn - box) > half).any(axis=1).all()
    assert box[0] > 1  # outwards, for nothing is in the way
    inside = placed(np.array([0.5, 0.0]), half, drawn)
    assert (np.abs(drawn - inside) > half).any(axis=1).all()


def test_a_stack_is_drawn_pose_by_pose_with_the_last_in_full(robot):
    state = robot.assemble(tool=[[0.5, 0.29, 0.5], [0.51, 0.29, 0.5], [0.52, 0.29, 0.5]])
    plates = [patch for patch in plot_mechanism(robot, state).patches if len(patch.get_xy()) == 4]
    brightness = [sum(plate.get_facecolor()[:3]) for plate in plates]
    assert len(plates) == 3
    assert brightness == sorted(brightness, reverse=True)
    np.testing.assert_allclose(plates[-1].get_xy()[:3].mean(axis=0), [0.52, 0.29], atol=1e-9)


def test_a_planar_body_whose_joints_stand_at_different_heights_is_seen_from_above():
    body = lw.Body(mass=1.0, inertia=lw.Inertia(zz=0.1))
    corners = {
        "left": (0, 0, 0.1),
        "right": (1, 0, 0.3),
        "top": (0.5, 1, -0.2),
        "middle": (0.5, 0.4, 0.5),
    }
    bodies = {"plate": body} | dict.fromkeys(corners, body)
    joints = {"pivot": lw.RevoluteJoint(connects=("ground", "plate"))} | {
        f"pin_{name}": lw.RevoluteJoint(
            connects=("plate", name), frames=(lw.Frame(position=corner), lw.Frame())
        )
        for name, corner in corners.items()
    }
    robot = lw.Robot(lw.Mechanism(bodies=bodies, joints=joints))
    (plate,) = plot_mechanism(robot, robot.home).patches
    assert {tuple(point) for point in np.round(plate.get_xy(), 9)} == {(0, 0), (1, 0), (0.5, 1)}


def test_a_spatial_stack_is_drawn_pose_by_pose_too():
    from matplotlib.colors import to_hex

    robot = built("bricard")
    angles = np.linspace(0, 0.4, 3)
    stack = robot.state(
        np.stack([robot.assemble({"hinge_1": angle}).positions for angle in angles])
    )
    edges = [
        to_hex(line.get_color())
        for line in plot_mechanism(robot, stack).lines
        if line.get_linewidth() > 4
    ]
    assert len(edges) == 3 * 5  # five rods in three poses, each with its dark edges
    assert edges.count(EDGE) == 5


def test_a_spatial_robot_is_drawn_in_three_dimensions_with_equal_axes(spatial):
    axes = plot_mechanism(spatial, spatial.home, names=True)
    assert (axes.get_xlabel(), axes.get_zlabel()) == ("x [m]", "z [m]")
    limits = np.array([axes.get_xlim(), axes.get_ylim(), axes.get_zlim()])
    np.testing.assert_allclose(
        np.ptp(limits, axis=1) / axes._box_aspect, np.ptp(limits[0]) / axes._box_aspect[0]
    )
    points = skeleton(spatial, spatial.home).points
    assert (limits[:, 0] <= points.min(axis=0)).all() and (points.max(axis=0) <= limits[:, 1]).all()
    assert "wing_2" in svg(axes.figure)


@pytest.mark.parametrize("name", ["bennett", "spatial_slider_crank", "agile_wrist"])
def test_nothing_of_a_spatial_picture_is_cut_off(name):
    robot = built(name)
    axes = plot_mechanism(robot, robot.home, names=robot.actuators)
    figure = axes.figure
    figure.draw_without_rendering()
    boxes = [axis.get_tightbbox().get_points() for axis in (axes.xaxis, axes.yaxis, axes.zaxis)]
    boxes += [written_box(axes, text) for text in axes.texts]
    boxes.append(on_screen(axes, skeleton(robot, robot.home).points))
    for box in boxes:
        assert (box >= figure.bbox.min).all() and (box <= figure.bbox.max).all()


def test_points_on_a_line_are_not_looked_at_along_it():
    for away in np.array([(1.0, -1.5, 0.8), (1, 0.7, 0.6), (0, 0, 1), (1, 0, 0)]):
        elevation, azimuth = np.radians(viewpoint(np.outer(np.linspace(0, 1, 5), away)))
        towards = (
            np.cos(elevation) * np.cos(azimuth),
            np.cos(elevation) * np.sin(azimuth),
            np.sin(elevation),
        )
        assert abs(towards @ away) < 0.95 * np.linalg.norm(away)


def test_what_does_not_fit_is_refused(robot, spatial):
    with pytest.raises(lw.LinkworkError, match="drawn in three dimensions"):
        plot_mechanism(spatial, spatial.home, new_figure(3, 3).add_subplot())
    with pytest.raises(lw.LinkworkError, match="drawn in two dimensions"):
        plot_mechanism(robot, robot.home, new_figure(3, 3).add_subplot(projection="3d"))
    stack = robot.state(np.broadcast_to(robot.home.positions, (2, 2, 9)))
    with pytest.raises(lw.LinkworkError, match="is no sequence of poses"):
        plot_mechanism(robot, stack)
    with pytest.raises(lw.LinkworkError, match=r"of shape \(0,\) is no sequence of poses"):
        plot_mechanism(robot, stack.at(0).at(slice(0, 0)))
    with pytest.raises(
        lw.LinkworkError, match="there is no joint 'slide_9'; the joints are slide_1, "
    ):
        plot_mechanism(robot, robot.home, names=["slide_9"])


def test_a_view_is_chosen_in_little_memory_of_however_many_points():
    """A second of a robot with meshes has tens of thousands."""
    a, b = np.meshgrid(np.linspace(0, 1, 60), np.linspace(0, 1, 50))
    sheet = np.stack([a, b, np.sin(9 * a) * b], axis=-1).reshape(-1, 3)
    tracemalloc.start()
    seen = viewpoint(sheet)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert peak < 20e6
    assert seen == viewpoint(sheet[::-9])
