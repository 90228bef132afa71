"""Derivatives of forward dynamics through loops, beside forward dynamics and Pinocchio's; adjoints
of runs, explicit and stiff, beside the runs."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import partial

import numpy as np

import linkwork as lw
from linkwork.control import Observation
from linkwork.gradients import derivative_kernel
from linkwork.lab.engines.pinocchio import pin

from benchmarks import engines, native, stiff
from benchmarks.table import Figure, Listing, Section, quantity
from benchmarks.timing import Contender, interleaved, summary

STATES, STACK = 256, 4096
MOST = {"prr3": 6.0, "stewart": 8.0}  # times forward dynamics, promised
TIMES = 15.0  # Pinocchio's time over ours, promised
AGREEMENT = 1e-9
ADJOINT = 4.0  # times the run, promised
FORCES = 1.0, 0.5, -0.3  # N
METHOD = f"""
    The whole Jacobian of the accelerations v' with respect to q, v and u, in the rates of the
    actuators, at states near home. One: native code over {STATES} states, one after the other;
    batches: its vector code; call: the method of `Robot` from Python for one state, and for a stack
    of {STACK:,}, per state. Pinocchio: `computeConstraintDynamicsDerivatives` of the same robot,
    called from Python in a tight loop, after one `constraintDynamics`, whose time is not counted;
    of its tree, and so not yet along the loops. Where they are taken along the loops by our maps of
    the rates they agree with ours for the 3-PRR, which is asserted. Blocks of 2 ms that take turns;
    times are those of the quickest blocks, and ratios of these.
    """


def run(rounds: int = 60, robots: Mapping[str, float] = MOST) -> Section:
    """Time Jacobians and forward dynamics of all contenders in turn."""
    figures, rows, raw = [], [], {}
    for name, most in robots.items():
        robot = lw.Robot(name)
        states, forces = drawn(robot)
        seconds = interleaved(contenders(robot, states, forces), rounds)
        quickest = {key: float(each.min()) for key, each in seconds.items()}
        figures += ratios(name, most, quickest)
        rows += [(f"{name}: {key}", quantity(1e9 * each, "")) for key, each in quickest.items()]
        raw[name] = {key: summary(values) for key, values in seconds.items()}
    figures.append(
        Figure("3-PRR: largest relative difference of Pinocchio's", apart(), "", AGREEMENT)
    )
    for name, made in {"prr3": adjoints(), **stiff_adjoints()}.items():
        seconds = interleaved(made, rounds)
        quickest = {key: float(each.min()) for key, each in seconds.items()}
        figures += over_run(name, quickest)
        rows += [(f"{name}: {key}", quantity(1e9 * each, "")) for key, each in quickest.items()]
        raw[f"adjoints of {name}"] = {key: summary(values) for key, values in seconds.items()}
    listing = Listing(("contender", "a state, or a run [ns]"), rows)
    return Section("Derivatives", METHOD, figures, {"seconds": raw}, listing=listing)


def ratios(name: str, most: float, taken: Mapping[str, float]) -> list[Figure]:
    """Return the Jacobian's times over those of forward dynamics, and Pinocchio's over them."""
    ways = "one", "batches", "call", "call, stack"
    times = [
        Figure(f"{name}: times forward dynamics, {way}",
               taken[f"Jacobian, {way}"] / taken[f"dynamics, {way}"], "", most)
        for way in ways
    ]  # fmt: skip
    quicker = [
        Figure(f"{name}: quicker than Pinocchio's, {way}",
               taken["Pinocchio"] / taken[f"Jacobian, {way}"], "",
               None if way == "call" else TIMES, "at least")
        for way in ways
    ]  # fmt: skip
    return [*times, *quicker]


def drawn(robot: lw.Robot) -> tuple[lw.State, np.ndarray]:
    """Return a stack of states beside home, and forces."""
    numbers = np.random.default_rng(7)
    home = np.tile(robot.home.positions, (STACK, 1))
    positions = home + 1e-3 * numbers.standard_normal(home.shape)
    rates = 0.3 * numbers.standard_normal((STACK, robot.mobility))
    states = robot.state(positions, rates, tolerance=0.5)
    return states, numbers.standard_normal((STACK, len(robot.actuators)))


def contenders(robot: lw.Robot, states: lw.State, forces: np.ndarray) -> dict[str, Contender]:
    """Return Jacobians and forward dynamics, ours in four ways, and Pinocchio's derivatives."""
    kernels = {
        "dynamics": robot.kernel("motion"),
        "Jacobian": derivative_kernel(robot, "forward_dynamics"),
    }
    x = np.hstack([states.q, states.rates, forces])[:STATES]
    calls = {"dynamics": robot.forward_dynamics, "Jacobian": robot.forward_dynamics_derivatives}
    one, u = states.at(0), forces[0]
    found: dict[str, Contender] = {}
    for name, kernel in kernels.items():
        found |= {
            f"{name}, one": native.one_by_one(kernel, x),
            f"{name}, batches": native.in_batches(kernel, x),
            f"{name}, call": Contender(bound(calls[name], one, u)),
            f"{name}, call, stack": Contender(bound(calls[name], states, forces), STACK),
        }
    engine = engines.pinocchio(robot)
    evaluate = engine.evaluation(one.positions, robot.joint_rates(one), u)
    evaluate()
    given = engine.model, engine.data, engine.constraints, engine.constraint_data, engine.proximal
    found["Pinocchio"] = Contender(bound(pin.computeConstraintDynamicsDerivatives, *given))
    return found


