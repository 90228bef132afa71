"""Singularities: their kinds at known poses, closed forms of the five-bar's loci, distances and
crossings."""

import numpy as np
import pytest

import linkwork as lw
from linkwork.analysis import along, input_output, jacobians, loci, singularity, workspace
from linkwork.analysis.singularities import zeros

from tests.analysis.mechanisms import arm, rpr, rrs
from tests.catalogue import built
from tests.robot import mixed_freedoms

BASE, PROXIMAL, DISTAL = 0.3, 0.25, 0.35  # of the five-bar


def elbows(robot, state):
    angles = np.array([state["motor_1"], state["motor_2"]])
    foot = np.array([[0.0, 0.0], [BASE, 0.0]])
    return foot + PROXIMAL * np.stack([np.cos(angles), np.sin(angles)], axis=-1)


@pytest.mark.parametrize(
    "name", ["five_bar", "prr3", "rpr3", "stewart", "linear_delta", "agile_wrist"]
)
def test_the_jacobians_relate_the_rates_that_the_robot_itself_gives(name):
    """x' of the tool and q' of the actuators, both from the rate map of the equations of motion."""
    robot = built(name)
    state = robot.home
    K, J, det_B, det_A = jacobians(robot)(state.q)
    np.testing.assert_allclose(K @ J, np.eye(len(K)), atol=1e-12)
    np.testing.assert_allclose([det_A, det_B], 1, rtol=1e-9)
    A, B = input_output(robot, state)
    np.testing.assert_allclose(np.linalg.solve(B, A), K, atol=1e-10)
    np.testing.assert_allclose(np.sum(A**2, axis=1) + np.diag(B) ** 2, 1, rtol=1e-12)
    h, x = 1e-6, jacobians(robot).what
    names = ("x", "y", "angle") if robot.planar else ("x", "y", "z", "rx", "ry", "rz")
    if "rx" in x:
        return
    for k, actuator in enumerate(robot.actuators):
        ends = [
            robot.tool_pose(
                robot.assemble(
                    {a: state[a] + sign * h * (a == actuator) for a in robot.actuators}, guess=state
                )
            )
            for sign in (1, -1)
        ]
        slope = (ends[0] - ends[1])[[names.index(w) for w in x]] / (2 * h)
        np.testing.assert_allclose(J[:, k], slope, atol=1e-7 * max(1, np.abs(J).max()))


@pytest.mark.parametrize("turned", [0.0, 1e-7])
def test_the_jacobians_where_a_row_that_is_kept_vanishes(turned):
    """A Tripteron's tool moves as its slides do; a row of its last hinge vanishes where a leg's
    links have turned by a right angle together."""
    robot, state = built("tripteron"), built("tripteron").home
    a = 0.3 + turned
    pose = np.array([0.3 * np.sin(a) - 0.3, 0.0, 0.3 * np.cos(a) - 0.3 * np.cos(turned) - 0.3])
    for part in np.linspace(0, 1, 9)[1:]:
        state = robot.assemble(tool=part * pose, guess=state)
    K, J, det_B, det_A = jacobians(robot)(state.q)
    np.testing.assert_allclose([K, J], [np.eye(3)] * 2, atol=1e-12)
    np.testing.assert_allclose(det_A, det_B, rtol=1e-9)
    assert det_B > 0.1
    A, B = input_output(robot, state)
    np.testing.assert_allclose(A, B, atol=1e-12)
    both = jacobians(robot)(np.stack([state.q, np.nan * state.q]))
    assert all(np.isfinite(part[0]).all() and np.isnan(part[1]).all() for part in both)


@pytest.mark.parametrize("aside", [0.0, 1e-12, 1e-4])
def test_the_jacobians_where_a_pivot_of_the_elimination_vanishes(aside):
    """An Orthoglide, rod 3 turned about: u_i . (P' - q_i' e_i) = 0, u_i from carriage i to P."""
    robot, rod = built("orthoglide"), 0.31
    places = dict(zip(robot.coordinates, robot.home.positions, strict=True))
    other = robot.state(places | {"slide_3": -2 * rod})
    P = np.array([1.0, 1.0, -1.0]) * (rod / np.sqrt(3) - aside)
    reach = np.sqrt(rod**2 - (P @ P - P**2)) * [-1, -1, 1]
    u = np.where(np.eye(3) > 0, reach, P)
    state = robot.assemble(tool=P, guess=other)
    both = jacobians(robot)(np.stack([state.q, np.nan * state.q]))
    K, J, det_B, det_A = (part[0] for part in both)
    np.testing.assert_allclose(J, np.linalg.solve(u, np.diag(reach)), atol=1e-9)
    np.testing.assert_allclose(K, np.linalg.inv(J), atol=1e-9)
    np.testing.assert_allclose(det_A / det_B, np.linalg.det(u) / np.prod(reach), rtol=1e-9)
    told = along(robot, robot.assemble(tool=np.stack([P, 0.999 * P]), guess=other))
    assert not told["crossings"].size
    for name in ("tool_distance", "actuator_distance", "conditioning"):
        np.testing.assert_allclose(*told[name].values, rtol=2e-2)


