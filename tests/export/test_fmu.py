"""FMUs beside the robot's own runs, by FMPy: descriptions, simulations, derivatives, saved states,
charts, parameters."""

from functools import cache

import fmpy
import numpy as np
import pytest
from fmpy.validation import validate_fmu

import linkwork as lw

from tests.catalogue import WHOLE, built
from tests.export import fmus
from tests.export.fmus import Instance
from tests.export.test_motions import rubbed
from tests.robot.test_gear_powers import lift
from tests.robot.test_reactions import MIXED

BODY = lw.Body(mass=1.0, inertia=lw.Inertia(xx=0.1, yy=0.2, zz=0.3))
FREE = lw.FreeJoint(connects=("ground", "body"))
EVERYTHING = ["positions", "rates", "accelerations", "tool", "twist", "reactions", "closure"]
KINDS = ("CoSimulation", "ModelExchange")


def top() -> lw.Robot:
    return lw.Robot(lw.Mechanism(name="top 1", bodies={"body": BODY}, joints={"the base": FREE}))


def crank() -> lw.Robot:
    """A crank that is told by the rate of its slider, which says nothing of it at dead centres."""
    return lw.Robot(lw.robots.slider_crank(), independent=["slide"])


@cache
def own(name: str) -> lw.export.FmuExport:
    """Return the FMU of a robot of the catalogue that tells all that it can."""
    robot = built(name)
    return export(
        robot, outputs=[each for each in EVERYTHING if robot.mechanism.tools or each[0] != "t"]
    )


def export(robot: lw.Robot, version: str = "3.0", outputs=None) -> lw.export.FmuExport:
    return lw.export.fmu(robot, version, outputs=outputs, platforms=())  # pyright: ignore


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return tmp_path_factory.mktemp("fmus")


def simulated(file, kind: str, duration: float, tolerance: float, **values: float):
    description = fmpy.read_model_description(str(file))
    told = [v.name for v in description.modelVariables if v.causality == "output"]
    return fmpy.simulate_fmu(
        str(file),
        fmi_type=kind,
        stop_time=duration,
        output_interval=duration / 10,
        relative_tolerance=tolerance,
        start_values=values,
        output=told,
        logger=lambda *said: None,
    )


@pytest.mark.long
@pytest.mark.parametrize(
    ("name", "version"),
    [
        ("prr3", "3.0"),
        ("double_pendulum", "2.0"),
        ("five_bar", "2.0"),
        ("spatial_slider_crank", "3.0"),
    ],
)
def test_simulations_are_those_of_runs(name, version, folder):
    robot = built(name)
    file = fmus.built(own(name) if version == "3.0" else export(robot, version), folder)
    assert validate_fmu(str(file)) == []
    u, rates = (np.linspace(low, 1.0, len(robot.actuators)) for low in (0.5, 0.2))
    state = robot.state(robot.home.positions, dict(zip(robot.independent, rates, strict=False)))
    expected = robot.simulate(state, u, duration=0.2, rtol=1e-11, atol=1e-12).final
    given = {f"force.{each}": x for each, x in zip(robot.actuators, u, strict=True)}
    given |= {
        f"start_rate.{each}": x for each, x in zip(robot.independent, state.rates, strict=True)
    }
    for kind, tolerance, close in zip(KINDS, (1e-9, 1e-8), (1e-7, 2e-5), strict=True):
        found = simulated(file, kind, 0.2, tolerance, **given)
        positions = [found[f"joint.{each}"][-1] for each in robot.coordinates]
        speeds = [found[f"rate.{each}"][-1] for each in robot.rates]
        size = 1.0 + np.abs(robot.joint_rates(expected)).max()
        np.testing.assert_allclose(positions, expected.positions, atol=close)
        np.testing.assert_allclose(speeds, robot.joint_rates(expected), atol=close * size)
        if kind == "CoSimulation":
            assert found["closure_error"].max() < 1e-12


