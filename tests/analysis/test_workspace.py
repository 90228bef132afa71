"""Workspaces: areas and edges by geometry, branches kept, isotropic velocity and force by brute
force."""

import inspect
import sys
import threading
import time

import numpy as np
import pytest
import xarray
from scipy.spatial.transform import Rotation

import linkwork as lw
from linkwork.analysis import content, inscribed, jacobians, loci, workspace
from linkwork.analysis.newton import in_threads

from tests.analysis.mechanisms import arm, cart
from tests.catalogue import built
from tests.robot.test_branches import par4_motors

BASE, PROXIMAL, DISTAL = 0.3, 0.25, 0.35  # of the five-bar


def plane(n, low, high, **constant):
    return {"x": np.linspace(low[0], high[0], n), "y": np.linspace(low[1], high[1], n), **constant}


def test_a_planar_arm_reaches_a_ring():
    mapped = workspace(arm(1.0, 0.6), plane(201, (-1.7, -1.7), (1.7, 1.7)))
    x, y = np.meshgrid(mapped.x, mapped.y, indexing="ij")
    radius = np.hypot(x, y)
    inside = (radius > 0.4) & (radius < 1.6)
    np.testing.assert_array_equal(
        mapped.reachable.values[np.abs(radius - 0.4) > 1e-6], inside[np.abs(radius - 0.4) > 1e-6]
    )
    assert content(mapped) == pytest.approx(np.pi * (1.6**2 - 0.4**2), rel=0.01)
    centre, r = inscribed(mapped)
    assert r == pytest.approx(0.6, abs=0.04)
    assert np.hypot(centre["x"], centre["y"]) == pytest.approx(1.0, abs=0.04)
    assert mapped.attrs["message"] == f"{int(inside.sum())} of 40401 poses are reached"


def test_the_arm_s_conditioning_and_elbow_in_closed_form():
    """l = 1 m as the tool only shifts; J = [[-l1 s1 - l2 s12, -l2 s12], [l1 c1 + l2 c12, l2 c12]],
    elbow by the cosine law."""
    mapped = workspace(arm(1.0, 0.6), plane(23, (-1.5, -1.5), (1.5, 1.5)))
    for x, y in ((0.9, 0.4), (-0.7, 0.6), (0.3, -1.1)):
        cell = mapped.sel(x=x, y=y, method="nearest")
        x, y = float(cell.x), float(cell.y)
        bend = np.arccos((x**2 + y**2 - 1.36) / 1.2)
        first = np.arctan2(y, x) - np.arctan2(0.6 * np.sin(bend), 1 + 0.6 * np.cos(bend))
        turn = cell.actuator_position.values - [first, bend]
        np.testing.assert_allclose(np.sin(turn / 2), 0, atol=1e-9)
        s, c = np.sin([first, first + bend]), np.cos([first, first + bend])
        J = np.array([[-s[0] - 0.6 * s[1], -0.6 * s[1]], [c[0] + 0.6 * c[1], 0.6 * c[1]]])
        assert float(cell.conditioning) == pytest.approx(1 / np.linalg.cond(J), rel=1e-9)


def test_the_five_bar_reaches_what_both_legs_reach_on_every_working_mode():
    robot = built("five_bar")
    x, y = np.meshgrid(np.linspace(-0.5, 0.8, 131), np.linspace(-0.7, 0.7, 141), indexing="ij")
    legs = [np.hypot(x - foot, y) for foot in (0.0, BASE)]
    expected = np.all([(d < PROXIMAL + DISTAL) & (d > DISTAL - PROXIMAL) for d in legs], axis=0)
    edge = np.any(
        [
            np.abs(d - bound) < 1e-6
            for d in legs
            for bound in (PROXIMAL + DISTAL, DISTAL - PROXIMAL)
        ],
        axis=0,
    )
    for guess in lw.analysis.working_modes(robot).states.positions:
        mapped = workspace(robot, {"x": x[:, 0], "y": y[0]}, guess=robot.state(guess))
        np.testing.assert_array_equal(mapped.reachable.values | edge, expected | edge)


