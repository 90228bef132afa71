"""CasADi functions against the robot's own methods, differences, and CasADi without Linkwork."""

import json
import subprocess
import sys
import textwrap
from functools import cache
from pathlib import Path

import casadi as ca
import numpy as np
import pytest

import linkwork as lw
from linkwork.errors import LinkworkError
from linkwork.export.parts import PARTS

from tests.catalogue import built
from tests.export.compiled import compiler, run
from tests.hostile.mechanisms import subjects
from tests.processes import PATIENCE
from tests.robot.test_bearings import slider_crank
from tests.robot.test_reactions import MIXED

ROBOTS = ["prr3", "delta", "stewart", "five_bar", "bricard", "flyball_governor"]
MATRICES = {"M", "S", "L", "T", "J", "Phi"}


@cache
def robot_of(name):
    return lw.Robot(MIXED[name]()) if name in MIXED else built(name)


@cache
def state_of(name, seed=5):
    """Return a state in motion, away from home but for mechanisms that are drawn by chance."""
    robot, random = robot_of(name), np.random.default_rng(seed)
    state = robot.home.with_rates(random.normal(size=robot.mobility))
    return state if name in MIXED else robot.simulate(state, duration=0.05, samples=2).final


def other_chart(robot, state):
    """Return the state in independent rates that are not those of home, where there are any."""
    backwards = tuple(reversed(range(robot.equations.nv)))
    return robot.in_chart(state, robot.chart.better(state.q, backwards).independent)


def expected(robot, state, u, dv):
    """Return what the robot's own methods give, by function and output."""
    kinetic, potential = robot.energy(state)
    poses = robot.body_poses(state)
    found = {
        "forward_dynamics": {"dv": robot.forward_dynamics(state, u)},
        "mass_matrix": {"M": robot.mass_matrix(state)},
        "coriolis": {"Cv": robot.coriolis(state)},
        "gravity": {"G": robot.gravity(state)},
        "passive_forces": {"f": robot.passive_forces(state)},
        "actuation": {"S": robot.actuation(state)},
        "energy": {"kinetic": kinetic, "potential": potential},
        "rate_map": {"L": robot.rate_map(state)},
        "twist_map": {"T": robot.twist_map(state)},
        "joint_rates": {"rates": robot.joint_rates(state)},
        "joint_accelerations": {"accelerations": robot.joint_accelerations(state, dv)},
        "body_poses": {
            "origins": np.array([p for p, _ in poses.values()]).T,
            "orientations": np.hstack([R for _, R in poses.values()]),
        },
        "twists": {"twists": robot.twists(state).T},
        "reactions": {"wrenches": robot.reactions(state, u).wrenches.T},
    }
    if robot.mechanism.tools:
        found |= {
            "tool_pose": {"pose": robot.tool_pose(state)},
            "tool_twist": {"twist": robot.tool_twist(state)},
            "tool_acceleration": {"acceleration": robot.tool_acceleration(state, dv)},
        }
    if robot.task:
        J = robot.jacobian(state)
        found |= {
            "task_values": {"x": robot.task_values(state)},
            "jacobian": {"J": J},
            "jacobian_rate": {"dJ v": robot.task_accelerations(state, dv) - J @ dv},
        }
    return found


@pytest.mark.sample(2)
@pytest.mark.parametrize(
    ("name", "chart"),
    [(name, "home") for name in [*ROBOTS, "geared loop with a rod"]]
    + [(name, "other") for name in ("prr3", "delta", "bricard")],
)
def test_functions_give_the_numbers_of_the_robot(name, chart):
    robot, state = robot_of(name), state_of(name)
    own = robot.in_chart(state, robot.independent) if chart == "home" else None
    state = own or other_chart(robot, state)
    random = np.random.default_rng(8)
    dv, u = random.normal(size=robot.mobility), random.normal(size=len(robot.actuators))
    functions = robot.functions(robot.independent if chart == "home" else state)
    assert functions.independent == state.independent
    given = {"q": state.q, "v": state.rates, "u": u, "dv": dv}
    for function, outputs in expected(robot, state, u, dv).items():
        f = functions[function]
        found = f(**{each: given[each] for each in f.name_in()})
        for output, wanted in outputs.items():
            value = found["dJ"] @ state.rates if output == "dJ v" else found[output]
            value = np.array(value) if np.ndim(wanted) == 2 else np.array(value).ravel()
            scale = max(1.0, np.abs(wanted).max(initial=0.0))
            assert value.shape == np.shape(np.atleast_1d(wanted))
            error = np.abs(value - wanted).max(initial=0.0)
            assert error < (1e-9 if function == "reactions" else 1e-11) * scale, (function, output)


