"""Refusals that need the geometry: out of reach, open, singular, another robot's; each one sentence
that names the place."""

import inspect

import numpy as np
import pytest

import linkwork as lw
from linkwork import analysis, design, export, formats, motions, views
from linkwork.mechanism import Mechanism
from linkwork.robot import Robot, SingularError, UnreachableError
from linkwork.robots import prr3


@pytest.fixture(scope="module")
def robot():
    return Robot(prr3())


def refused(sentence, function, *arguments, **keywords):
    with pytest.raises(lw.LinkworkError) as refusal:
        function(*arguments, **keywords)
    assert sentence in str(refusal.value), str(refusal.value)
    assert "\n" not in str(refusal.value)


def test_poses_out_of_reach(robot):
    with pytest.raises(
        UnreachableError, match=r"cannot be assembled with the tool at \[3.0, 0.0, 0.0\]"
    ):
        robot.assemble(tool=[3, 0, 0])
    refused(
        "cannot be assembled with slide_1 = 5",
        robot.assemble,
        {"slide_1": 5, "slide_2": 0.1, "slide_3": 0.1},
    )


def test_values_out_of_reach_in_other_units(robot):
    """Millimetres and degrees are asked after, of the tool and of joints, alone and in stacks."""
    delta = lw.Robot("delta")
    refused("-900 m is 723 times the mechanism's own length", delta.assemble, tool=[0, 0, -900])
    both = [[0, 0, -1], [0, 0, -900]]
    refused("is it in millimetres? give metres", delta.assemble, tool=both)
    refused("500 m is 378 times", robot.assemble, {"slide_1": 500, "slide_2": 0.1, "slide_3": 0.1})
    refused("30 rad is 4.77 turns; is it in degrees? give radians", robot.assemble, tool=[3, 0, 30])
    refused("choose a pose within reach", robot.assemble, tool=[30, 0, 3])


def test_numbers_that_are_not_finite(robot):
    refused(
        "positions[3] is nan; give finite numbers", robot.state, [0, 0, 0, np.nan, 0, 0, 0, 0, 0]
    )
    refused(
        "forces[1] is inf; give finite numbers", robot.forward_dynamics, robot.home, [0, np.inf, 0]
    )
    refused("accelerations[0] is nan", robot.inverse_dynamics, robot.home, [np.nan, 0, 0])
    refused("tool[0] is nan", robot.assemble, tool=[np.nan, 0, 0])
    refused("joint 'slide_1' is nan", robot.assemble, {"slide_1": np.nan})


@pytest.mark.parametrize(
    "values",
    [np.array([1.0 + 2.0j, 2.0, 3.0]), np.ma.array([1.0, 2.0, 3.0], mask=[0, 1, 0])],
    ids=["complex", "hidden by a mask"],
)
def test_numbers_that_are_not_real_or_are_hidden(robot, values):
    # NumPy drops the imaginary part with a warning, and the mask without one.
    stepper = robot.stepper(robot.home, 1e-3)
    for ask in (
        lambda: robot.forward_dynamics(robot.home, values),
        lambda: robot.inverse_dynamics(robot.home, values),
        lambda: robot.simulate(robot.home, duration=0.01, forces=values),
        lambda: robot.assemble(joints=dict(zip(robot.actuators, values[:, None], strict=True))),
        lambda: stepper.step(values),
        lambda: lw.paths.line(values, values),
        lambda: lw.Sampled([0.0, 1.0, 2.0], values),
    ):
        with pytest.raises(lw.LinkworkError, match="numbers"):
            ask()


def test_open_and_contradicting_states(robot):
    positions = robot.home.positions.copy()
    positions[0] += 0.01
    refused("the loops are open by 0.0", robot.state, positions)
    stacked = np.stack([robot.home.positions, positions])
    refused("the loops of state 1 are open by 0.0", robot.state, stacked)
    positions = robot.home.positions.copy()
    positions[7] += 0.1
    refused("joint 'wrist_2' is given as", robot.state, positions)
    positions = robot.home.positions.copy()
    positions[7] += 2 * np.pi
    robot.state(positions)


def test_an_open_state_is_closed_exactly_within_the_tolerance_that_is_asked(robot):
    positions = robot.home.positions.copy()
    positions[0] += 0.02
    assert robot.closure_error(robot.state(positions, tolerance=0.1)) < 1e-12