@pytest.mark.parametrize("mode", range(4))
def test_parts_of_a_mode_that_no_neighbour_leads_to_are_found_on_coarse_grids(mode):
    five_bar = lw.Robot(lw.robots.five_bar(base=0.356, proximal=0.218, distal=0.376))
    guess = lw.analysis.working_modes(five_bar).states.at(mode)
    axes = {"x": [-0.5, -0.066, 0.367, 0.8], "y": np.linspace(-0.6, 0.6, 11)}
    mapped = workspace(five_bar, axes, guess=guess)
    x, y = np.meshgrid(*axes.values(), indexing="ij")
    legs = [np.hypot(x - foot, y) for foot in (0.0, 0.356)]
    expected = np.all([(d < 0.594) & (d > 0.158) for d in legs], axis=0)
    np.testing.assert_array_equal(mapped.reachable, expected)


def rrs3_reached(axes, base, platform, first, second):
    """Tell where (z, rx, ry) all legs of a 3-RRS reach: a ball of each leg has to be nearer to its
    motor than the leg is long, and farther than its links differ by."""
    z, rx, ry = (part.ravel() for part in np.meshgrid(*axes.values(), indexing="ij"))
    R = Rotation.from_rotvec(np.stack([rx, ry, 0 * rx], axis=1)).as_matrix()
    tilt, azimuth = np.hypot(rx, ry), np.arctan2(-rx, ry)
    aside = platform * (1 - np.cos(tilt)) / 2
    P = np.stack([-aside * np.cos(2 * azimuth), aside * np.sin(2 * azimuth), z], 1)
    expected = np.ones(len(R), bool)
    for f in (0.0, 2 * np.pi / 3, 4 * np.pi / 3):
        e = np.array([np.cos(f), np.sin(f), 0.0])
        ball = P + platform * R @ e
        away = np.hypot(ball @ e - base, ball[:, 2])
        expected &= (away < first + second) & (away > abs(second - first))
    return expected


def test_straight_ways_from_the_guess_lead_where_no_neighbour_does():
    sizes = 0.201, 0.186, 0.1186, 0.2107
    robot = lw.Robot(lw.robots.rrs3(*sizes, 0.244))
    axes = {"z": 0.1634, "rx": np.linspace(-0.8, 0.8, 11), "ry": [-0.8, -0.4, 0.0, 0.4, 0.8]}
    expected = rrs3_reached(axes, *sizes)
    np.testing.assert_array_equal(workspace(robot, axes).reachable.values.ravel(), expected)


@pytest.mark.long
def test_parts_that_hang_together_with_the_guess_nowhere_are_told_and_mapped_from_there():
    """A 3-RRS, whose legs share a stage, reaches three parts beside the one that holds home."""
    sizes = 0.204, 0.177, 0.135, 0.227
    robot = lw.Robot(lw.robots.rrs3(*sizes, 0.23))
    axes = {"z": np.linspace(-0.1, 0.3, 6), "rx": np.linspace(-1.2, 1.2, 8)}
    axes["ry"] = np.linspace(-1.2, 1.2, 7)
    reached = workspace(robot, axes)
    missing = rrs3_reached(axes, *sizes) & ~reached.reachable.values.ravel()
    poses = np.stack(np.meshgrid(*axes.values(), indexing="ij"), axis=-1).reshape(-1, 3)[missing]
    assert missing.sum() > 20
    assert f"at {missing.sum()} more, such as z -0.1, rx " in reached.attrs["message"]
    there = workspace(robot, axes, guess=robot.assemble(tool=poses[0])).reachable.values.ravel()
    assert there[missing][0] and not there[~missing].any()


def test_the_3_prr_at_constant_orientation_reaches_a_triangle():
    """Each vertex stays within l1 of its slide's line: three half planes, for the distances add up
    to a constant > 2 l1."""
    angle, l1, l2 = 0.5, 0.3, 0.15
    mapped = workspace(built("prr3"), plane(241, (0.32, 0.12), (0.68, 0.48), angle=angle))
    x, y = np.meshgrid(mapped.x, mapped.y, indexing="ij")
    heights = []
    for i, corner in enumerate(((0, 0), (1, 0), (0.5, np.sqrt(3) / 2))):
        a = i * 2 * np.pi / 3
        vx, vy = x - l2 * np.cos(angle + a) - corner[0], y - l2 * np.sin(angle + a) - corner[1]
        heights.append(np.cos(a) * vy - np.sin(a) * vx)
    np.testing.assert_array_equal(mapped.reachable, np.max(np.abs(heights), axis=0) < l1)
    inradius = l1 - (np.sqrt(3) / 2 - 3 * l2 * np.sin(angle)) / 3
    assert inscribed(mapped)[1] == pytest.approx(inradius, abs=0.003)
    assert content(mapped) == pytest.approx(3 * np.sqrt(3) * inradius**2, rel=0.02)