def test_reactions_that_are_left_open_are_told_alike_whatever_free_numbers_are():
    """Which wrenches are the least depends on a length, which is that of the robot's own numbers:
    in the functions, of a robot with other numbers, and in runs with them."""
    mechanism = lw.robots.four_bar().model_copy(update={"gravity": (1.0, -9.0, -4.0)})
    robot = lw.Robot(mechanism).free("rocker_pivot.frames.0.position.x")
    longer = {path: 1.3 * value for path, value in robot.parameters.items()}
    other = robot.with_parameters(longer)
    state = other.state(other.home.positions, [2.0])
    u = np.ones(len(robot.actuators))
    own, function = other.reactions(state, u), robot.functions().reactions
    assert own.indeterminate and np.abs(own.wrenches[:, :2]).max() > 0.1
    found = function(state.q, state.rates, u, list(longer.values()))[0].full().T
    np.testing.assert_allclose(found, own.wrenches, rtol=1e-9, atol=1e-9)
    run = robot.simulate(state, u, duration=0.01, save_at=[0.0], parameters=longer)
    np.testing.assert_allclose(run.reactions().values[0], own.wrenches, rtol=1e-9, atol=1e-9)


def test_reactions_of_a_mechanism_of_micrometres():
    """Their equations are written without units."""
    robot = subjects()["five bar x1e-06 m x1 kg"].robot
    state, u = robot.home.with_rates([3.0, -2.0]), np.array([1e-12, 2e-12])
    found = np.array(robot.functions().reactions(state.q, state.rates, u)[0])
    wanted = robot.reactions(state, u).wrenches.T
    for rows in (slice(3), slice(3, 6)):
        assert np.abs(found[rows] - wanted[rows]).max() < 1e-12 * np.abs(wanted[rows]).max()


def test_reactions_in_rates_of_a_body_that_no_joint_hangs_in_the_ground():
    """The tree lets the platform float; its rates are no joint's. Its mass centre is aside."""
    robot = built("rrs3").free("platform.com.x", "platform.mass")
    robot = robot.with_parameters({"platform.com.x": 0.07})
    state, u = robot.home.with_rates([0.2, -0.1, 0.3]), np.array([1.0, -2.0, 3.0])
    for chart in (
        ("platform.z", "platform.wx", "platform.wy"),
        ("motor_1", "platform.wy", "knee_3"),
    ):
        own = robot.in_chart(state, chart)
        found, _ = robot.functions(own).reactions(own.q, own.rates, u, robot.p)
        wanted = robot.reactions(own, u).wrenches.T
        np.testing.assert_allclose(np.array(found), wanted, atol=1e-12 * np.abs(wanted).max())


@pytest.mark.parametrize("name", ["prr3", "delta"])
def test_inverse_dynamics_is_the_inverse_of_forward_dynamics(name):
    robot, state = robot_of(name), state_of(name)
    functions = robot.functions(other_chart(robot, state))
    state, u = other_chart(robot, state), np.linspace(-1.0, 2.0, len(robot.actuators))
    _, dv, _ = functions.forward_dynamics(state.q, state.rates, u)
    found, pivot = functions.inverse_dynamics(state.q, state.rates, dv)
    np.testing.assert_allclose(np.array(found).ravel(), u, atol=1e-8)
    assert float(pivot) > 0


def test_loops_stay_closed_along_the_rates_of_the_coordinates():
    """q' of forward dynamics and of `coordinate_rates` are equal, and Phi w = 0 along them."""
    robot, state = robot_of("delta"), state_of("delta")
    functions = robot.functions(state)
    dq, _ = functions.coordinate_rates(state.q, state.rates)
    whole = functions.forward_dynamics(state.q, state.rates, [0, 0, 0])[0]
    np.testing.assert_allclose(np.array(dq), np.array(whole), rtol=1e-13, atol=1e-15)
    phi = functions.closure(state.q)[0]
    moved = functions.closure(state.q + 1e-6 * np.array(dq).ravel())[0]
    assert float(ca.norm_inf(moved - phi)) < 1e-9
    opened = state.q + 1e-4
    closed, residual = functions.closure_step(opened)
    assert float(functions.closure_step(closed)[1]) < 1e-3 * float(residual)