def test_quaternions():
    body = lw.Body(mass=1, inertia=lw.Inertia(xx=0.1, yy=0.1, zz=0.1))
    joints = {"ball": lw.SphericalJoint(connects=("ground", "body"))}
    robot = Robot(Mechanism(bodies={"body": body}, joints=joints))
    refused("ball", robot.state, [0, 0, 0, 0])
    refused("ball", robot.state, [[1, 0, 0, 0], [0, 0, 0, 0]])
    refused("'ball.qw' is part of a quaternion", robot.assemble, {"ball.qw": 1.0})
    assert np.allclose(robot.state([-3, 0, 0, 4]).positions, [-0.6, 0, 0, 0.8], atol=1e-15)


def test_states_of_another_robot(robot):
    other = Robot(
        lw.Mechanism(bodies={"rod": lw.Body(mass=1)}, joints=hinge(), actuators=("hinge",))
    )
    refused("the state belongs to another robot", robot.mass_matrix, other.home)


def hinge():
    return {
        "hinge": lw.RevoluteJoint(
            connects=("ground", "rod"), frames=(lw.Frame(), lw.Frame(position=(-1, 0, 0)))
        )
    }


def test_a_loop_whose_joints_lie_in_different_planes():
    bar = lw.Body(mass=1, inertia=lw.Inertia(zz=0.1))
    off = lw.Frame(position=(0.5, 0, 0.2))
    joints = {
        "a": lw.RevoluteJoint(connects=("ground", "left")),
        "b": lw.RevoluteJoint(connects=("left", "right"), frames=(lw.Frame.planar(1), lw.Frame())),
        "c": lw.RevoluteJoint(connects=("right", "ground"), frames=(lw.Frame.planar(1), off)),
    }
    refused(
        "the loop cannot close: position along the axis stays open by 0.2 in every configuration",
        Robot,
        Mechanism(bodies={"left": bar, "right": bar}, joints=joints),
    )


def test_zz_alone_is_refused_out_of_the_plane():
    joint = lw.RevoluteJoint(connects=("ground", "rod"), axis=(1, 0, 0))
    rod = lw.Body(mass=1, centre_of_mass=(0, 0.5, 0), inertia=lw.Inertia(zz=0.1))
    mechanism = lw.Mechanism(bodies={"rod": rod}, joints={"hinge": joint}, actuators=("hinge",))
    refused(
        "bodies.rod.inertia: gives only zz, but the mechanism can turn the body about other axes",
        Robot,
        mechanism,
    )


def slider_driven() -> Robot:
    """Return a slider-crank driven at the slider."""
    bar = lw.Body(mass=1, centre_of_mass=(0.5, 0, 0), inertia=lw.Inertia(zz=0.1))
    joints = {
        "crank": lw.RevoluteJoint(connects=("ground", "bar_1")),
        "knee": lw.RevoluteJoint(
            connects=("bar_1", "bar_2"), frames=(lw.Frame.planar(1), lw.Frame())
        ),
        "pin": lw.RevoluteJoint(
            connects=("bar_2", "slider"), frames=(lw.Frame.planar(1), lw.Frame())
        ),
        "slide": lw.PrismaticJoint(connects=("ground", "slider"), axis=(1, 0, 0)),
    }
    bodies = {"bar_1": bar, "bar_2": bar, "slider": lw.Body(mass=1, inertia=lw.Inertia(zz=0.1))}
    reference = {"crank": 0.5, "knee": -1.0, "pin": 0.5, "slide": 1.7}
    return Robot(Mechanism(bodies=bodies, joints=joints, actuators=("slide",), reference=reference))


def test_actuator_singular_configurations_are_named_and_runs_pass_them():
    """Where crank and rod are stretched the slider's rate does not determine the others; the motion
    goes on all the same."""
    robot = slider_driven()
    stretched = robot.state({"crank": 0, "knee": 0, "pin": 0, "slide": 2})
    for asked in (robot.forward_dynamics, robot.inverse_dynamics):
        with pytest.raises(
            SingularError, match=r"is singular .* with slide locked the mechanism can still move"
        ):
            asked(stretched, [1.0])
    both = robot.state(np.stack([robot.home.positions, stretched.positions]))
    with pytest.raises(SingularError, match="the configuration of state 1 is singular"):
        robot.mass_matrix(both)
    run = robot.simulate(robot.home.with_rates([1.0]), duration=1.0)
    assert run.status is lw.Status.FINISHED
    crank, slide = (
        run["joint_position"].values[:, robot.coordinates.index(name)]
        for name in ("crank", "slide")
    )
    assert crank[0] > 0.4
    assert crank[-1] < -0.4
    assert slide.max() > 1.99