def test_the_five_bar_s_determinants_in_closed_form():
    """A: rows elbow -> tip; B: (tip - elbow) . (z x crank): |A| ~ sin between the distals, B ~ sin
    crank to distal."""
    robot, made = built("five_bar"), jacobians(built("five_bar"))
    states = robot.assemble(tool=[[0.15, 0.3], [0.3, 0.35], [0.0, 0.4]])
    _, _, det_B, det_A = made(states.q)
    expected = []
    for k in (None, 0, 1, 2):
        state = robot.home if k is None else states.at(k)
        tip, e = robot.tool_pose(state)[:2], elbows(robot, state)
        d, c = tip - e, e - [[0, 0], [BASE, 0]]
        expected.append((np.linalg.det(d), np.prod([d[i] @ [-c[i, 1], c[i, 0]] for i in (0, 1)])))
    ratio = np.array(expected[1:]) / expected[0]
    np.testing.assert_allclose(np.stack([det_A, det_B], axis=1), ratio, rtol=1e-9)


def test_the_five_bar_s_loci_part_the_two_sides_on_which_the_distal_links_lie():
    """det A has the sign of d_1 x d_2, the distal links from the elbows to the tip, all in closed
    form."""
    robot = built("five_bar")
    mapped = workspace(robot, {"x": np.linspace(-0.4, 0.7, 300), "y": np.linspace(-0.5, 0.5, 301)})
    x, y = np.meshgrid(mapped.x, mapped.y, indexing="ij")
    angles = mapped.actuator_position.values
    d = [
        np.stack([x - foot, y], -1) - PROXIMAL * np.stack([np.cos(q), np.sin(q)], -1)
        for foot, q in ((0, angles[..., 0]), (BASE, angles[..., 1]))
    ]
    side = np.sign(d[0][..., 0] * d[1][..., 1] - d[0][..., 1] * d[1][..., 0]) * np.sign(
        side_at_home(robot)
    )
    reached = mapped.reachable.values
    np.testing.assert_array_equal(np.sign(mapped.det_A.values[reached]), side[reached])
    lines = np.concatenate(loci(mapped))
    assert len(lines) > 200
    i, j = np.searchsorted(mapped.x, lines[:, 0]), np.searchsorted(mapped.y, lines[:, 1])
    beside = np.stack(
        [side[np.clip(i - a, 0, 299), np.clip(j - b, 0, 300)] for a in (0, 1) for b in (0, 1)]
    )
    assert (np.nanmin(beside, axis=0) < np.nanmax(beside, axis=0)).all()


def side_at_home(robot):
    d = robot.tool_pose(robot.home)[:2] - elbows(robot, robot.home)
    return np.linalg.det(d)


def test_a_turned_platform_over_its_base_is_actuator_singular():
    robot = built("rpr3")
    middle = [0.5, 0.5 / np.sqrt(3)]
    told = singularity(robot, robot.assemble(tool=[*middle, 0.0]))
    assert told.kinds == ("II",)
    assert told.tool == pytest.approx({"x": 0, "y": 0, "angle": 1}, abs=1e-9)
    assert "with the actuators locked" in told.message
    regular = singularity(robot, robot.assemble(tool=[*middle, 0.3]))
    assert regular.kinds == () and regular.message == "regular" and regular.tool == {}


def test_a_stretched_arm_is_leg_singular_and_two_serial_links_never_actuator_singular():
    robot = arm()
    told = singularity(robot, robot.state({"hinge_1": 0.4, "hinge_2": 0.0}))
    assert told.kinds == ("I",)
    assert told.leg < 1e-12 and told.actuator > 0.1 and told.constraint == 1.0