def test_neighbours_lead_where_newton_s_method_does_not_get_from_afar(monkeypatch):
    grid = plane(61, (-0.31, -0.61), (0.62, 0.6))
    expected = workspace(built("five_bar"), grid)
    monkeypatch.setattr(sys.modules[workspace.__module__], "FAR", 4)
    xarray.testing.assert_allclose(
        workspace(built("five_bar"), grid), expected, rtol=1e-6, atol=1e-7
    )


def test_reachable_at_some_angle_and_at_all():
    mapped = workspace(
        built("prr3"), plane(41, (0.3, 0.1), (0.7, 0.5), angle=np.linspace(0.2, 0.8, 7))
    )
    assert mapped.reachable.dims == ("x", "y", "angle")
    some, every = mapped.reachable.any("angle"), mapped.reachable.all("angle")
    assert 0 < every.sum() < mapped.reachable.sel(angle=0.5, method="nearest").sum() < some.sum()


def test_joint_limits_cut_the_workspace():
    free = workspace(arm(), plane(61, (-1.7, -1.7), (1.7, 1.7)))
    held = workspace(arm(), plane(61, (-1.7, -1.7), (1.7, 1.7)), limits={"hinge_1": (-0.5, 0.5)})
    first = (free.actuator_position.sel(actuator="hinge_1") + np.pi) % (2 * np.pi) - np.pi
    np.testing.assert_array_equal(held.reachable, free.reachable & (np.abs(first) <= 0.5))
    assert np.isnan(held.conditioning.values[~held.reachable.values]).all()


def test_whole_turns_of_hinges_keep_limits_and_those_of_threads_do_not():
    hinged, grid = arm(), plane(9, (-1.3, -1.3), (1.3, 1.3))
    free = workspace(hinged, grid).reachable.values
    for limits in ((0, 2 * np.pi), (-1, 8.0), (2 * np.pi, 4 * np.pi)):
        held = workspace(hinged, grid, limits={"hinge_1": limits}).reachable.values
        np.testing.assert_array_equal(held, free)
    thread = lw.ScrewJoint(connects=("ground", "nut"), pitch=0.01)
    nut = lw.Body(mass=1, inertia=lw.Inertia(xx=0.1, yy=0.1, zz=0.1))
    tools = {"tip": lw.Tool(body="nut", task=("z",))}
    robot = lw.Robot(
        lw.Mechanism(
            bodies={"nut": nut}, joints={"thread": thread}, actuators=("thread",), tools=tools
        )
    )
    mapped = workspace(robot, {"z": np.arange(10) * thread.pitch}, limits={"thread": (0, 7.5)})
    turns = mapped.actuator_position.values[:, 0]
    np.testing.assert_allclose(turns, [*range(8), np.nan, np.nan], atol=1e-9)


def test_isotropic_velocity_and_force_are_what_the_worst_direction_allows():
    robot = built("prr3")
    rates, forces = np.array([0.5, 1.0, 2.0]), np.array([10.0, 20.0, 5.0])
    mapped = workspace(
        robot, {"x": [0.5], "y": 0.3, "angle": 0.5}, rates=rates, forces=forces
    ).isel(x=0)
    K, J, *_ = jacobians(robot)(robot.assemble(tool=[0.5, 0.3, 0.5]).q)
    around = np.linspace(0, 2 * np.pi, 100001)
    shift = np.stack([np.cos(around), np.sin(around), 0 * around])
    assert float(mapped.isotropic_velocity) == pytest.approx(
        1 / np.max(np.abs(K @ shift) / rates[:, None]), rel=1e-6
    )
    assert float(mapped.isotropic_force) == pytest.approx(
        1 / np.max(np.abs(J.T @ shift) / forces[:, None]), rel=1e-6
    )
    assert float(mapped.isotropic_turn_rate) == pytest.approx(
        1 / np.max(np.abs(K[:, 2]) / rates), rel=1e-12
    )
    assert float(mapped.isotropic_moment) == pytest.approx(
        1 / np.max(np.abs(J[2]) / forces), rel=1e-12
    )


