"""Free parameters: a robot with other values is the robot of the edited description, and nothing is
compiled anew."""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial
from typing import Any

import numpy as np
import pytest

import linkwork as lw
from linkwork.equations import derive, functions
from linkwork.kernels import kernel as kernels
from linkwork.mechanism.numbers import edited, free_numbers

from tests.equations.evaluation import close, values
from tests.oracle.random_joints import random_loops, random_tree
from tests.products import first

NEVER = ("axis", "axes", "limits", "reference")
TURNS = ("rotation", "turn")
CASES = {
    "tree": partial(random_tree, 1, 9, effects=True, gears=1, actuation=-2),
    "loop of a screw": partial(
        random_loops, 7, 1, kinds=("screw", "universal", "revolute", "spherical"), effects=True
    ),
    "planar loops": partial(
        random_loops, 5, 2, planar=True, effects=True, rods=1, gears=1, actuation=-1
    ),
    "governor": lw.robots.flyball_governor,
    "loop closed by a free joint": partial(random_loops, 8, 1, effects=True, platform="free"),
    "loops with everything": partial(
        random_loops, 5, 2, effects=True, rods=1, gears=1, freedoms=2, actuation=1
    ),
    "platform on rods": lw.robots.stewart,
    "pin jointed": lw.robots.prr3,
}
PLANAR = ("planar loops", "pin jointed")


def numbers(data: Any, where: tuple[str, ...] = ()) -> Iterator[tuple[str, ...]]:
    """Yield the places of all numbers in plain data."""
    if isinstance(data, float):
        yield where
    parts = (
        data.items()
        if isinstance(data, dict)
        else enumerate(data)
        if isinstance(data, tuple)
        else ()
    )
    for key, part in parts:
        yield from numbers(part, (*where, str(key)))


def turns(path: str) -> bool:
    """Tell whether a number is a component of a rotation vector of a frame."""
    return any(path.endswith(f".{part}.{k}") for part in TURNS for k in range(3))


def can_be_free(mechanism: lw.Mechanism, planar: bool) -> list[str]:
    """Return the paths of all numbers that can be free; in a planar mechanism those out of the
    plane would open loops."""
    places = [where for where in numbers(mechanism.model_dump()) if not set(NEVER) & set(where)]
    if planar:
        places = [
            where
            for where in places
            if not (where[-1] == "2" and {"position", "points"} & set(where))
            and not (where[-1] in ("0", "1") and turns(".".join(where)))
        ]
    paths = map(".".join, places)
    return [path for path in paths if not path.endswith("spring.turn.rest")]


def changed(mechanism: lw.Mechanism, paths: list[str]) -> dict[str, float]:
    """Return other values, none of them zero: lengths near the old ones, inertias scaled as a
    whole."""
    random = np.random.default_rng(1)
    scale = dict(
        zip(mechanism.bodies, random.uniform(0.5, 1.5, len(mechanism.bodies)), strict=True)
    )

    def other(path: str, value: float) -> float:
        if turns(path):
            return value + random.uniform(-0.02, 0.02)
        if ".inertia." in path:
            return value * scale[path.split(".")[1]]
        if any(
            part in path for part in ("position", "points", "length", "pitch", "ratios", "offset")
        ):
            return value * random.uniform(0.97, 1.03) + ("position" in path) * random.uniform(
                0.001, 0.01
            )
        return value * random.uniform(0.5, 1.5) + (value == 0) * random.uniform(0.1, 0.2)

    return {path: other(path, value) for path, value in free_numbers(mechanism, paths).items()}


@pytest.mark.long
@pytest.mark.parametrize("name", first(4, tuple(CASES)))
def test_all_numbers_free_at_once(name):
    """Every function of q, v, u and p is that of the description edited to p."""
    mechanism = CASES[name]()
    paths = can_be_free(mechanism, name in PLANAR)
    given = changed(mechanism, paths)
    free = derive(mechanism, free=paths)
    plain = derive(edited(mechanism, given), free.independent)
    assert free.tree.coordinates == plain.tree.coordinates
    assert plain.independent == free.independent
    random = np.random.default_rng(2)
    q, v, p = plain.reference, random.normal(size=plain.mobility), list(given.values())
    u, w = random.normal(size=len(mechanism.actuators)), random.normal(size=plain.nv)
    inputs = {
        "motion": (q, v, u),
        "inverse_dynamics": (q, v, v),
        "terms": (q, v),
        "closure_step": (q,),
        "maps": (q,),
        "joints_motion": (q, v, v),
        "bodies_motion": (q, v),
        "energy": (q, v),
        "assembly": (q, w),
    }
    for function, arguments in inputs.items():
        found, expected = (
            values(getattr(functions, function)(equations), *arguments, *more)
            for equations, more in ((free, (p,)), (plain, ()))
        )
        for output in expected.keys() - {"pivot", "phi", "Phi", "gamma"}:
            close(found[output], expected[output], 1e-10 if "accelerations" in output else 1e-12)


