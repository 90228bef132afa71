"""Evaluation: terms of the equations of motion at states, in each state's chart, refused where they
are singular."""

from __future__ import annotations

from collections.abc import Mapping
from math import isfinite
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from linkwork.errors import LinkworkError
from linkwork.model import actuation, checks, not_finite
from linkwork.model.chart_transfer import chart_in, reread
from linkwork.model.directly import LOOKED_AT, shaped
from linkwork.model.reordering import evaluated
from linkwork.model.state import State
from linkwork.threads import number_of

if TYPE_CHECKING:
    from linkwork.model.model import Model

BORNE = 100  # times that forces are found anew with the friction that they cause
SETTLED = 1e-14  # change of these, over the largest, that is rounding


def in_chart(robot: Model, state: State, names: tuple[str, ...]) -> State:
    """Return the same state with the rates of these names as the independent ones:
    `Robot.in_chart`."""
    given, chart = robot.chart_of(robot.own(state)), None
    for q in state.q.reshape(-1, state.q.shape[-1]):
        if chart is None or not abs(chart.pivot(q)) > checks.PIVOT_BOUND:
            chart = chart_in(robot, names, q)
        if chart is None:
            able = robot.chart.better(
                q, tuple(map(robot.equations.tree.rates.index, names))
            ).independent
            raise LinkworkError(
                f"the rates {', '.join(names)} do not determine the motion here; "
                f"{', '.join(able)} do"
            )
    if chart is None:
        raise LinkworkError(
            "the stack of states is empty; there is no configuration to choose the rates at"
        )
    rates, kept = reread(robot, given, chart, state.q, state.rates)
    if not kept.all():
        raise LinkworkError(
            f"the motion cannot be told in the rates {', '.join(names)}: "
            f"{', '.join(state.independent)}, in which it is given, do not determine it here; "
            "give a state at rest, and then its rates"
        )
    robot.charts[names] = chart
    return State.known(state.positions, rates, state.q, state.coordinates, names)


def outputs(
    robot: Model, name: str, state: State, *given: np.ndarray, threads: int = 1
) -> tuple[np.ndarray, ...]:
    """Return what a kernel (q, given) -> (..., pivot) gives at states, in their chart and in good
    orders of elimination."""
    chart = robot.chart_of(state)
    return evaluated(
        robot, chart, lambda other: other.kernel(name), state.q, *given, threads=threads
    )


def dynamics(
    robot: Model, name: str, state: State, values: np.ndarray, what: str, threads: int | None = 1
) -> np.ndarray:
    """Evaluate a kernel (q, v, given) -> (..., n results, pivot); one state takes the shortest
    way."""
    chart = robot.chart_of(robot.own(state))
    kernel, q, n = chart.kernel(name), state.q, len(state.independent)
    share = number_of(threads)
    if values.ndim == 1 and q.ndim == 1:
        y = kernel.flat(q, state.rates, values, robot.p)
        numbers = y.tolist()[-1 - n :]
        if abs(numbers[-1]) > checks.sure(chart.key) and isfinite(sum(numbers)):
            return y[-1 - n : -1]
    else:
        checks.together(state.batch, values.shape[:-1])
    *_, result, pivot = outputs(robot, name, state, state.rates, values, threads=share)
    require_regular(robot, state, pivot, result, values, what)
    return result


def actuator_forces(
    robot: Model,
    state: State,
    accelerations: ArrayLike | Mapping[str, ArrayLike],
    weights: ArrayLike | Mapping[str, float] | None,
    threads: int | None = 1,
) -> np.ndarray:
    """Return u (..., actuators) with S' u = M v' + C v + G - f, of least weighted norm:
    `Robot.inverse_dynamics`."""
    found = robot.directly("inverse_dynamics").at(state, accelerations, threads)
    if found is not None and weights is None and state.independent == robot.actuators:
        return found
    v_dot = checks.accelerations(accelerations, robot.own(state).independent)
    f = dynamics(robot, "inverse_dynamics", state, v_dot, "accelerations", threads)
    W = 1.0 if weights is None else of_actuators(robot, weights)
    if state.independent == robot.actuators:
        return f
    units = own_units(robot, state)
    S, f = units.map(actuation_map(robot, state)), f * units.rates
    parts = np.abs(f).max(axis=-1, initial=0.0)
    if robot.idle:
        M, *forces = terms(robot, state)
        forces.append((M @ v_dot[..., None])[..., 0])
        parts = np.max(
            [np.abs(force * units.rates).max(axis=-1) for force in np.broadcast_arrays(*forces)],
            axis=0,
        )
        f = actuation.idle_left(S, units.inertia(M), f, len(robot.idle))
    weights = np.asarray(W / units.actuators**2)
    u = actuation.least_forces(S, f, weights)
    if robot.rubs:
        f, u = borne(robot, state, v_dot, S, u, weights, units)
    actuation.require_driven(S, f, u, parts, state.independent, len(robot.idle))
    return u / units.actuators