def test_forces_from_virtual_work_are_inverse_dynamics_of_a_massless_load():
    """u = J' f: the actuator forces that a weight on the tool needs beyond those without it, at
    rest."""
    light, heavy = (
        lw.Robot(lw.robots.prr3(gravity=(0.0, -9.81, 0.0), platform_mass=mass))
        for mass in (1.0, 2.0)
    )
    state = light.assemble(tool=[0.5, 0.3, 0.5])
    added = heavy.inverse_dynamics(
        heavy.assemble(tool=[0.5, 0.3, 0.5]), np.zeros(3)
    ) - light.inverse_dynamics(state, np.zeros(3))
    _, J, *_ = jacobians(light)(state.q)
    np.testing.assert_allclose(added, J.T @ [0, 9.81, 0], rtol=1e-9)


def test_spatial_robots_map_volumes():
    grid = {
        "x": np.linspace(-1, 1, 9),
        "y": np.linspace(-1, 1, 9),
        "z": np.linspace(1, 3, 9),
        "rx": 0.0,
        "ry": 0.0,
        "rz": 0.0,
    }
    robot = built("stewart")
    limits = {f"leg_{i}": (2.5, 3.5) for i in range(1, 7)}
    mapped = workspace(robot, grid, limits=limits)
    feet, tips = (
        np.array(points)
        for points in (lw.robots.stewart.__defaults__[0], lw.robots.stewart.__defaults__[1])
    )
    pose = np.stack(np.meshgrid(*(grid[name] for name in "xyz"), indexing="ij"), axis=-1)
    lengths = np.linalg.norm(pose[..., None, :] + tips - feet, axis=-1)
    np.testing.assert_array_equal(
        mapped.reachable, ((lengths >= 2.5) & (lengths <= 3.5)).all(axis=-1)
    )
    assert mapped.attrs["characteristic_length"] > 0
    assert inscribed(mapped)[1] > 0.2


def test_a_par4_reaches_what_its_legs_reach_where_rows_that_depend_on_others_vanish():
    """All that is reached hangs together there; its motors are those of closed forms."""
    axes = {"x": np.linspace(-0.6, 0.6, 5), "y": [-0.3, 0.0, 0.3], "z": [-0.8, -0.5], "rz": [0, 1]}
    mapped = workspace(built("par4"), axes)
    poses = np.stack(np.meshgrid(*axes.values(), indexing="ij"), axis=-1).reshape(-1, 4)
    with np.errstate(invalid="ignore"):
        motors = np.array([par4_motors(pose) for pose in poses])
    reached = mapped.reachable.values.ravel()
    np.testing.assert_array_equal(reached, np.isfinite(motors).all(axis=1))
    found = mapped.actuator_position.values.reshape(-1, 4)
    np.testing.assert_allclose(found[reached], motors[reached], atol=1e-9)


def test_a_tripteron_reaches_what_all_its_legs_reach_where_rows_that_depend_on_others_vanish():
    """Leg i reaches what is nearer to its root, in the plane across its slide, than it is long; a
    row of its last hinge vanishes where its two links have turned by 90 deg together."""
    axis = np.linspace(-0.34, 0.34, 6)
    mapped = workspace(built("tripteron"), dict.fromkeys("xyz", axis))
    across = 0.3 + np.stack(np.meshgrid(axis, axis, axis, indexing="ij"))
    legs = np.hypot(across, np.roll(across, -1, axis=0)) < 0.6
    np.testing.assert_array_equal(mapped.reachable, legs.all(axis=0))
    # Its tool moves as its slides do: both determinants are alike, and none changes its sign.
    reached = mapped.reachable.values
    np.testing.assert_allclose(mapped.det_A.values[reached], mapped.det_B.values[reached])
    assert (mapped.det_B.values[reached] > 0).all()


def test_the_edge_is_the_ring():
    mapped = workspace(arm(), plane(201, (-1.7, -1.7), (1.7, 1.7)))
    radii = np.concatenate([np.hypot(*line.T) for line in loci(mapped, "reachable", 0.5)])
    assert np.minimum(np.abs(radii - 0.4), np.abs(radii - 1.6)).max() < 0.02


def test_a_grid_without_a_reachable_pose_gives_an_empty_result_and_says_so(tmp_path):
    mapped = workspace(arm(), {"x": [5.0, 6.0], "y": [5.0, 6.0, 7.0]}, rates=1.0, forces=1.0)
    assert not mapped.reachable.any()
    assert mapped.conditioning.isnull().all() and mapped.isotropic_force.isnull().all()
    assert mapped.attrs["message"].startswith(
        "none of 6 poses is reached on this working mode (x from 5 to 6"
    )
    assert inscribed(mapped)[1] == 0 and content(mapped) == 0
    mapped.to_netcdf(tmp_path / "map.nc", engine="scipy")