def test_leg_singular_paths_are_refused(robot):
    """Where link 1 stands across its rail, the slider's motion along the rail does not follow from
    the platform's."""
    angle, vertex = 0.7, np.array([0.4, 0.3])
    centre = vertex + 0.15 * np.array([np.cos(angle), np.sin(angle)])
    upright = robot.assemble({"pivot_1": np.pi / 2, "slide_1": 0.4, "wrist_1": angle - np.pi / 2})
    assert np.allclose(robot.tool_pose(upright), [*centre, angle], atol=1e-12)
    path = lw.paths.line([*centre, angle], [*(centre - [0, 0.05]), angle], law=lw.paths.uniform)
    refused(
        "at t = 0 s: the configuration is leg-singular",
        robot.follow,
        path,
        duration=1.0,
        guess=upright,
    )


def test_paths(robot):
    path = lw.paths.line([0.5, 0.29, 0.5], [0.5, 2.0, 0.5])
    refused("at t = ", robot.follow, path, duration=1.0)
    refused(
        "the path prescribes 2 coordinates of the tool, but the mobility is 3",
        robot.follow,
        lw.paths.circle([0.5, 0.3], 0.1),
        1.0,
    )
    refused("the duration is -1", robot.follow, path, duration=-1)
    refused("at least 2, not 1", robot.follow, path, duration=1, samples=1)
    refused("the centre is [1.0]", lw.paths.circle, [1.0], 1.0)
    refused("needs at least 4", lw.paths.through, [[0, 0], [1, 1]])


def test_what_the_description_lacks():
    refused("names no tool; add one", Robot(lw.robots.bricard()).assemble, tool=[1, 2, 3])
    rod = lw.Body(mass=0, centre_of_mass=(0.2, 0, 0))
    massless = Robot(Mechanism(bodies={"rod": rod}, joints=hinge(), actuators=("hinge",)))
    refused("the generalised inertia is singular", massless.forward_dynamics, massless.home, [1.0])


def test_forces_of_a_mechanism_without_actuators_are_an_empty_list():
    free = Robot(lw.robots.pendulum().model_copy(update={"actuators": ()}))
    assert free.forward_dynamics(free.home, []).shape == (1,)
    with pytest.raises(lw.LinkworkError, match=r"shape \(1,\); there are none here: give \[\]"):
        free.forward_dynamics(free.home, [1.0])


def test_robots_that_look_alike(robot):
    longer = Robot(prr3(l1=0.35))
    refused("its loops are open by", robot.gravity, longer.home)
    other = Robot(prr3().model_copy(update={"actuators": ("pivot_1", "slide_2", "slide_3")}))
    refused("its rates are those of pivot_1", robot.gravity, other.home)
    same = Robot(prr3())
    assert np.array_equal(robot.mass_matrix(same.home), robot.mass_matrix(robot.home))


@pytest.mark.parametrize("module", [analysis, design, export, formats, motions, views])
def test_arguments_that_are_swapped(robot, module):
    """Whatever works on a robot, a mechanism or a map says so where it is given something else."""
    for name in module.__all__:
        function = getattr(module, name)
        if not inspect.isfunction(function) or function is lw.analysis.linearise:  # robot.linearise
            continue
        wanted = list(inspect.signature(function).parameters.values())
        if wanted[0].name in ("robot", "mechanism", "drawn") or name == "plot_workspace":
            needed = [each for each in wanted if each.default is each.empty]
            given = {each.name: robot.home for each in needed if "*" not in str(each)}
            refused("State", function, **given)


def test_numbers_that_are_not_free(robot):
    one = {"platform.mass": [1.0]}
    refused("robot.free makes one", robot.ensemble, robot.home, parameters=one, duration=0.1)
    refused("free is 'platform.mass'; give a list of names", lw.Robot, "prr3", free="platform.mass")


def test_a_path_of_a_robot_with_more_freedoms_than_a_pose_is_not_told_to_prescribe_them_all():
    bodies, joints, last = {}, {}, "ground"
    for k in range(4):
        bodies[f"link_{k}"] = lw.Body(
            mass=1.0, centre_of_mass=(0.2, 0, 0), inertia=lw.Inertia(zz=0.1)
        )
        seat = lw.Frame(position=(0.4 * (k > 0), 0, 0))
        connects = (last, f"link_{k}")
        joints[f"hinge_{k}"] = lw.RevoluteJoint(connects=connects, frames=(seat, lw.Frame()))
        last = f"link_{k}"
    tools = {"tip": lw.Tool(body=last)}
    robot = lw.Robot(
        lw.Mechanism(bodies=bodies, joints=joints, actuators=list(joints), tools=tools)
    )
    told = "but the mobility is 4, more than the 3 that lead a tool; simulate it with a controller"
    with pytest.raises(lw.LinkworkError, match=told):
        robot.follow(lw.paths.line((1.0, 0.2), (1.0, 0.3)), 1.0, what=("x", "y"))