@pytest.mark.parametrize("name", ["prr3", "delta", "geared loop with a rod"])
def test_derivatives_are_those_of_differences(name):
    robot, state = robot_of(name), state_of(name)
    functions, u = robot.functions(state), np.ones(len(robot.actuators))
    f = functions.forward_dynamics
    jacobian = f.factory("J", f.name_in(), ["jac:dv:q", "jac:dv:v", "jac:dv:u"])
    given = [state.q, state.rates, u]
    for place, J in enumerate(jacobian(*given)):
        for k in range(len(given[place])):
            sides = []
            for step in (1e-5, -1e-5):
                moved = [np.array(each) for each in given]
                moved[place][k] += step
                sides.append(np.array(f(*moved)[1]).ravel())
            wanted = (sides[0] - sides[1]) / 2e-5
            scale = max(1.0, np.abs(wanted).max())
            np.testing.assert_allclose(np.array(J)[:, k], wanted, atol=1e-6 * scale)


def test_derivatives_with_respect_to_free_numbers():
    """Against the derivation with other numbers; what is not free is folded in."""
    paths = "platform.mass", "link_1.com.x", "gravity.y"
    robot = lw.Robot("prr3").free(*paths)
    functions = robot.functions()
    f, state = functions.forward_dynamics, robot.home.with_rates([0.3, -0.2, 0.4])
    assert f.name_in() == ["q", "v", "u", "p"] and list(functions.parameters) == list(paths)
    given = [state.q, state.rates, [1.0, 2.0, 3.0]]
    J = np.array(f.factory("J", f.name_in(), ["jac:dv:p"])(*given, robot.p))
    for k, path in enumerate(paths):
        sides = []
        for step in (1e-5, -1e-5):
            other = robot.with_parameters({path: robot.parameters[path] + step})
            own = other.assemble({name: state[name] for name in robot.actuators})
            own = own.with_rates(state.rates)
            sides.append(other.forward_dynamics(own, given[-1]))
        np.testing.assert_allclose(J[:, k], (sides[0] - sides[1]) / 2e-5, rtol=1e-6, atol=1e-7)
    assert "p" in functions.closed.name_in() and "p" in functions.reactions.name_in()
    wrenches, _ = functions.reactions(*given, robot.p)
    wanted = robot.reactions(state, given[-1]).wrenches.T
    np.testing.assert_allclose(np.array(wrenches), wanted, atol=1e-11)


@pytest.mark.parametrize("name", ["prr3", "delta", "stewart", "bricard", "pendulum"])
def test_closed_is_the_assembled_configuration(name):
    """With dq/da = N L, whatever the guess."""
    robot = built(name)
    functions = robot.functions()
    labels = [label for label, _ in functions.arrays["a"]]
    a = np.array([robot.home[label] for label in labels]) + 0.05 * robot.size
    state = robot.assemble(dict(zip(labels, a, strict=True)))
    found = np.array(functions.closed(a, robot.home.q)).ravel()
    np.testing.assert_allclose(found, state.q, atol=1e-11)
    J = functions.closed.factory("J", ["a", "guess"], ["jac:q:a"])(a, robot.home.q)
    columns = [functions.coordinate_rates(state.q, e)[0] for e in np.eye(robot.mobility)]
    np.testing.assert_allclose(np.array(J), np.array(ca.horzcat(*columns)), atol=1e-9)


@pytest.mark.parametrize("name", ["prr3", "five_bar", "stewart", "puma560"])
def test_joints_of_the_tool(name):
    """Against the assembled configuration, with dq/dx = N L J^-1 (of a whole rotation in the
    directions of the angular velocity, of which the first three coordinates have none)."""
    robot = built(name)
    functions = robot.functions()
    x = robot.task_values(robot.home) + 0.02
    state = robot.assemble(tool=x)
    found = np.array(functions.tool_to_joints(x, robot.home.q)).ravel()
    np.testing.assert_allclose(found, state.q, atol=1e-10)
    f = functions.tool_to_joints.factory("J", ["x", "guess"], ["jac:q:x"])
    J = np.array(f(x, robot.home.q))[:, :2]
    rates = np.linalg.solve(np.array(functions.jacobian(state.q)[0]), np.eye(len(x))[:, :2])
    columns = [functions.coordinate_rates(state.q, v)[0] for v in rates.T]
    np.testing.assert_allclose(J, np.array(ca.horzcat(*columns)), atol=1e-8)