def test_one_pose_and_one_axis():
    one = workspace(arm(), {"x": 1.0, "y": 0.2})
    assert bool(one.reachable) and one.reachable.dims == ()
    assert workspace(cart(), {"x": [0.0, 1.0]}).conditioning.values == pytest.approx([1.0, 1.0])


@pytest.mark.parametrize(
    ("grid", "options", "told"),
    [
        ({"x": [0, 1]}, {}, "x: 1 coordinate is given, but the mobility is 2"),
        ({"x": [0, 1], "q": 0}, {}, "no coordinate of the tool 'q'"),
        ([0, 1], {}, "by name"),
        ({"x": [0, 0, 1], "y": 0}, {}, "the grid's x is no sequence"),
        ({"x": [], "y": 0}, {}, "the grid's x is no sequence"),
        ({"x": [0, np.nan], "y": 0}, {}, "finite"),
        ({"x": [0, 1], "y": 0}, {"limits": {"hinge_9": (0, 1)}}, "there is no joint 'hinge_9'"),
        ({"x": [0, 1], "y": 0}, {"limits": {"hinge_1": (1, 0)}}, "larger upper bound"),
        ({"x": [0, 1], "y": 0}, {"rates": [1.0]}, "2 numbers"),
        ({"x": [0, 1], "y": 0}, {"forces": -1.0}, "one positive number per actuator"),
        ({"x": [0, 1], "y": 0}, {"length": 0.0}, "characteristic length"),
        (
            {"x": [0, 1], "y": 0},
            {"guess": arm().state({"hinge_1": 0, "hinge_2": 0})},
            "leg-singular",
        ),
        (
            {"x": [0, 1], "y": 0},
            {"guess": arm().state({"hinge_1": [0, 1], "hinge_2": [1, 1]})},
            "a stack of states",
        ),
    ],
)
def test_refusals(grid, options, told):
    with pytest.raises(lw.LinkworkError, match=told) as refusal:
        workspace(arm(), grid, **options)
    assert "\n" not in str(refusal.value)


def test_circles_lie_in_lengths_equally_spaced():
    mapped = workspace(built("prr3"), {"x": [0.45, 0.5, 0.6], "y": 0.3, "angle": [0.4, 0.5]})
    with pytest.raises(lw.LinkworkError, match="equally spaced lengths"):
        inscribed(mapped)


@pytest.mark.parametrize("at_least", ["much", np.nan, None, [0.1, 0.2]])
def test_the_least_conditioning_of_a_circle_is_a_number(at_least):
    mapped = workspace(arm(1.0, 0.6), plane(5, (-1.5, -1.5), (1.5, 1.5)))
    with pytest.raises(lw.LinkworkError, match=r"at_least.* is .*; give"):
        inscribed(mapped, at_least=at_least)


def test_as_many_threads_as_processors_may_be_used(monkeypatch):
    """One processor allowed: the parts are done in one thread, however many the machine has."""
    monkeypatch.setattr("os.sched_getaffinity", lambda _: {0}, raising=False)
    threads = in_threads(
        lambda part: (time.sleep(0.01), threading.get_ident())[1],
        [slice(k, k + 1) for k in range(4)],
    )
    assert len(set(threads)) == 1


def delta_legs(robot, poses, radii, arm, rod):
    """Return both angles of each motor (N, 3, 2) at poses, by the legs' closed form: the elbow lies
    on a circle, and at the rod's length from the platform."""
    base, platform = radii
    found = []
    for i in (1, 2, 3):
        e = np.array(robot.mechanism.joints[f"motor_{i}"].frames[0].position)
        e = e / np.linalg.norm(e)
        x, y, z = poses @ e + platform - base, poses @ np.cross([0, 0, 1], e), poses[:, 2]
        middle = np.arctan2(z, -x)
        with np.errstate(invalid="ignore"):
            cosine = (rod**2 - x**2 - y**2 - z**2 - arm**2) / (2 * arm * np.hypot(x, z))
            found.append(np.stack([middle + np.arccos(cosine), middle - np.arccos(cosine)], -1))
    return np.stack(found, axis=1)