def adjoints() -> dict[str, Contender]:
    """Return a run of 1 s, and the ways to its derivatives, two of which make it."""
    robot = lw.Robot("prr3")

    def run() -> lw.Run:
        return robot.simulate(robot.home, FORCES, duration=1.0)

    def away(t: object, state: Observation) -> object:
        x, y, _ = state.tool_pose
        return (x - 0.28) ** 2 + (y - 0.15) ** 2

    return {
        "run and robot.gradient": Contender(
            lambda: robot.gradient(away, robot.home, FORCES, duration=1.0)
        ),
        **of_run(run, "tool_pose"),
    }


def of_run(run: Callable[[], lw.Run], quantity: str) -> dict[str, Contender]:
    """Return a run, and its adjoint of a quantity, of a run that is there and of one just made."""
    made = run()
    weights = {quantity: np.ones(made.variables[quantity].shape)}
    return {
        "run": Contender(run),
        "adjoint asked again": Contender(lambda: made.gradient(weights)),
        "run and its adjoint": Contender(lambda: run().gradient(weights)),
    }


def stiff_adjoints() -> dict[str, dict[str, Contender]]:
    """Return runs by the stiff method and their adjoints, of the 3-PRR and the stiff governor."""
    robot, governor = lw.Robot("prr3"), lw.Robot("flyball_governor")
    spin = governor.home.with_rates(dict.fromkeys(stiff.JOINTS, 0.0) | {"spindle": stiff.SPIN})
    runs = {
        "prr3, rodas": partial(robot.simulate, robot.home, FORCES),
        "governor, rodas": partial(governor.simulate, spin, rtol=stiff.CHOSEN),
    }
    return {
        name: of_run(partial(run, duration=1.0, method="rodas"), "joint_position")
        for name, run in runs.items()
    }


def over_run(name: str, taken: Mapping[str, float]) -> list[Figure]:
    """Return the times of adjoints over that of the run, which all but one of them make; of
    explicit steps they are promised."""
    own, most = taken["run"], ADJOINT if name == "prr3" else None
    ways = {
        "robot.gradient": taken.get("run and robot.gradient", 0.0) - own,
        "asked again": taken["adjoint asked again"],
        "just made": taken["run and its adjoint"] - own,
    }
    return [
        Figure(f"{name}: adjoint, times a run of 1 s, {way}", seconds / own, "", most)
        for way, seconds in ways.items()
        if way != "robot.gradient" or "run and robot.gradient" in taken
    ]


def bound(function: Callable[..., object], *given: object) -> Callable[[], object]:
    """Return a call without arguments."""
    return lambda: function(*given)


def apart() -> float:
    """Return the largest relative difference of Pinocchio's derivatives of the 3-PRR along its
    loops."""
    robot = lw.Robot("prr3")
    states, forces = drawn(robot)
    state, u, live = states.at(0), forces[0], robot.to_pinocchio()
    q, v = live.configuration(state)
    data, held = live.model.createData(), pin.StdVec_RigidConstraintData()
    for constraint in live.constraints:
        held.append(constraint.createData())
    pin.initConstraintDynamics(live.model, data, live.constraints, held)
    settings = pin.ProximalSettings(1e-12, 1e-12, 1e-8, 50)
    pin.constraintDynamics(live.model, data, q, v, live.forces(u), live.constraints, held, settings)
    by_q, by_v, *_ = pin.computeConstraintDynamicsDerivatives(
        live.model, data, live.constraints, held, settings
    )
    # Along the loops: dq = S dxi, dw = W dxi + S dv.
    places = {joint.freedom.rates[0]: joint.v.start for joint in live.joints}
    order = sorted(places, key=lambda name: places[name])
    rows = [robot.rates.index(name) for name in order]
    joints = robot.closure_derivatives(state)
    S, W = joints.rates_by_v[rows], joints.rates_by_q[rows]
    own = [order.index(name) for name in robot.independent]
    exact = robot.forward_dynamics_derivatives(state, u)
    pairs = ((by_q @ S + by_v @ W)[own], exact.by_q), ((by_v @ S)[own], exact.by_v)
    return max(float(np.abs(theirs - ours).max() / np.abs(ours).max()) for theirs, ours in pairs)