def perturbations() -> dict[str, dict[str, float]]:
    """Return new values by kind of path, as a user writes them, for the 3-PRR."""
    return {
        "mass": {"platform.mass": 3.0},
        "mass centre": {"link_1.com.x": 0.07, "link_1.com.1": 0.01},
        "inertia": {"bodies.platform.inertia.zz": 0.02},
        "joint frame": {"wrist_1.frames.1.position.x": 0.09, "pivot_2.frames.0.position.y": 0.004},
        "friction": {"slide_1.friction.viscous": 0.3, "pivot_1.friction.coulomb": 0.2},
        "spring": {"slide_2.spring.stiffness": 40.0, "slide_2.spring.rest": 0.1},
        "rotor": {"slide_3.rotor_inertia": 0.5},
        "gravity": {"gravity.y": -9.81},
        "tool": {"tip.frame.position.x": 0.02},
    }


@pytest.fixture(scope="module")
def platform() -> tuple[lw.Mechanism, lw.Robot]:
    mechanism = lw.robots.prr3()
    tool = next(iter(mechanism.tools.values()))
    mechanism = mechanism.model_copy(update={"tools": {"tip": tool}})
    return mechanism, lw.Robot(mechanism).free(
        *(path for values in perturbations().values() for path in values)
    )


@pytest.mark.sample(3)
@pytest.mark.parametrize("kind", perturbations())
def test_a_robot_with_other_values_is_the_robot_of_the_edited_description(platform, kind):
    mechanism, free = platform
    given = perturbations()[kind]
    ours, plain = free.with_parameters(given), lw.Robot(edited(mechanism, given))
    assert ours.parameters == dict(free.parameters) | given
    assert ours.mechanism == plain.mechanism
    close(ours.home.positions, plain.home.positions, 1e-12)
    state, v = plain.home, np.array([0.3, -0.2, 0.1])
    own = ours.state(state.positions, v)
    state = state.with_rates(v)
    close(ours.mass_matrix(own), plain.mass_matrix(state), 1e-12)
    close(
        ours.forward_dynamics(own, [1.0, 2.0, 3.0]),
        plain.forward_dynamics(state, [1.0, 2.0, 3.0]),
        1e-11,
    )
    close(ours.energy(own), plain.energy(state), 1e-12)
    close(ours.tool_pose(own), plain.tool_pose(state), 1e-12)
    assert ours.closure_error(own) < 1e-12
    ends = [
        robot.simulate(start, duration=0.2, save_at=[0.2])
        for robot, start in ((ours, own), (plain, state))
    ]
    close(
        ends[0].variables["joint_position"].values, ends[1].variables["joint_position"].values, 1e-7
    )


def test_nothing_is_compiled_anew(platform, monkeypatch):
    _, free = platform

    def use(robot: lw.Robot) -> None:
        state = robot.assemble({"slide_1": float(robot.home["slide_1"]) + 0.01})
        robot.forward_dynamics(state, [1.0, 0.0, 0.0])
        for measure in (robot.energy, robot.tool_pose, robot.closure_error, robot.mass_matrix):
            measure(state)
        robot.simulate(state, [1.0, 0.0, 0.0], duration=0.1)

    use(free)
    compiled = []
    monkeypatch.setattr(kernels, "load", lambda *arguments: compiled.append(arguments))
    use(free.with_parameters({"platform.mass": 2.0, "wrist_1.frames.1.position.x": 0.1}))
    use(free.with_parameters({"platform.mass": 4.0}).with_parameters({"gravity.y": -1.0}))
    assert not compiled


def test_charts_found_in_one_run_serve_the_others():
    """A parameter does not change in which rates a run can go on: the double pendulum's rod passes
    its dead points."""
    free = lw.Robot(lw.robots.four_bar()).free("gravity.y")
    heavier = free.with_parameters({"gravity.y": -20.0})
    free.run_charts[("known",)] = free.chart
    known = heavier.run_charts[("known",)]
    assert known.p == [-20.0] and known is heavier.run_charts[("known",)]
    assert known.kernel("motion").address == free.chart.kernel("motion").address


def test_zero_is_a_value_like_any_other():
    """What is zero in the description may be free, and what is free may become zero."""
    robot = lw.Robot(lw.robots.four_bar())
    free = robot.free(*(f"{body}.mass" for body in robot.bodies[:1]), "gravity.y")
    state = free.home
    light = free.with_parameters({f"{robot.bodies[0]}.mass": 0.0, "gravity.y": 0.0})
    assert light.energy(state)[1] == 0
    close(free.with_parameters({}).mass_matrix(state), robot.mass_matrix(robot.home), 1e-12)