def test_two_legs_of_a_delta_turned_over_are_another_working_mode():
    """The determinant of its legs is one number, which has the same sign there: each pose that is
    reached has all three motors on the branch of home, by their closed form."""
    robot, axis = built("delta"), np.linspace(-1.2, 1.2, 17)
    given = inspect.signature(lw.robots.delta).parameters
    sizes = {name: of.default for name, of in given.items()}
    radii = sizes["base_radius"], sizes["platform_radius"]
    mapped = workspace(robot, {"x": axis, "y": axis, "z": np.linspace(-1.4, 1.4, 21)})
    reached = mapped.reachable.values.ravel()
    grid = [part.ravel() for part in np.meshgrid(axis, axis, mapped.z.values, indexing="ij")]
    both = delta_legs(robot, np.column_stack(grid), radii, sizes["arm"], sizes["rod"])
    centre = np.array([[0.0, 0.0, -sizes["height"]]])
    home = delta_legs(robot, centre, radii, sizes["arm"], sizes["rod"])[0]
    motors = robot.home.positions[:3]
    kept = int(np.argmin(np.abs(home[0] - motors[0])))
    np.testing.assert_allclose(home[:, kept], motors, atol=1e-9)
    found = mapped.actuator_position.values.reshape(-1, 3)[reached]
    np.testing.assert_allclose(np.exp(1j * found), np.exp(1j * both[reached][..., kept]), atol=1e-6)
    # Above the base, too, and hardly anything is left out where the platform does not let go.
    assert 0.35 < reached.sum() / np.isfinite(both[..., 0]).all(axis=1).sum() < 0.6
    assert mapped.z.values[mapped.reachable.any(["x", "y"]).values].max() > 0.3


def delta_reached(robot, axes, sizes):
    """Tell where (x, y, z) all legs of a Delta reach, and the normals of their parallelograms keep
    their orientation: else the platform may turn."""
    base, platform, arm, rod, height = sizes
    poses = np.stack(np.meshgrid(*axes.values(), indexing="ij"), axis=-1).reshape(-1, 3)
    poses = np.concatenate([[[0.0, 0.0, -height]], poses])
    both, normals = delta_legs(robot, poses, (base, platform), arm, rod), []
    side = np.argmin(np.abs(np.sin((both[0, 0] - robot.home["motor_1"]) / 2)))
    for i, angle in enumerate(both[..., side].T):
        e = np.array(robot.mechanism.joints[f"motor_{i + 1}"].frames[0].position)
        e = e / np.linalg.norm(e)
        elbow = np.outer(base + arm * np.cos(angle), e) - np.outer(arm * np.sin(angle), [0, 0, 1])
        links = poses + platform * e - elbow
        np.testing.assert_allclose(np.linalg.norm(links[np.isfinite(angle)], axis=1), rod)
        normals.append(np.cross(links, np.cross([0, 0, 1], e)) / rod)
    with np.errstate(invalid="ignore", divide="ignore"):
        held = np.linalg.det(np.stack(normals, axis=1))
        return held[1:] / held[0] > 0


@pytest.mark.sample(1)
@pytest.mark.parametrize(
    "sizes", [(0.24, 0.058, 0.236, 0.662, 0.795), (0.31, 0.11, 0.21, 0.84, 0.82)]
)
def test_poses_across_cells_lead_where_no_neighbour_does(sizes):
    """Nor do all ways: parts of the branch are by themselves on the grid."""
    robot = lw.Robot(lw.robots.delta(*sizes[:4], 0.19, sizes[4]))
    axis, z = np.linspace(-0.8, 0.8, 11), np.linspace(-1.1, -0.2, 10)
    axes = {"x": axis, "y": axis, "z": z}
    mapped = workspace(robot, axes)
    np.testing.assert_array_equal(
        mapped.reachable.values.ravel(), delta_reached(robot, axes, sizes)
    )


def test_a_robot_keeps_its_jacobians_and_another_design_has_its_own():
    reach = "tools.mass.frame.position.x"
    robot = arm(1.0, 0.6).free(reach)
    assert jacobians(robot) is jacobians(robot, robot.task)
    longer = robot.with_parameters({reach: 0.9})
    poses = plane(21, (-2.0, -2.0), (2.0, 2.0))
    reached = [int(workspace(made, poses).reachable.sum()) for made in (robot, longer, robot)]
    fresh = workspace(arm(1.0, 0.9), poses)
    assert reached[0] == reached[2] != reached[1] == int(fresh.reachable.sum())