@pytest.mark.long
@pytest.mark.parametrize("version", ["3.0", "2.0"])
def test_charts_change_by_events(version, folder):
    """A crank that turns on past its dead centres: the co-simulation and the model exchange follow
    the run, and each change is an event."""
    robot = crank()
    file = fmus.built(export(robot, version), folder)
    fast = robot.state(robot.home.positions, {"slide": 3.0})
    expected = robot.simulate(fast, duration=0.5, rtol=1e-11, atol=1e-12).final
    for kind, close in zip(KINDS, (1e-6, 1e-4), strict=True):
        found = simulated(file, kind, 0.5, 1e-10, **{"start_rate.slide": 3.0})
        positions = [found[f"joint.{each}"][-1] for each in robot.coordinates]
        np.testing.assert_allclose(positions, expected.positions, atol=close)
    assert abs(expected.positions[0]) > 2 * np.pi
    one, changes = Instance(file), 0
    one.go(start_rate__slide=3.0)
    for k in range(2000):
        one.put(one.states() + 1e-4 * one.rates())
        one.own.setTime(k * 1e-4)
        before = one.get("joint.crank", "rate.crank")
        due = one.own.completedIntegratorStep()
        due = due[0] if isinstance(due, tuple) else due
        if due:
            one.own.enterEventMode()
            assert one.update()
            one.own.enterContinuousTimeMode()
            changes += 1
            np.testing.assert_allclose(one.get("joint.crank", "rate.crank"), before, rtol=1e-9)
            assert one.get("closure_error")[0] < 1e-12
            assert worst_tangent(one, 1e-7) < 1e-5
    assert changes >= 5


@pytest.mark.long
def test_states_whose_quaternions_are_no_longer_unit_ones_have_a_motion(folder):
    """Solvers step off them to find their own Jacobian: in the robot's own rates, and in others."""
    mechanism = rubbed().mechanism
    for robot in (lw.Robot(mechanism), lw.Robot(mechanism, independent=["slide"])):
        one = Instance(fmus.built(export(robot), folder))
        one.go(**{f"start_rate__{robot.independent[0]}": 3.0})
        place = one.state_names.index("q.ball.qw")
        for k in range(600):
            x = one.states()
            if k % 40 == 0:
                expected = one.rates()
                for longer in (1e-9, 1e-7, -1e-6):
                    one.put(x + longer * np.eye(len(x))[place])
                    np.testing.assert_allclose(one.rates(), expected, rtol=1e-3, atol=1e-3)
                one.put(x)
            one.put(x + 1e-4 * one.rates())


def worst_tangent(one: Instance, h: float = 1e-6) -> float:
    """Return the largest difference of directional from central differences along states and
    inputs, relative."""
    states, random = one.state_names, np.random.default_rng(5)
    described = one.description.modelVariables
    unknowns = [f"der({name})" for name in states]
    unknowns += [v.name for v in described if v.causality == "output" and v.name != "closure_error"]
    inputs = [v.name for v in described if v.causality == "input"]
    x0, u0, worst = one.states(), one.get(*inputs), 0.0

    def found(x, u) -> np.ndarray:
        one.put(x)
        for name, value in zip(inputs, u, strict=True):
            one.set(name, value)
        return one.get(*unknowns)

    for _ in range(2):
        dx, du = random.normal(size=len(x0)), random.normal(size=len(u0))
        difference = (found(x0 + h * dx, u0 + h * du) - found(x0 - h * dx, u0 - h * du)) / (2 * h)
        found(x0, u0)
        tangent = one.tangent(unknowns, [*states, *inputs], [*dx, *du])
        size = max(1.0, np.abs(difference).max())
        worst = max(worst, np.abs(tangent - difference).max() / size)
    return worst