def borne(
    robot: Model,
    state: State,
    v_dot: np.ndarray,
    S: np.ndarray,
    u: np.ndarray,
    weights: np.ndarray,
    units: actuation.Units,
) -> tuple[np.ndarray, np.ndarray]:
    """Return forces on the rates and u of the actuators, in own units, where bearings carry what
    they do under u itself; u: a first guess."""
    for _ in range(BORNE):
        given = state.rates, v_dot, u / units.actuators
        f, pivot = outputs(robot, "inverse_dynamics_borne", state, *given)
        require_regular(robot, state, pivot, f, v_dot, "accelerations")
        f, before = f * units.rates, u
        u = actuation.least_forces(S, f, weights)
        if (np.abs(u - before) <= SETTLED * np.abs(u).max(initial=0.0)).all():
            return f, u
    raise LinkworkError(
        "the actuator forces that this needs are not found, for bearings carry what grows with "
        "them as fast as their friction does; give smaller coefficients, or other actuators"
    )


def own_units(robot: Model, state: State) -> actuation.Units:
    """Return the mechanism's own units of the actuated rates and of a state's independent ones, but
    for the time."""
    return robot.once(units_in, state.independent)


def units_in(robot: Model, independent: tuple[str, ...]) -> actuation.Units:
    """Return the same of independent rates by their names."""
    length = robot.equations.tree.length
    driven = np.array([length if robot.unit(name) == "m" else 1.0 for name in robot.actuators])
    return actuation.Units(driven, robot.charts[independent].units[robot.equations.nq :])


def of_actuators(
    robot: Model, values: ArrayLike | Mapping[str, float], what: str = "weights"
) -> np.ndarray:
    """Return positive numbers (actuators), given in their order or by name."""
    found = checks.values_by_name(values, robot.actuators, what, "actuator")
    if not (found.ndim == 1 and (found > 0).all()):
        raise LinkworkError(
            f"{what} {found.tolist()} do not fit; give one positive number per actuator"
        )
    return found


def actuation_map(robot: Model, state: State) -> np.ndarray:
    """Return S (..., actuators, n): `Robot.actuation`."""
    if not robot.actuators:
        return np.zeros((*robot.own(state).batch, 0, len(state.independent)))
    return told(robot, "actuation", state)[0]


def internal_forces(robot: Model, state: State, weights: np.ndarray | None = None) -> np.ndarray:
    """Return the actuator forces B (actuators, k) with S' B = 0 and B' W B = 1 at one state:
    `Robot.internal_forces`."""
    if robot.own(state).batch:
        raise LinkworkError(
            "internal forces are those of one state, not of a stack; take one by state.at(index)"
        )
    units, W = own_units(robot, state), 1.0 if weights is None else weights
    S = actuation_map(robot, state)
    if state.independent == robot.actuators:
        return np.zeros((len(S), 0))  # S = 1
    B = actuation.internal_forces(units.map(S), W / units.actuators**2)
    return B / units.actuators[:, None]


class MotionTerms(NamedTuple):
    """Hold M (..., n, n), C v, G and f (..., n) of M v' + C v + G = S' u + f."""

    M: np.ndarray
    Cv: np.ndarray
    G: np.ndarray
    f: np.ndarray


def terms(robot: Model, state: State) -> MotionTerms:
    """Return the terms of the equations of motion in a state or a stack of states."""
    return MotionTerms(*told(robot, "terms", state))


def told(
    robot: Model, name: str, state: State, v_dot: ArrayLike | Mapping[str, ArrayLike] | None = None
) -> tuple[np.ndarray, ...]:
    """Return what a chart's kernel (q[, v][, v']) tells at states, but the pivot, formed as
    `directly.FORMS` says: actuation, terms, energy, maps, joints_motion, tool_motion."""
    if (found := robot.directly(name).at(state, v_dot)) is not None:
        return found
    # Stacks, weak orders of elimination, and what is to be refused.
    given, what = of_motion(robot.own(state), v_dot)
    inputs = () if name in ("actuation", "maps") else given
    *found, pivot = outputs(robot, name, state, *inputs)
    require_regular(robot, state, pivot, found[LOOKED_AT.get(name, -1)], given[-1], what)
    return shaped(name, found, len(state.independent))


def of_motion(
    state: State, v_dot: ArrayLike | Mapping[str, ArrayLike] | None
) -> tuple[tuple[np.ndarray, ...], str]:
    """Return what a kernel takes of a motion beside q, v and v' if it is given, and the name of the
    last of them."""
    if v_dot is None:
        return (state.rates,), "rates"
    accelerations = checks.accelerations(v_dot, state.independent)
    checks.together(state.batch, accelerations.shape[:-1])
    return (state.rates, accelerations), "accelerations"


def require_regular(
    robot: Model, state: State, pivot: np.ndarray, result: np.ndarray, given: np.ndarray, what: str
) -> None:
    """Refuse results where the rates of the state do not determine the motion, or that are not
    finite."""
    weakest = checks.weakest(pivot)
    finite = pivot.size == 1 and isfinite(sum(result.ravel().tolist()))
    if weakest > checks.PIVOT_BOUND and (finite or np.isfinite(result).all()):
        return
    checks.finite(given, what)
    checks.finite(state.rates, "the state's rates")
    if weakest > checks.PIVOT_BOUND:
        raise not_finite.refusal(robot.chart_of(state), state.q)
    raise checks.singular(state.independent, pivot)
