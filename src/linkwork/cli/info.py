"""The facts of a robot: what was described, and what was derived and compiled from it."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

from linkwork.checks import amount
from linkwork.cli.catalogue import built
from linkwork.cli.poses import FEW, pose_of
from linkwork.cli.source import Source
from linkwork.cli.terminal import console, facts, named, patience, show_json, table, tidy
from linkwork.mechanism import GROUND, GearJoint, Joint
from linkwork.mechanism.bearing import Bearing, GearTeeth, bearings
from linkwork.mechanism.joints import SLIDES, TYPES, OneFreedom
from linkwork.robot import Robot

KERNELS = ("motion", "inverse_dynamics", "terms", "closure_step")


def show(source: Source, as_json: bool) -> None:
    """Print the facts of a robot, as tables or as JSON."""
    with patience("deriving and compiling the equations of motion"):
        robot = built(source)
        found = gather(robot)
    if as_json:
        show_json(found)
    else:
        print_tables(found, at_home(robot))


def gather(robot: Robot) -> dict[str, Any]:
    """Return the facts as plain data: those of `structure`, and the kernels.

    kernels: name, inputs, outputs, operations, instructions of the machine code that evaluates
    `lanes` states at a time.
    """
    return structure(robot) | {"kernels": [kernel_facts(robot, name) for name in KERNELS]}


def structure(robot: Robot) -> dict[str, Any]:
    """Return the facts that are known before anything is compiled, as plain data.

    Keys: name, mobility, gruebler (what Gruebler's formula gives for it), planar, actuators,
    transmissions (those that are actuators: type, couples coordinates by ratios), drives (types, by
    actuator), tools (bodies, by name), bodies, joints (name, type, connects two bodies, couples
    coordinates by ratios and powers, role "tree", "cut" or "gear", actuated rates, limits,
    speed_limits and spring stiffness by freedom, bearing: the coefficient and, of a gear's teeth,
    the coordinate at which they rub), springs (between points: name, connects, stiffness), loops,
    redundant (rows that depend on others), idle (freedoms that move one member only), quantities
    (values by name), chart (independent rates, kept rows, elimination).
    """
    equations, mechanism = robot.equations, robot.mechanism
    return {
        "name": mechanism.name,
        "mobility": robot.mobility,
        "gruebler": robot.gruebler,
        "planar": robot.planar,
        "actuators": list(robot.actuators),
        "transmissions": {
            name: {"type": own.type, "couples": dict(getattr(own, "ratios", {}))}
            for name, own in mechanism.transmissions.items()
            if name in robot.actuators
        },
        "drives": {name: drive["type"] for name, drive in mechanism.drives.items()},
        "tools": {name: tool.body for name, tool in mechanism.tools.items()},
        "bodies": list(robot.bodies),
        "joints": [joint_facts(robot, name, joint) for name, joint in mechanism.joints.items()],
        "springs": [
            {"name": name, "connects": list(spring.connects), "stiffness": spring.stiffness}
            for name, spring in mechanism.springs.items()
        ],
        "loops": equations.topology.loops,
        "redundant": list(robot.redundant),
        "idle": list(robot.idle),
        "quantities": dict(mechanism.let),
        "chart": {
            "independent": list(robot.independent),
            "rows": [equations.rows.names[index] for index in equations.chart.rows],
            "elimination": equations.chart.description,
        },
    }


def joint_facts(robot: Robot, name: str, joint: Joint) -> dict[str, Any]:
    gear = isinstance(joint, GearJoint)
    effects = joint.effects().items()
    return {
        "name": name,
        "type": joint.type,
        "connects": [] if gear else list(joint.connects),
        "couples": dict(joint.ratios) if gear else {},
        "powers": {of: list(own) for of, own in joint.powers.items()} if gear else {},
        "role": "gear" if gear else "cut" if name in robot.equations.topology.cuts else "tree",
        "actuated": [rate for rate in joint.rates(name) if rate in robot.actuators],
        "limits": {
            freedom: [own.limits.lower, own.limits.upper]
            for freedom, own in effects
            if own.limits.bounded
        },
        "speed_limits": {freedom: own.limits.speed for freedom, own in effects if own.limits.speed},
        "stiffness": {
            freedom: own.spring.stiffness for freedom, own in effects if own.spring.stiffness
        },
        "bearing": bearing_facts(bearings({name: joint}).get(name)),
    }


def bearing_facts(own: Bearing | None) -> dict[str, Any]:
    """Return what rubs by what it carries, of a joint or of a gear's teeth; nothing of others."""
    if own is None:
        return {}
    at = {"at": own.at} if isinstance(own, GearTeeth) else {}
    return {"coefficient": own.friction.coefficient, **at}


def kernel_facts(robot: Robot, name: str) -> dict[str, Any]:
    kernel = robot.kernel(name)
    return {
        "name": name,
        "inputs": {name: size for name, size in kernel.inputs if size},
        "outputs": dict(kernel.outputs),
        "operations": kernel.operations,
        "instructions": kernel.instruction_count("batch"),
        "lanes": kernel.lanes,
    }


# For people


def at_home(robot: Robot) -> list[tuple[str, str]]:
    """Return home by the driven joints and the tool, or else the first joints, and the limits that
    it passes."""
    driven = [name for name in robot.actuators if name in robot.coordinates][:FEW]
    places = tidy([robot.home[name] for name in driven])
    joints = [named(driven, places, 5)] if driven else []
    tool = [pose_of(robot, robot.home)] if robot.mechanism.tools or not driven else []
    if robot.mechanism.tools and (base := robot.mechanism.first_tool.relative_to) != GROUND:
        tool[0] += f" relative to {base}"
    passed = "; ".join(robot.limits_passed(robot.home))
    return [("home", "; ".join(joints + tool)), *([("limits passed", passed)] if passed else [])]


def print_tables(found: dict[str, Any], home: Sequence[tuple[str, str]] = ()) -> None:
    # What the robot is.
    chart = found["chart"]
    out = console()
    rows = [
        ("robot", found["name"]),
        ("mobility", mobility(found)),
        ("bodies", f"{len(found['bodies'])} and {GROUND}: {', '.join(found['bodies'])}"),
        ("loops", str(found["loops"])),
        ("redundant rows", "; ".join(found["redundant"]) or "none"),
        ("idle freedoms", "; ".join(found["idle"]) or "none"),
        ("limits", "; ".join(limits(found["joints"])) or "none"),
        ("springs", "; ".join(springs(found)) or "none"),
        *([("bearings", told)] if (told := "; ".join(rubbing(found["joints"]))) else []),
        *([("quantities", quantities(found))] if found["quantities"] else []),
        ("actuators", "; ".join(acting(found)) or "none"),
        ("tools", ", ".join(f"{name} on {of}" for name, of in found["tools"].items()) or "none"),
        *home,
        ("independent", ", ".join(chart["independent"])),
        ("elimination", elimination(chart)),
    ]
    out.print(facts(rows))
    out.print()
    # Its joints, and which part they play.
    joints = [
        (joint["name"], joint["type"], between(joint), joint["role"], actuated(joint))
        for joint in found["joints"]
    ]
    out.print(table(("joint", "type", "connects", "role", "actuated"), joints))
    out.print()
    # What is compiled of it.
    kernels = [
        (
            item["name"],
            signature(item["inputs"]),
            signature(item["outputs"]),
            f"{item['operations']:,}",
            f"{item['instructions']:,}",
        )
        for item in found["kernels"]
    ]
    out.print(
        table(
            ("function", "inputs", "outputs", "operations", "instructions"), kernels, numbers=(3, 4)
        )
    )


def elimination(chart: dict[str, Any]) -> str:
    """Return how the dependent rates are eliminated."""
    rows = len(chart["rows"])
    return f"{amount(rows, 'row')}: {chart['elimination']}" if rows else "none: no loops"


def mobility(found: dict[str, Any]) -> str:
    """Return the mobility, and what Gruebler's formula makes of it."""
    n, counted, named = found["mobility"], found["gruebler"], len(found["redundant"])
    told = f"{n}, {'planar' if found['planar'] else 'spatial'}; Gruebler's formula gives {counted}"
    if n == counted:
        return told
    dependent = n - counted
    vanish = dependent - named
    parts = [f"{named} named below"] * (named > 0) + [
        f"{vanish} that the geometry makes vanish"
    ] * (vanish > 0)
    rows = "one closure row depends" if dependent == 1 else f"{dependent} closure rows depend"
    return f"{told}, because {rows} on the others: {' and '.join(parts)}"


def between(joint: dict[str, Any]) -> str:
    """Return the bodies that a joint connects, or the sum that a gear keeps."""
    return " - ".join(joint["connects"]) or weighted(joint["couples"], joint["powers"])


def weighted(couples: dict[str, float], powers: dict[str, list[float]] | None = None) -> str:
    """Return a sum of coordinates, and of their powers, as it is written by hand."""
    terms = [
        (c, f"{name}{f'^{power}' if power > 1 else ''}")
        for name, ratio in couples.items()
        for power, c in enumerate((ratio, *(powers or {}).get(name, ())), start=1)
        if c
    ]
    told = "".join(f" {'-' if c < 0 else '+'} {scaled(abs(c), what)}" for c, what in terms)
    return told.removeprefix(" + ") if terms and terms[0][0] > 0 else told.replace(" - ", "-", 1)


def scaled(factor: float, what: str) -> str:
    """Return a product as it is written by hand."""
    return what if factor == 1 else f"{factor:g} {what}"


def acting(found: dict[str, Any]) -> Iterator[str]:
    """Yield the actuators: rates of joints, or along which transmission, and with which drive."""
    for name in found["actuators"]:
        told = [words(found["drives"][name])] if name in found["drives"] else []
        if along := found["transmissions"].get(name):
            told = [f"along {weighted(along['couples']) or 'a ' + words(along['type'])}", *told]
        yield f"{name} ({'; '.join(told)})" if told else name


def words(name: str) -> str:
    """Return the name of a type as it is spoken."""
    return name.replace("_", " ")


def actuated(joint: dict[str, Any]) -> str:
    """Return what is actuated of a joint: yes, or the rates by what follows the joint's name."""
    names = [rate.removeprefix(f"{joint['name']}.") for rate in joint["actuated"]]
    return "yes" if names == [joint["name"]] else ", ".join(names)


def limits(joints: list[dict[str, Any]]) -> Iterator[str]:
    for joint in joints:
        for freedom, (lower, upper) in joint["limits"].items():
            bounds = [
                f"{word} {bound:g}"
                for word, bound in (("from", lower), ("to", upper))
                if bound is not None
            ]
            yield (
                f"{freedom_name(joint, freedom)} {' '.join(bounds)} "
                f"{'m' if freedom in SLIDES else 'rad'}"
            )
        for freedom, speed in joint["speed_limits"].items():
            unit = "m/s" if freedom in SLIDES else "rad/s"
            yield f"{freedom_name(joint, freedom)} at most {speed:g} {unit}"


def springs(found: dict[str, Any]) -> Iterator[str]:
    for joint in found["joints"]:
        for freedom, stiffness in joint["stiffness"].items():
            yield (
                f"{freedom_name(joint, freedom)} {stiffness:g} "
                f"{'N/m' if freedom in SLIDES else 'N m/rad'}"
            )
    for spring in found["springs"]:
        yield f"{spring['name']} ({' - '.join(spring['connects'])}) {spring['stiffness']:g} N/m"


def rubbing(joints: list[dict[str, Any]]) -> Iterator[str]:
    for joint in joints:
        if own := joint["bearing"]:
            where = f" by its teeth, at {own['at']}," if "at" in own else ""
            yield f"{joint['name']} rubs{where} with the coefficient {own['coefficient']:g}"


def quantities(found: dict[str, Any]) -> str:
    """Return the named quantities with their values."""
    return ", ".join(f"{name} = {value:g}" for name, value in found["quantities"].items())


def freedom_name(joint: dict[str, Any], freedom: str) -> str:
    """Return a freedom by the joint's name; the one of a joint that has no other by that alone."""
    return (
        joint["name"]
        if issubclass(TYPES[joint["type"]], OneFreedom)
        else f"{joint['name']}.{freedom}"
    )


def signature(sizes: dict[str, int]) -> str:
    return " ".join(f"{name}({size})" for name, size in sizes.items())