@pytest.mark.parametrize("path", ["hinge.friction.static", "both.ratios.hinge"])
def test_static_friction_and_ratios_of_sums_may_be_free(path):
    """Beside the edited description: numbers that decide what there is, where they are zero."""
    body = lw.Body(mass=1.0, centre_of_mass=(0.3, 0.0, 0.0), inertia=lw.Inertia(zz=0.1))
    friction = lw.Friction(coulomb=0.5, coulomb_rate=0.1, static=0.6, stribeck_rate=0.2)
    both = lw.Combination(ratios={"hinge": 0.5, "pin": 1.0}, spring=lw.SlackSpring(stiffness=30.0))
    mechanism = lw.Mechanism(
        bodies={"arm": body, "hand": body},
        joints={
            "hinge": lw.RevoluteJoint(connects=("ground", "arm"), friction=friction),
            "pin": lw.RevoluteJoint(connects=("arm", "hand")),
        },
        transmissions={"both": both},
        actuators=("hinge", "both"),
    )
    robot = lw.Robot(mechanism, free=[path]).with_parameters({path: 0.8})
    other = lw.Robot(edited(mechanism, {path: 0.8}), robot.independent)
    given = np.array([0.2, -0.4]), np.array([0.1, 0.3])
    found, expected = (
        each.forward_dynamics(each.state(*given), [1.0, 2.0]) for each in (robot, other)
    )
    np.testing.assert_allclose(found, expected, rtol=1e-13)


@pytest.mark.parametrize("label", ["rope", "car"])
def test_ratios_of_a_gear_that_holds_a_cable_may_be_free(label):
    """A car drags a weight by a rope over a sphere, ratio rope + r car = 0.5: a run ended in a
    traceback, in any robot with a cable and a free ratio."""
    over = lw.mechanism.OverSphere(
        body="ground", frame=lw.Frame(position=(0.3, 0.2, 0)), radius=0.05
    )
    ends = [
        lw.mechanism.ViaPoint(body="ground", point=(0, 0.3, 0)),
        lw.mechanism.ViaPoint(body="weight", point=(0.5, 0, 0)),
    ]
    disc = lw.Body(mass=1.0, inertia=lw.Inertia(zz=0.1))
    robot = lw.Robot(
        lw.Mechanism(
            bodies={"weight": disc, "car": disc},
            joints={
                "weight": lw.PrismaticJoint(connects=("ground", "weight"), axis=(1, 0, 0)),
                "car": lw.PrismaticJoint(connects=("ground", "car"), axis=(0, 1, 0)),
                "tie": lw.GearJoint(ratios={"rope": 1, "car": -0.5}, offset=0.5),
            },
            transmissions={"rope": lw.mechanism.Cable(path=(ends[0], over, ends[1]))},
            gravity=(1, 0, 0),
        )
    )
    freed = robot.free(f"joints.tie.ratios.{label}")
    run, plain = (each.simulate(each.home, duration=0.3) for each in (freed, robot))
    assert run.final.positions == pytest.approx(plain.final.positions, rel=1e-9)
    other = freed.with_parameters({f"joints.tie.ratios.{label}": 1.2})
    rope, car = (1.2, -0.5) if label == "rope" else (1, 1.2)
    end = other.simulate(other.home, duration=0.3).final
    assert rope * other.observe(end)["rope"] + car * end.positions[1] == pytest.approx(0.5)


def test_freedoms_that_a_joint_says_nothing_of():
    mechanism = random_loops(8, 1, platform="free")
    name = next(
        name
        for name, joint in mechanism.joints.items()
        if joint.type in ("cylindrical", "planar", "universal")
    )
    freedom = mechanism.joints[name].freedoms[0]
    path = f"{name}.friction.{freedom}.viscous"
    free, plain = derive(mechanism, free=[path]), derive(edited(mechanism, {path: 2.0}))
    q, v = plain.reference, np.ones(plain.mobility)
    f = values(functions.terms(plain), q, v)["f"]
    assert f.any()
    close(values(functions.terms(free), q, v, [2.0])["f"], f, 1e-12)


REFUSALS = {
    "platform.mas": (
        "'platform.mas' leads to no number: bodies.platform has no 'mas' (did you mean mass?)"
    ),
    "nothing.mass": "the mechanism has no 'nothing'",
    "platform": "bodies.platform is not one; go on with mass, centre_of_mass, inertia",
    "platform.com": "bodies.platform.centre_of_mass is not one; go on with 0, 1, 2",
    "platform.inertia.xx": "bodies.platform.inertia.xx is not one",
    "platform.com.w": "bodies.platform.centre_of_mass has no 'w'",
    "slide_1.axis.x": (
        "'slide_1.axis.x' is part of a direction and cannot be free; free turns of the frames that "
        "it stands in, such as frames.0.turn.x"
    ),
    "reference.slide_1": "'reference.slide_1' enters no equation of motion",
    "bodies.platform.mass": (
        "'platform.mass' and 'bodies.platform.mass' are the same number; name it once"
    ),
    "": "leads to no number",
}