@pytest.mark.parametrize("name", ["prr3", "spatial_slider_crank", "double_pendulum"])
def test_directional_derivatives_are_exact(name, folder):
    robot = built(name)
    one = Instance(fmus.built(own(name), folder))
    random = np.random.default_rng(3)
    given = {f"force__{each}": random.normal() for each in robot.actuators}
    one.go(**given, **{f"start_rate__{each}": random.normal() for each in robot.independent})
    assert worst_tangent(one) < 1e-6


@pytest.mark.sample(1)
@pytest.mark.parametrize("name", ["prr3", "bennett"])
def test_reactions_are_those_of_the_robot(name, folder):
    """In a plane and in a loop that has more constraints than it needs, where the least wrenches
    are told."""
    robot = built(name)
    one = Instance(fmus.built(own(name), folder))
    u, v = (np.linspace(low, 1.5, robot.mobility) for low in (1.0, 0.4))
    given = {f"force__{each}": x for each, x in zip(robot.actuators, u, strict=True)}
    one.go(**given, **{f"start_rate__{a}": x for a, x in zip(robot.independent, v, strict=True)})
    found = one.get(*(name for name in one.names if name.startswith("reaction.")))
    expected = robot.reactions(robot.home.with_rates(v), u).wrenches.ravel()
    np.testing.assert_allclose(found, expected, atol=1e-10 * np.abs(expected).max())


def tiny() -> lw.Mechanism:
    """A slider-crank with links of hundredths of a millimetre."""
    return lw.robots.slider_crank(crank=1e-5, rod=3e-5)


def cam() -> lw.Mechanism:
    """A mass that a wheel lifts along a curve."""
    return lift().mechanism


@pytest.mark.sample(1)
@pytest.mark.parametrize("described", [tiny, cam, *[MIXED["platform on rods"]] * WHOLE])
def test_reactions_where_short_levers_hold_and_where_gears_bend(described, folder):
    """Equations that have pivots of 1e-5; a gear with powers."""
    robot = lw.Robot(described())
    one = Instance(fmus.built(export(robot, outputs=["reactions"]), folder))
    v, u = [0.3, -0.2][: robot.mobility], np.zeros(len(robot.actuators))
    one.go(**{f"start_rate__{a}": x for a, x in zip(robot.independent, v, strict=True)})
    found = one.get(*(name for name in one.names if name.startswith("reaction.")))
    expected = robot.reactions(robot.home.with_rates(v), u).wrenches.ravel()
    np.testing.assert_allclose(found, expected, atol=1e-9 * np.abs(expected).max())


def test_derivatives_hold_the_linearised_motion(folder):
    """The eigenvalues of the derivatives are those of the robot's linearised motion, and zero for
    the states that follow from others."""
    robot = built("prr3")
    one = Instance(fmus.built(own("prr3"), folder))
    one.go()
    states = one.state_names
    unknowns = [f"der({name})" for name in states]
    A = np.array([one.tangent(unknowns, [name], [1.0]) for name in states]).T
    found = np.sort(np.abs(np.linalg.eigvals(A)))[::-1]
    model = robot.linearise(robot.home, np.zeros(len(robot.actuators)))
    expected = np.sort(np.abs(np.linalg.eigvals(model.A)))[::-1]
    np.testing.assert_allclose(found[: len(expected)], expected, rtol=1e-6, atol=1e-6)
    np.testing.assert_allclose(found[len(expected) :], 0.0, atol=1e-6)