def test_a_tool_that_does_not_lead_all_freedoms():
    stiff = lw.Robot(lw.robots.delta(rod_mass=0.1, idle_spins=True)).functions()
    assert "tool_to_joints is not defined" in stiff.missing["tool_to_joints"]


def test_closed_fails_where_the_loops_do_not_close():
    functions = built("prr3").functions()
    with pytest.raises(RuntimeError):
        functions.closed([3.0, 0.5, 0.5], built("prr3").home.q)


def test_functions_are_saved_and_run_without_linkwork(tmp_path):
    robot, state = built("prr3"), state_of("prr3")
    names = ["forward_dynamics", "closed", "reactions", "jacobian_rate"]
    path = robot.functions().save(tmp_path / "prr3.casadi", names)
    state = robot.in_chart(state, robot.independent)
    program = f"""
        import json, sys
        import casadi
        file = casadi.FileDeserializer({str(path)!r})
        functions = {{f.name(): f for f in file.unpack()}}
        told = json.loads(file.unpack())
        q, v, u = {state.q.tolist()}, {state.rates.tolist()}, [1.0, 2.0, 3.0]
        dv = functions["forward_dynamics"](q=q, v=v, u=u)["dv"]
        assert "linkwork" not in sys.modules
        print(json.dumps([[*functions], dv.full().ravel().tolist(), told]))
    """
    out = subprocess.run(
        [sys.executable, "-c", textwrap.dedent(program)],
        capture_output=True,
        text=True,
        timeout=PATIENCE,
        check=True,
    )
    found, dv, told = json.loads(out.stdout)
    assert found == names
    np.testing.assert_allclose(dv, robot.forward_dynamics(state, [1.0, 2.0, 3.0]), rtol=1e-12)
    assert told["name"] == "3-PRR" and told["arrays"]["v"][0] == ["slide_1", "m/s"]


def test_maps_and_generated_code(tmp_path):
    """`map` and C of CasADi's own, of parts, of Newton's method and of a system of equations."""
    robot, state = built("prr3"), state_of("prr3")
    functions, u = robot.functions(state), [1.0, 2.0, 3.0]
    many = functions.forward_dynamics.map(3)(
        ca.repmat(state.q, 1, 3), ca.repmat(state.rates, 1, 3), ca.DM([u, [0, 0, 0], u]).T
    )[1]
    assert np.array_equal(np.array(many[:, 0]), np.array(many[:, 2]))
    np.testing.assert_allclose(
        np.array(many[:, 1]).ravel(), robot.forward_dynamics(state, [0, 0, 0]), rtol=1e-12
    )
    a = [state[label] for label, _ in functions.arrays["a"]]
    given = {
        "forward_dynamics": (state.q, state.rates, u),
        "reactions": (state.q, state.rates, u),
        "closed": (a, robot.home.q),
    }
    code = ca.CodeGenerator("own.c")
    for name in given:
        code.add(functions[name])
    code.generate(f"{tmp_path}/")
    library = tmp_path / "own.so"
    run([*compiler("gcc"), "-O0", "-shared", "-fPIC", "-o", library, tmp_path / "own.c", "-lm"])
    for name, values in given.items():
        found = ca.external(name, str(library)).call(values)
        for own, wanted in zip(found, functions[name].call(values), strict=True):
            np.testing.assert_allclose(np.array(own), np.array(wanted), rtol=1e-9, atol=1e-9)


def test_what_is_there_fits_a_screen():
    functions = built("prr3").functions()
    shown = repr(functions)
    assert len(shown.splitlines()) <= 40 and max(map(len, shown.splitlines())) <= 100
    assert all(name in shown for name in PARTS) and list(functions) == list(PARTS)
    assert "q (7), v (3), u (3)" in shown
    sizes = functions.operations
    assert sizes["gravity"] < sizes["inverse_dynamics"] < sizes["forward_dynamics"] < 500
    assert functions["gravity"] is functions.gravity and "gravity" in dir(functions)
    assert not hasattr(functions, "motion") and "motion" not in functions
    with pytest.raises(AttributeError, match="there is no function 'motion'; there are"):
        _ = functions.motion


def test_the_how_to_names_every_function():
    page = Path(__file__).parents[2] / "docs/howto/optimal-control.md"
    assert not [name for name in PARTS if f"`{name}`" not in page.read_text(encoding="utf-8")]


