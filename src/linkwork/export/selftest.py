"""The self-test of an export: states with what its functions give there, by CasADi's own evaluation
of the expressions."""

from __future__ import annotations

from collections.abc import Sequence

import casadi as ca
import numpy as np

from linkwork.export.calls import PROGRAMS, Argument, Call
from linkwork.export.source import listed
from linkwork.export.statements import Dialect
from linkwork.export.templates import filled
from linkwork.model.task import task_of, values
from linkwork.robot import Robot

STATES, SPREAD, NEARER, STRONG = 5, 0.05, 6, 0.2
TOLERANCE = {"double": 1e-9, "float": 2e-3}
NEWTON = 12
MOTION = """\
    worst = 0.0;
    for (k = 0; k < GOLDEN_STATES; ++k) {
        lw_state one_by_one, at_once;
        lw_status status = lw_start(golden_q[k], golden_v[k]OWN_P, &one_by_one);
        int i;
        at_once = one_by_one;
        for (i = 0; i < 50 && status == LW_OK; ++i) {
            status = lw_step_rk4(golden_u[k], SPAN / 50OWN_P, &one_by_one);
        }
        if (status == LW_OK) {
            status = lw_step(golden_u[k], SPAN, LOOSE, LOOSEOWN_P, &at_once);
        }
        one = difference(status, at_once.q, one_by_one.q, LW_Q) / 1000.0;
        worst = one > worst ? one : worst;
    }
    wrong += told("step and step_rk4", worst);
"""


def selftest_text(robot: Robot, dialect: Dialect, calls: Sequence[Call], free: bool) -> str:
    """Return the self-test, with lw for the prefix."""
    # States with closed loops, and numbers for all else that is given.
    random = np.random.default_rng(20)
    states = closed_states(robot, random)
    given = {
        "q": states,
        "v": 0.5 * random.normal(size=(len(states), robot.mobility)),
        "dv": random.normal(size=(len(states), robot.mobility)),
        "u": random.normal(size=(len(states), len(robot.actuators))),
    }
    tree = robot.equations.tree
    places = {tree.rates[k]: place for place, k in tree.single}
    if all(name in places for name in robot.independent):
        given["a"] = [q[[places[name] for name in robot.independent]] for q in states]
    if robot.task:
        given["x"] = [values(robot, q, task_of(robot)) for q in states]
    # What functions give there; kinematics leads from home to these states.
    checked, used = [], set[str]()
    golden = {f"golden_{name}": rows for name, rows in given.items()}
    for call in calls:
        straight = call.body is None
        if not straight and call.name not in ("kinematics", "tool_to_joints"):
            continue
        ins = [each for each in call.arguments if each.role == "in"]
        expected = f"golden_{call.name}" if straight else "golden_q"
        if straight:
            rows = [[given[each.name][k] for each in ins] for k in range(len(states))]
            golden[expected] = evaluated(robot, call, rows)
        used |= {expected, *(f"golden_{each.name}" for each in ins)}
        checked.append(check(call, ins, expected, free))
    if {"step", "step_rk4"} <= {call.name for call in calls}:
        used |= {"golden_q", "golden_v", "golden_u"}
        checked.append(MOTION)
    # The program.
    tables = [
        f"static const lw_real {name}[GOLDEN_STATES][{max(len(rows[0]), 1)}] = "
        + "{\n"
        + ",\n".join(listed(row if len(row) else [0.0], dialect) for row in rows)
        + "};\n"
        for name, rows in golden.items()
        if name in used
    ]
    # Its words, and what the precision of its numbers leaves.
    words = {
        "GOLDEN": "\n".join([f"enum {{ GOLDEN_STATES = {len(states)} }};\n", *tables]),
        "CHECKS": "\n".join(checked),
        "SELFTEST_TOLERANCE": f"{TOLERANCE[dialect.precision]:g}",
    }
    more = {
        "OWN_P": ", &lw_own_parameters" * free,
        "LOOSE": dialect.constant(1e-10 if dialect.precision == "double" else 1e-4),
        "SPAN": dialect.constant(0.002),
    }
    text = filled("selftest.c", dialect, words)
    for word, other in more.items():
        text = text.replace(word, other)
    return text


def check(call: Call, ins: Sequence[Argument], expected: str, free: bool) -> str:
    """Return the statements that compare a function with what is expected."""
    # Room for what it gives, and where it starts from.
    judged = judged_of(call)
    outs = [each for each in call.arguments if each.role != "in"]
    arrays = [each for each in outs if each.sizes]
    room = [f"        lw_real {each.name}[{size(each)} + 1];" for each in arrays]
    room += [f"        lw_real {each.name};" for each in outs if not each.sizes]
    begin = [
        f"        int i;\n        for (i = 0; i < LW_Q; ++i) {{\n            {each.name}[i] = "
        "lw_home[i];\n        }"
        for each in outs
        if each.role == "inout"
    ]
    # The call, and what is looked at.
    words = [f"golden_{each.name}[k]" for each in ins] + ["&lw_own_parameters"] * free
    words += [each.name if each.sizes else f"&{each.name}" for each in outs]
    return "\n".join(
        [
            "    worst = 0.0;",
            "    for (k = 0; k < GOLDEN_STATES; ++k) {",
            *room,
            *begin,
            f"        one = difference(lw_{call.name}({', '.join(words)}), {judged.name}, "
            f"{expected}[k], {size(judged)});",
            "        worst = one > worst ? one : worst;",
            "    }",
            f'    wrong += told("{call.name}", worst);',
        ]
    )


def size(argument: Argument) -> str:
    """Return how many numbers an array has, in C."""
    return " * ".join(f"LW_{each}" for each in argument.sizes)


def closed_states(robot: Robot, random: np.random.Generator) -> list[np.ndarray]:
    """Return configurations near home with closed loops, where the independent rates determine the
    motion well; home itself where none is found."""
    closing = PROGRAMS["closing"].make(robot)
    tree, found = robot.equations.tree, []
    for _ in range(STATES):
        aside = SPREAD * tree.units * random.normal(size=robot.equations.nq)
        for k in range(NEARER):
            q = robot.home.q + aside / 2**k
            gap, pivot = 1.0, 0.0
            for _ in range(NEWTON):
                after, gap, _, pivot = closing(q, robot.p)
                if not gap > 1e-14:
                    break
                q = np.array(after).ravel()
            if float(gap) < 1e-13 * robot.size and float(pivot) > STRONG:
                found.append(q)
                break
    return found or [robot.home.q]


def evaluated(robot: Robot, call: Call, rows: Sequence[Sequence[np.ndarray]]) -> list[np.ndarray]:
    """Return what a program gives of the array that is judged, for rows of inputs, as CasADi finds
    it."""
    outputs = [each for each in call.arguments if each.role == "out"]
    function, place = PROGRAMS[call.name].make(robot), outputs.index(judged_of(call))
    results = [function.call([*map(ca.DM, row), ca.DM(robot.p)]) for row in rows]
    return [np.array(result[place]).ravel() for result in results]


def judged_of(call: Call) -> Argument:
    """Return the array that is compared: the last one of a program's, the configuration that is
    found."""
    arrays = [each for each in call.arguments if each.role != "in" and each.sizes]
    return arrays[-1] if call.body is None else arrays[0]