@pytest.mark.parametrize("lift", [0.0, 0.1, -0.2])
def test_a_3_rrs_is_not_singular_for_the_sideways_shifts_that_nothing_leads(lift):
    """Level, its platform can rise and tilt, but to first order not shift in x or y."""
    robot = rrs()
    level = robot.assemble({f"hip_{i}": float(robot.home[f"hip_{i}"]) + lift for i in (1, 2, 3)})
    told = singularity(robot, level)
    assert told.kinds == () and told.leg > 0.1 and told.message == "regular"
    asked = singularity(robot, level, what=("x", "y", "z"))
    assert asked.kinds == ("I",) and "with the tool's x, y, z held still" in asked.message
    near = along(robot, robot.state(level.positions[None]))
    assert robot.task == ("z", "rx", "ry") and near["conditioning"] > 0.5
    assert abs(near["det_A"]) > 0.1 and abs(near["det_B"]) > 0.1


@pytest.mark.parametrize("knee", [2.0, np.pi])
def test_a_3_rrs_is_leg_singular_where_its_legs_are_stretched_whatever_its_reference(knee):
    """With a knee straight, hip and knee can turn against each other while the ball stands
    still."""
    robot, bent, straight = rrs(knee), rrs(2.0), rrs(np.pi)
    told = singularity(robot, robot.state(straight.home.positions))
    assert told.kinds == ("I",) and "held still" in told.message
    assert singularity(robot, robot.state(bent.home.positions)).kinds == ()


def test_a_flat_rhombus_of_rods_is_singular_in_its_loops():
    """A parallelogram linkage laid flat: both branches of its motion meet, Phi loses rank."""
    robot = lw.Robot(parallelogram())
    told = singularity(
        robot, robot.assemble({"crank": 0.0}, guess=robot.assemble({"crank": 0.05})), what=("y",)
    )
    assert "constraint" in told.kinds
    assert singularity(robot, robot.assemble({"crank": 1.0}), what=("y",)).kinds == ()


def parallelogram():
    rod = lw.Body(mass=1, inertia=lw.Inertia(zz=0.1))
    joints = {
        "crank": lw.RevoluteJoint(connects=("ground", "left")),
        "rocker": lw.RevoluteJoint(
            connects=("ground", "right"), frames=(lw.Frame.planar(2.0), lw.Frame())
        ),
        "pin": lw.RevoluteJoint(
            connects=("left", "coupler"), frames=(lw.Frame.planar(1.0), lw.Frame())
        ),
        "joint": lw.RevoluteJoint(
            connects=("coupler", "right"), frames=(lw.Frame.planar(2.0), lw.Frame.planar(1.0))
        ),
    }
    return lw.Mechanism(
        bodies={"left": rod, "right": rod, "coupler": rod},
        joints=joints,
        actuators=("crank",),
        tools={"pin": lw.Tool(body="left", frame=lw.Frame.planar(1.0))},
        reference={"crank": 1.0, "rocker": 1.0, "pin": -1.0, "joint": 1.0},
    )


def test_along_a_motion_crossings_and_distances_are_told():
    """The platform of a 3-RPR turns through the singular angle zero at a known time; the way to it
    is length times angle."""
    robot, length = built("rpr3"), 0.2
    middle = np.array([0.5, 0.5 / np.sqrt(3)])
    angles = np.linspace(0.3, -0.2, 26)
    states = robot.assemble(tool=[[*middle, angle] for angle in angles])
    told = along(robot, states, length=length)
    at = np.interp(told.crossings, np.arange(26), angles)
    np.testing.assert_allclose(at, [0.0], atol=1e-9)
    assert told.leg_crossings.size == 0
    near = np.abs(angles) < 0.03
    np.testing.assert_allclose(
        told.tool_distance[near], length * np.abs(angles[near]), rtol=2e-3, atol=1e-12
    )
    assert told.tool_distance.attrs["units"] == "m"