@pytest.mark.parametrize("path", REFUSALS)
def test_refused_paths(path):
    with pytest.raises(lw.LinkworkError) as refusal:
        free_numbers(lw.robots.prr3(), ("platform.mass", path))
    assert REFUSALS[path] in str(refusal.value)


def test_a_name_of_a_body_and_a_joint():
    body = lw.Body(mass=1.0, inertia=lw.Inertia(zz=1.0))
    arm = lw.RevoluteJoint(connects=("ground", "arm"))
    mechanism = lw.Mechanism(bodies={"arm": body}, joints={"arm": arm})
    assert free_numbers(mechanism, ["arm.mass", "arm.rotor_inertia"]) == {
        "arm.mass": 1.0,
        "arm.rotor_inertia": 0.0,
    }


VALUES = {
    "a negative mass": ({"platform.mass": -1.0}, "bodies.platform.mass: -1.0 is below 0"),
    "no number": ({"platform.mass": "heavy"}, "'platform.mass' is 'heavy'"),
    "not finite": ({"platform.mass": np.nan}, "'platform.mass' is nan"),
    "not free": (
        {"link_1.mass": 1.0},
        "there is no free parameter 'link_1.mass'; there are platform.mass",
    ),
    "no mapping": (3.0, "the parameters are 3.0; give values by path"),
}


@pytest.mark.parametrize("case", VALUES)
def test_refused_values(platform, case):
    given, sentence = VALUES[case]
    with pytest.raises(lw.LinkworkError) as refusal:
        platform[1].with_parameters(given)
    assert sentence in str(refusal.value)


def test_lengths_with_which_the_loops_do_not_close():
    free = lw.Robot(lw.robots.four_bar()).free("joints.crank_pin.frames.0.position.x")
    with pytest.raises(
        lw.MechanismError, match="the loops do not close near the reference configuration: position"
    ):
        free.with_parameters({"joints.crank_pin.frames.0.position.x": 9.0})


def test_a_robot_without_free_numbers():
    robot = lw.Robot(lw.robots.four_bar())
    assert robot.parameters == {} and robot.p.shape == (0,)
    with pytest.raises(lw.LinkworkError, match="no number of this robot is free"):
        robot.with_parameters({"coupler.mass": 1.0})


def test_states_of_another_geometry_are_refused(platform):
    _, free = platform
    longer = free.with_parameters({"wrist_1.frames.1.position.x": 0.09})
    with pytest.raises(
        lw.LinkworkError, match="the state belongs to another robot: its loops are open"
    ):
        longer.mass_matrix(free.home)


def test_the_refusal_of_what_is_no_number_names_the_quantities():
    mechanism = lw.robots.pendulum().with_quantities({"rod": 0.3, "lean": 0.1}, {})
    with pytest.raises(lw.LinkworkError, match=r"mean rod.*: it is none of .*quantities rod, lean"):
        lw.Robot(mechanism).free("rood")


def test_a_name_that_holds_the_letters_of_patterns_is_a_name():
    bodies = {name: lw.Body(mass=1.0) for name in ("link[0]", "link0")}
    joints = {f"to {body}": lw.PrismaticJoint(connects=("ground", body)) for body in bodies}
    robot = lw.Robot(lw.Mechanism(bodies=bodies, joints=joints, gravity=(0, 0, 0)))
    assert [*robot.free("link[0].mass").parameters] == ["link[0].mass"]


def test_numbers_that_are_free_already_stay_so():
    robot = lw.Robot("prr3").free("platform.mass").with_parameters({"platform.mass": 1.5})
    more = robot.free("platform.mass", "link_1.mass")
    assert more.parameters == robot.free("link_1.mass").parameters
    with pytest.raises(lw.LinkworkError, match="name it once"):
        robot.free("link_1.mass", "link_1.mass")


def test_patterns_free_all_numbers_that_they_match():
    """As the same paths do one by one; those that are free already stay where they are."""
    robot = lw.Robot("prr3").free("platform.mass")
    free = robot.free("*.mass", "bodies.link_?.mass")
    masses = [f"{name}.mass" for name in robot.bodies]
    assert [*free.parameters] == [
        "platform.mass",
        *sorted({*masses} - {"platform.mass"}, key=masses.index),
    ]
    assert free.parameters == lw.Robot("prr3").free(*free.parameters).parameters
    with pytest.raises(
        lw.LinkworkError, match=r"what '\*' matches cannot all be free at a time; give p"
    ):
        lw.Robot("prr3").free("*")
    with pytest.raises(lw.LinkworkError, match=r"'link_9.\*' matches no number that can"):
        robot.free("link_9.*")