@pytest.mark.sample(1)
@pytest.mark.parametrize("version", ["3.0", "2.0"])
def test_states_are_saved_restored_and_written(version, folder):
    file = fmus.built(export(built("five_bar"), version), folder)
    one, other = Instance(file, me=False), Instance(file, me=False, name="other")
    for each in (one, other):
        each.initialise(**{f"force__{built('five_bar').actuators[0]}": 2.0})
    one.step(0.0, 0.1)
    get, put, write, back = (
        ("getFMUState", "setFMUState", "serializeFMUState", "deserializeFMUState")
        if one.three
        else ("getFMUstate", "setFMUstate", "serializeFMUstate", "deSerializeFMUstate")
    )
    saved = getattr(one.own, get)()
    written = getattr(one.own, write)(saved)
    names = [name for name in one.names if name.startswith(("joint.", "rate."))]
    middle = one.get(*names)
    one.step(0.1, 0.1)
    end = one.get(*names)
    getattr(one.own, put)(saved)
    np.testing.assert_array_equal(one.get(*names), middle)
    one.step(0.1, 0.1)
    np.testing.assert_array_equal(one.get(*names), end)
    getattr(other.own, put)(getattr(other.own, back)(written))
    other.step(0.1, 0.1)
    np.testing.assert_array_equal(other.get(*names), end)
    with pytest.raises(Exception, match="error"):
        getattr(other.own, back)(bytes(len(written)))
    assert other.said == ["the bytes hold no state of this FMU"]


def test_instances_know_nothing_of_each_other_and_begin_again(folder):
    file = fmus.built(own("double_pendulum"), folder)
    one, two = Instance(file, me=False), Instance(file, me=False, name="two")
    name, speed = one.state_names[0].replace("q.", "joint."), 0.7
    start = f"start_rate__{one.state_names[0][2:]}"
    one.initialise(**{start: speed})
    two.initialise(**{start: -speed})
    one.step(0.0, 0.1)
    two.step(0.0, 0.1)
    first = one.get(name)[0]
    assert abs(first - two.get(name)[0]) > 0.1
    one.own.reset()
    assert not one.said
    one.initialise(**{start: speed})
    one.step(0.0, 0.1)
    assert one.get(name)[0] == first


@pytest.mark.long
def test_free_numbers_are_tuned(folder):
    """A mass that is set before the start, a length that is set on the way: the loops close again,
    and the motion is that of the other robot."""
    robot = built("five_bar").free("gravity.y", *lengths("five_bar"))
    file = fmus.built(export(robot), folder)
    path = lengths("five_bar")[0]
    longer = 1.02 * robot.parameters[path]
    other = robot.with_parameters({"gravity.y": -5.0})
    one = Instance(file, me=False)
    one.initialise(**{"parameter__gravity__y": -5.0})
    one.step(0.0, 0.1)
    expected = other.simulate(other.home, duration=0.1, rtol=1e-11, atol=1e-12).final
    found = one.get(*(f"joint.{each}" for each in robot.coordinates))
    np.testing.assert_allclose(found, expected.positions, atol=1e-7)
    name = next(
        each for each in one.names if each.startswith("parameter.") and "gravity" not in each
    )
    one.set(name, longer)
    independent = [f"joint.{each}" for each in robot.independent]
    before = one.get(*independent)
    assert one.get("closure_error")[0] < 1e-12
    np.testing.assert_array_equal(one.get(*independent), before)
    changed = other.with_parameters({path: longer})
    begin = changed.assemble(
        dict(zip(robot.independent, before, strict=True)),
        rates=dict(
            zip(robot.independent, one.get(*(f"rate.{r}" for r in robot.independent)), strict=True)
        ),
    )
    expected = changed.simulate(begin, duration=0.1, rtol=1e-11, atol=1e-12).final
    one.step(0.1, 0.1)
    found = one.get(*(f"joint.{each}" for each in robot.coordinates))
    np.testing.assert_allclose(found, expected.positions, atol=1e-7)


def lengths(name: str) -> list[str]:
    """Return paths of some lengths that may be free."""
    joints = built(name).mechanism.joints
    return [f"{next(reversed(joints))}.frames.0.position.x"]


