"""The same forward dynamics in other hands, all in one interleaved run: rates of states and their
ratios."""

from __future__ import annotations

import numpy as np

import linkwork as lw
from linkwork.lab.textbook import Textbook
from linkwork.robots import prr3

from benchmarks import by_hand, engines, native
from benchmarks.kernel import inputs
from benchmarks.table import Figure, Section
from benchmarks.timing import Contender, interleaved, summary

STATES = 64


def run(rounds: int = 100) -> Section:
    """Time one evaluation of forward dynamics in every contender, and form the ratios of the
    medians."""
    robot = lw.Robot(prr3())
    seconds = interleaved(contenders(robot), rounds)
    median = {name: float(np.median(values)) for name, values in seconds.items()}
    batch, chained, pinocchio = (
        median["Linkwork, batch"],
        median["Linkwork, one by one"],
        median["Pinocchio"],
    )
    bare = pinocchio - median["Pinocchio, empty call"]
    error = {name: float(np.median(values)) for name, values in errors(robot).items()}
    figures = [
        *(Figure(f"{name}, per state", 1e6 * value, "µs", note=note(name, seconds, error))
          for name, value in median.items()),
        Figure("batches on one core: times Pinocchio's rate of states", pinocchio / batch, "", 200,
               "at least"),
        Figure("one by one, native: times Pinocchio's rate", pinocchio / chained, "", 25,
               "at least"),
        Figure("batches: times Pinocchio's rate, its empty call subtracted", bare / batch),
        Figure("one by one: times Pinocchio's rate, its empty call subtracted", bare / chained),
        Figure("batches: times MuJoCo's rate", median["MuJoCo"] / batch),
        Figure("batches: times NumPy's rate", median["NumPy by hand"] / batch),
    ]  # fmt: skip
    return Section(
        "Beside others",
        METHOD,
        figures,
        {"seconds": {name: summary(s) for name, s in seconds.items()}},
    )


METHOD = f"""
    Forward dynamics of the 3-PRR, in blocks of 2 ms that take turns; medians. Pinocchio:
    `constraintDynamics` called from Python in a tight loop over {STATES} prepared states, with the
    quickest proximal settings that keep its accuracy; the empty call is the same function on a
    model of one slider without loops, an upper bound of what calling from Python costs. MuJoCo:
    `mj_forward` alone. NumPy by hand: the lean equations of `by_hand.py`; textbook: the paper's
    matrices as printed. Errors: medians against the multipliers formulation in doubles, relative.
    """


def note(name: str, seconds: dict[str, np.ndarray], error: dict[str, float]) -> str:
    """Return the best block, and the contender's error where it was looked at."""
    text = f"best {1e6 * seconds[name].min():.3g}"
    return f"{text}, error {error[name]:.0e}" if name in error else text


def contenders(robot: lw.Robot) -> dict[str, Contender]:
    """Return forward dynamics in every hand, on random states over the workspace."""
    kernel = robot.kernel("motion")
    rates = robot.equations.nq + robot.mobility
    many, x = inputs(robot, native.STATES)
    states = many.at(slice(0, STATES))
    forces = x[:STATES, -robot.mobility :].copy()
    hand = by_hand_states(robot, states)
    textbook, one = Textbook(robot.mechanism), states.at(0)
    return {
        "Linkwork, batch": native.in_batches(kernel, x),
        "Linkwork, one by one": native.one_after_another(kernel, x, rates),
        "Linkwork, from Python": Contender(lambda: robot.forward_dynamics(one, forces[0])),
        "Pinocchio": engines.pinocchio_evaluations(robot, states, forces),
        "Pinocchio, empty call": engines.pinocchio_call(),
        "MuJoCo": engines.mujoco_evaluations(robot, states, forces),
        "NumPy by hand": Contender(lambda: by_hand.derivative(hand[0], one.rates, forces[0])),
        "NumPy, textbook": Contender(
            lambda: textbook.forward_dynamics(one.positions, one.rates, forces[0])
        ),
    }


def by_hand_states(robot: lw.Robot, states: lw.State) -> np.ndarray:
    """Return the coordinates (count, 9) that the equations by hand use."""
    poses = robot.tool_pose(states)
    return np.array(
        [by_hand.from_joints(q, pose) for q, pose in zip(states.positions, poses, strict=True)]
    )


def errors(robot: lw.Robot, count: int = 20) -> dict[str, np.ndarray]:
    """Return each contender's errors of the accelerations, max |a - a_ref| / max |a_ref|
    (count,)."""
    from tests.oracle import LagrangeOracle

    states, x = inputs(robot, count)
    forces, joint_rates = x[:, -robot.mobility :], robot.joint_rates(states)
    oracle, mujoco, pinocchio = (
        LagrangeOracle(robot.mechanism),
        engines.MujocoEngine(robot.mechanism),
        engines.pinocchio(robot),
    )
    hand = by_hand_states(robot, states)
    found = {
        "Linkwork, batch": robot.forward_dynamics(states, forces),
        "Pinocchio": [
            pinocchio.accelerations(*row)
            for row in zip(states.positions, joint_rates, forces, strict=True)
        ],
        "MuJoCo": [
            mujoco.accelerations(*row)
            for row in zip(states.positions, joint_rates, forces, strict=True)
        ],
        "NumPy by hand": [
            by_hand.derivative(*row)[1] for row in zip(hand, states.rates, forces, strict=True)
        ],
    }
    exact = np.array(
        [
            oracle.forward_dynamics(*row)
            for row in zip(states.positions, states.rates, forces, strict=True)
        ]
    )
    return {
        name: abs(np.array(a) - exact).max(axis=1) / abs(exact).max(axis=1)
        for name, a in found.items()
    }
