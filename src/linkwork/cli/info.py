"""The facts of a robot: what was described, and what was derived and compiled from it."""

from __future__ import annotations

import json
from typing import Any

from linkwork.cli.catalogue import find
from linkwork.cli.terminal import console, facts, patience, table
from linkwork.mechanism import GROUND
from linkwork.robot import Robot

KERNELS = ("motion", "inverse_dynamics", "terms", "closure_step")


def show(name: str, as_json: bool) -> None:
    """Print the facts of a robot, as tables or as JSON."""
    mechanism = find(name)
    with patience("deriving and compiling the equations of motion"):
        found = gather(Robot(mechanism))
    if as_json:
        print(json.dumps(found, indent=2, ensure_ascii=False))
    else:
        print_tables(found)


def gather(robot: Robot) -> dict[str, Any]:
    """Return the facts as plain data.

    Keys: name, mobility, planar, actuators, bodies, joints (name, type, connects, role "tree" or "cut", actuated),
    loops, redundant (rows that depend on others), chart (independent joints, kept rows, elimination), kernels (name,
    inputs, outputs, operations, instructions of the machine code that evaluates `lanes` states at a time).
    """
    equations = robot.equations
    cut = equations.topology.cuts
    return {
        "name": robot.mechanism.name,
        "mobility": robot.mobility,
        "planar": robot.planar,
        "actuators": list(robot.actuators),
        "bodies": list(robot.bodies),
        "joints": [
            {
                "name": joint,
                "type": described.type,
                "connects": list(described.connects),
                "role": "cut" if joint in cut else "tree",
                "actuated": joint in robot.actuators,
            }
            for joint, described in robot.mechanism.joints.items()
        ],
        "loops": equations.topology.loops,
        "redundant": list(robot.redundant),
        "chart": {
            "independent": [equations.tree.coordinates[index] for index in equations.chart.independent],
            "rows": [equations.rows.names[index] for index in equations.chart.rows],
            "elimination": equations.chart.description,
        },
        "kernels": [kernel_facts(robot, name) for name in KERNELS],
    }


def kernel_facts(robot: Robot, name: str) -> dict[str, Any]:
    kernel = robot.kernel(name)
    return {
        "name": name,
        "inputs": dict(kernel.inputs),
        "outputs": dict(kernel.outputs),
        "operations": kernel.operations,
        "instructions": kernel.instruction_count(vector=True),
        "lanes": kernel.lanes,
    }


def print_tables(found: dict[str, Any]) -> None:
    chart = found["chart"]
    out = console()
    rows = [
        ("robot", found["name"]),
        ("mobility", f"{found['mobility']}, {'planar' if found['planar'] else 'spatial'}"),
        ("bodies", f"{len(found['bodies'])} and {GROUND}: {', '.join(found['bodies'])}"),
        ("loops", str(found["loops"])),
        ("redundant rows", ", ".join(found["redundant"]) or "none"),
        ("independent", ", ".join(chart["independent"])),
        ("elimination", f"{len(chart['rows'])} rows: {chart['elimination']}"),
    ]
    out.print(facts(rows))
    out.print()
    joints = [
        (joint["name"], joint["type"], " - ".join(joint["connects"]), joint["role"], "yes" if joint["actuated"] else "")
        for joint in found["joints"]
    ]
    out.print(table(("joint", "type", "connects", "role", "actuated"), joints))
    out.print()
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
    out.print(table(("function", "inputs", "outputs", "operations", "instructions"), kernels, numbers=(3, 4)))


def signature(sizes: dict[str, int]) -> str:
    return " ".join(f"{name}({size})" for name, size in sizes.items())