@pytest.mark.long
def test_derivatives_along_parameters(folder):
    robot = built("five_bar").free("gravity.y", *lengths("five_bar"))
    one = Instance(
        fmus.built(export(robot, outputs=["positions", "accelerations", "reactions"]), folder)
    )
    one.go(**{f"start_rate__{each}": 0.3 for each in robot.independent})
    names = [each for each in one.names if each.startswith("parameter.")]
    told = [
        each
        for each in one.names
        if each.startswith(("joint.", "der(", "acceleration.", "reaction."))
    ]
    one.own.enterEventMode()
    for name, h in zip(names, (1e-5, 1e-7), strict=True):
        value = one.get(name)[0]
        values = []
        for each in (value + h, value - h, value):
            one.set(name, each)
            values.append(one.get(*told))
        difference = (values[0] - values[1]) / (2 * h)
        tangent = one.tangent(told, [name], [1.0])
        np.testing.assert_allclose(
            tangent, difference, atol=1e-6 * max(1, np.abs(difference).max())
        )


def test_motions_begin_at_joints_or_at_the_tool(folder):
    robot = built("five_bar")
    file = fmus.built(export(robot), folder)
    target = robot.task_values(robot.home) + np.array([0.02, 0.01])
    expected = robot.assemble(tool=target)
    one = Instance(file, me=False)
    names = [name for name in one.names if name.startswith("start_tool.")]
    given = dict(zip(names, target, strict=True))
    one.initialise(start_at_tool=True, **{k.replace(".", "__"): v for k, v in given.items()})
    found = one.get(*(f"joint.{each}" for each in robot.coordinates))
    np.testing.assert_allclose(found, expected.positions, atol=1e-9)
    one = Instance(file, me=False)
    a = [expected.positions[robot.coordinates.index(each)] for each in robot.independent]
    given = {f"start__{each}": x for each, x in zip(robot.independent, a, strict=True)}
    one.initialise(**given)
    found = one.get(*(f"joint.{each}" for each in robot.coordinates))
    np.testing.assert_allclose(found, expected.positions, atol=1e-9)
    far = dict(zip((f"start__{each}" for each in robot.independent), (2.9, -2.9), strict=True))
    for given, said in (
        (
            {"start_at_tool": True, names[0].replace(".", "__"): 50.0},
            "no motion begins at the tool's pose of start_tool: the loops cannot be closed",
        ),
        (far, "no motion begins at the coordinates and rates of start: the loops cannot be closed"),
    ):
        one = Instance(file, me=False)
        with pytest.raises(Exception, match="error"):
            one.initialise(**given)
        assert one.said[0].startswith(said)


@pytest.mark.long
def test_a_floating_body_begins_at_all_coordinates(folder):
    robot = top()
    file = fmus.built(export(robot), folder)
    assert validate_fmu(str(file)) == []
    one = Instance(file, me=False)
    assert "start.'the base'.qw" in one.names
    rates = dict(zip(robot.independent, [0.1, 0.2, 0.3, 1.0, 2.0, -1.0], strict=True))
    one.initialise(**{name_of("start_rate", each): x for each, x in rates.items()})
    one.step(0.0, 1.0)
    state = robot.state(robot.home.positions, rates)
    expected = robot.simulate(state, duration=1.0, rtol=1e-11, atol=1e-12).final
    found = one.get(*(name_of("joint", each).replace("__", ".") for each in robot.coordinates))
    np.testing.assert_allclose(found, expected.positions, atol=1e-6)
    one = Instance(file)
    one.go(**{name_of("start_rate", each): x for each, x in rates.items()})
    assert worst_tangent(one) < 1e-7


def test_free_numbers_of_what_begins_at_all_coordinates(folder):
    """A floating body falls as its gravity says."""
    robot = top().free("gravity.z")
    one = Instance(fmus.built(export(robot), folder), me=False)
    one.initialise(**{"parameter__gravity__z": -2.0, name_of("start", "the base.z"): 3.0})
    one.step(0.0, 1.0)
    found = one.get(name_of("joint", "the base.z").replace("__", "."))
    np.testing.assert_allclose(found, 3.0 - 1.0, rtol=1e-12)