def test_a_row_that_vanishes_in_vain_is_no_crossing_and_a_stretched_leg_is_one():
    """The links of a Tripteron's leg turn by more than 90 deg together, where a row of its last
    hinge vanishes; then a leg passes its stretched pose, at the elbow's -90 deg."""
    robot, turned = built("tripteron"), [built("tripteron").home]
    for part in np.linspace(0, 1, 21)[1:]:
        pose = part * np.array([-0.16, 0.25, -0.34])
        turned.append(robot.assemble(tool=pose, guess=turned[-1]))
    assert turned[-1]["root_2"] + turned[-1]["elbow_2"] > np.pi / 2
    told = along(robot, robot.state(np.array([state.positions for state in turned])))
    assert told.crossings.size == told.leg_crossings.size == 0
    np.testing.assert_allclose(told.det_A, told.det_B)
    last = along(robot, robot.state(turned[-1].positions[None]))
    np.testing.assert_allclose(last.det_B, told.det_B[-1:])
    assert told.actuator_distance[-1] > 0.03
    elbow, bent = np.linspace(-1.3, -1.8, 21), [robot.home]
    for angle in [-0.5, -1.0, *elbow]:
        asked = {"elbow_1": angle, "slide_1": 0.0, "slide_2": 0.05}
        bent.append(robot.assemble(asked, guess=bent[-1]))
    told = along(robot, robot.state(np.array([state.positions for state in bent[3:]])))
    at = np.interp(told.leg_crossings, np.arange(21), elbow)
    np.testing.assert_allclose(at, [-np.pi / 2], atol=2e-3)


@pytest.mark.parametrize("first", [0, 3])
def test_ways_are_told_in_radians_where_all_coordinates_turn(first):
    """A wrist has turns alone; a hinge on a Tripteron turns where others slide, in any order."""
    robot = built("agile_wrist")
    told = along(robot, robot.make_state(robot.home.q[None], np.zeros((1, 3))))
    assert told.tool_distance.attrs["units"] == told.actuator_distance.attrs["units"] == "rad"
    scara = lw.Robot(mixed_freedoms.scara())
    order = np.roll(scara.actuators, first)
    scara = lw.Robot(scara.mechanism.model_copy(update={"actuators": tuple(map(str, order))}))
    told = along(scara, scara.make_state(scara.home.q[None], np.zeros((1, 4))))
    assert told.tool_distance.attrs["units"] == told.actuator_distance.attrs["units"] == "m"


def test_a_zero_that_falls_on_a_sample_is_found_too():
    x = np.arange(5.0)
    np.testing.assert_allclose(zeros(x, np.array([2.0, 1.0, 0.0, -1.0, 1.0])), [2.0, 3.5])
    np.testing.assert_allclose(zeros(x, np.array([0.0, 1.0, np.nan, -1.0, 0.0])), [0.0, 4.0])


def test_along_a_run_the_times_are_the_run_s():
    robot = built("five_bar")
    run = robot.simulate(robot.home, [0.1, -0.1], duration=0.2, save_at=np.linspace(0, 0.2, 5))
    told = along(robot, run)
    np.testing.assert_allclose(told.time, np.linspace(0, 0.2, 5))
    np.testing.assert_allclose(told.det_A[0], 1, rtol=1e-9)


def test_the_way_to_a_leg_singularity_is_that_of_the_elbow():
    robot = arm()
    states = robot.state({"hinge_1": [0.2, 0.2], "hinge_2": [0.02, 0.05]})
    np.testing.assert_allclose(along(robot, states).actuator_distance, [0.02, 0.05], rtol=1e-2)


@pytest.mark.parametrize(
    ("ask", "told"),
    [
        (lambda: singularity(built("bricard"), built("bricard").home), "names no tool"),
        (
            lambda: singularity(arm(), arm().state({"hinge_1": [0, 0], "hinge_2": [1, 2]})),
            "not of a stack",
        ),
        (lambda: singularity(built("five_bar"), built("prr3").home), "another robot"),
        (lambda: along(built("five_bar"), built("five_bar").home), "one leading dimension"),
        (lambda: loci(workspace(arm(), {"x": 1.0, "y": [0.1, 0.2]})), "no quantity over two axes"),
    ],
)
def test_refusals(ask, told):
    with pytest.raises(lw.LinkworkError, match=told) as refusal:
        ask()
    assert "\n" not in str(refusal.value)


def test_a_singular_reference_does_not_hinder():
    """The base and the platform of a 3-RPR drawn alike, one over the other: actuator-singular as it
    is described."""
    corners = np.array([(0.0, 0.0), (1.0, 0.0), (0.5, 3**0.5 / 2)])
    robot = rpr(corners, 0.2 * (corners - corners.mean(axis=0)), (*corners.mean(axis=0), 0.0))
    assert singularity(robot, robot.home).kinds == ("II",)
    double = built("double_pendulum")
    assert singularity(double, double.state({"hinge_1": 0.3, "hinge_2": 0.0})).kinds == ("I",)