def test_what_a_robot_lacks_is_left_out_and_said():
    functions = built("flyball_governor").functions()
    assert "inverse_dynamics" not in functions and "forward_dynamics" in functions
    assert "drive" in functions.missing["inverse_dynamics"]
    assert functions.get("inverse_dynamics") is None and functions.get("motion", 3) == 3
    assert functions.get("gravity") is functions.gravity
    assert "without inverse_dynamics" in repr(functions)
    bricard = built("bricard").functions()
    with pytest.raises(LinkworkError, match="names no tool"):
        bricard["jacobian"]
    free = lw.Robot(lw.robots.delta()).functions(("pose.x", "pose.y", "pose.z"))
    assert "closed" in free and free.forward_dynamics.size1_in("q") == 10


def test_bearings_in_rates_that_no_actuator_drives():
    """What is listed can be made; the friction in it is that of the robot."""
    robot = slider_crank()
    state = robot.in_chart(robot.home.with_rates([2.0]), ["pin"])
    functions = robot.functions(state)
    assert "inverse_dynamics" in robot.functions()
    assert "friction of bearings" in functions.missing["inverse_dynamics"]
    assert all(functions[name] is not None for name in functions)
    _, dv, _ = functions.forward_dynamics(state.q, state.rates, [0.5])
    np.testing.assert_allclose(float(dv), robot.forward_dynamics(state, [0.5])[0], rtol=1e-10)
    wrenches, _ = functions.reactions(state.q, state.rates, [0.5])
    wanted = robot.reactions(state, [0.5]).wrenches.T
    np.testing.assert_allclose(np.array(wrenches), wanted, atol=1e-10 * np.abs(wanted).max())


def test_friction_by_bristles_is_that_of_steady_sliding_and_said():
    joint = lw.RevoluteJoint(
        connects=("ground", "arm"),
        friction=lw.Friction(coulomb=1.0, bristle=lw.Bristle(stiffness=1e4)),
    )
    body = lw.Body(mass=1.0, centre_of_mass=(0.5, 0, 0), inertia=lw.Inertia(zz=0.1))
    robot = lw.Robot(
        lw.Mechanism(bodies={"arm": body}, joints={"hinge": joint}, actuators=("hinge",))
    )
    functions = robot.functions()
    assert "hinge" in functions.notes[0] and "bristles" in repr(functions)
    state = robot.state([0.3], [1.0])
    _, dv, _ = functions.forward_dynamics(state.q, state.rates, [2.0])
    np.testing.assert_allclose(float(dv), robot.forward_dynamics(state, [2.0])[0], rtol=1e-12)


def test_drives_of_the_description_are_said_to_be_left_out():
    joint = lw.RevoluteJoint(connects=("ground", "arm"))
    body = lw.Body(mass=1.0, centre_of_mass=(0.5, 0, 0), inertia=lw.Inertia(zz=0.1))
    drives = {"hinge": {"type": "servo", "gain": 5.0}}
    parts = {"bodies": {"arm": body}, "joints": {"hinge": joint}, "actuators": ("hinge",)}
    robot = lw.Robot(lw.Mechanism(drives=drives, **parts))
    said = "the drives of hinge are no part of {} are the forces"
    assert robot.functions().notes == (said.format("the functions: u"),)
    assert said.format("the C: u") in lw.export.c(robot, ["motion"]).notes
    assert said.format("the FMU: its inputs") in lw.export.fmu(robot, platforms=()).notes


@pytest.mark.parametrize(
    ("ask", "sentence"),
    [
        (lambda: lw.export.casadi("prr3"), "the robot is 'prr3'; give a linkwork.Robot"),
        (lambda: built("prr3").functions("slide_1"), "independent is 'slide_1'; give a list"),
        (lambda: built("prr3").functions(["slide_1", "slide_2", "no"]), "no"),
        (lambda: built("prr3").functions(["slide_1"]), "slide_1"),
        (lambda: built("prr3").functions(7), "independent is 7; give a list of names"),
        (lambda: built("prr3").functions(built("delta").home), "another robot"),
        (lambda: built("prr3").functions()["motion"], "there is no function 'motion'; there are"),
        (lambda: built("prr3").functions().save(3), "the path to save to is 3"),
        (lambda: built("prr3").functions().save("f", "gravity"), "give a list of names"),
        (lambda: built("prr3").functions().save("no/f", ["gravity"]), "cannot be written"),
        (lambda: built("prr3").functions().save(".", ["gravity"]), "written (Is a directory)"),
    ],
)
def test_refusals(ask, sentence, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    with pytest.raises(LinkworkError) as caught:
        ask()
    assert sentence in str(caught.value) and "\n" not in str(caught.value)