def name_of(group: str, label: str) -> str:
    first, _, last = label.partition(".")
    return f"{group}__'{first}'__{last}"


def test_what_cannot_be_set_is_refused_in_words(folder):
    one = Instance(fmus.built(own("prr3"), folder), me=False)
    force = next(name for name in one.names if name.startswith("force."))
    one.initialise()
    for name, value, said in (
        (force, np.nan, f"keeps its value, for another is not finite: {force}"),
        ("closure_error", 1.0, "cannot be set now: closure_error"),
        ("start_rate.slide_1", 1.0, "cannot be set now: start_rate.slide_1"),
    ):
        with pytest.raises(Exception, match=r"discard|error"):
            one.set(name, value)
        assert one.said.pop() == said
    assert one.get(force)[0] == 0.0
    one.step(0.0, 0.01)
    with pytest.raises(Exception, match="error"):
        one.own.exitInitializationMode()
    assert one.said.pop() == "is called where it is not allowed: fmi3ExitInitializationMode"
    with pytest.raises(Exception, match="error"):
        one.step(0.01, np.nan)
    with pytest.raises(Exception, match="error"):
        one.own.getFloat64([12345])
    assert one.said.pop() == "there is no number of this reference"


@pytest.mark.long
def test_numbers_that_no_description_holds_are_refused_in_words(folder):
    robot = built("prr3").free("platform.mass", "platform.com.x")
    one = Instance(fmus.built(export(robot), folder), me=False)
    one.initialise()
    mass, place = (name for name in one.names if name.startswith("parameter."))
    with pytest.raises(Exception, match="discard"):
        one.set(mass, -1.0)
    assert one.said.pop() == f"keeps its value, for another is below its least: {mass}"
    assert one.get(mass)[0] == robot.parameters["platform.mass"]
    one.set(place, -0.01)
    one.set(mass, 0.5)
    assert [*one.get(mass, place)] == [0.5, -0.01]


def test_another_token_makes_no_instance(folder):
    file = fmus.built(own("prr3"), folder)
    with pytest.raises(Exception, match="Failed to instantiate"):
        Instance(file, token="{other}")


def test_no_motion_goes_on_through_a_singular_pose(folder):
    """A four-bar whose links can lie in a line: where all rates are weak a step is discarded."""
    one = Instance(fmus.built(own("prr3"), folder))
    one.go()
    x = one.states()
    x[:] = 1e3
    one.put(x)
    with pytest.raises(Exception, match="discard"):
        one.rates()
    assert one.said[0].startswith("the states have no motion: ")


def test_what_meets_is_an_event(folder):
    """A ball that falls: its gap is an event indicator, zero where it meets the ground."""
    mechanism = lw.Mechanism(
        name="stop",
        bodies={"body": BODY},
        joints={
            "slide": lw.PrismaticJoint(
                connects=("ground", "body"),
                limits=lw.Limits(lower=-0.5),
                stop=lw.Stop(stiffness=1e4, dissipation=0.2),
            )
        },
        gravity=(-9.81, 0.0, 0.0),
    )
    robot = lw.Robot(mechanism)
    file = fmus.built(export(robot), folder)
    assert validate_fmu(str(file)) == []
    found = simulated(file, "ModelExchange", 0.5, 1e-9)
    expected = robot.simulate(robot.home, duration=0.5, rtol=1e-10, atol=1e-12).final
    assert found["joint.slide"][-1] == pytest.approx(expected.positions[0], abs=1e-5)
    one = Instance(file)
    one.go()
    gap = next(name for name in one.names if name.startswith("apart."))
    assert one.get(gap)[0] == pytest.approx(0.5)


def test_the_same_robot_gives_the_same_bytes():
    again = lw.Robot(lw.robots.double_pendulum())
    first, second = export(built("double_pendulum")), export(again)
    assert first.content == second.content
    assert first.content != export(again.free("gravity.y")).content
