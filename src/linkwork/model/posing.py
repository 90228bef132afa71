"""Posing: make states from coordinates of joints."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from linkwork.equations.reference import CLOSED, tree_coordinates, unit
from linkwork.errors import LinkworkError
from linkwork.model import checks
from linkwork.model.checks import OPEN_LOOPS
from linkwork.model.closing import settled
from linkwork.model.stacks import undoubted
from linkwork.model.state import State, with_positions
from linkwork.model.whole_turns import TurnedLabels
from linkwork.threads import number_of

if TYPE_CHECKING:
    from linkwork.model.model import Model

Rates = ArrayLike | Mapping[str, ArrayLike] | None


def state(
    robot: Model,
    positions: ArrayLike | Mapping[str, ArrayLike],
    rates: Rates,
    tolerance: float,
    threads: int | None = 1,
) -> State:
    """Make a state from the coordinates of all joints: `Robot.state`."""
    # What nothing is doubtful about is read off at once.
    checks.positive(tolerance, "the tolerance")
    if type(positions) is not np.ndarray:
        positions = checks.values_by_name(
            positions, robot.coordinates, "positions", "joint coordinate"
        )
    told = undoubted(robot, positions, tolerance, number_of(threads))
    if told is not None:
        (q, read), v = told, independent_rates(robot, rates, told.q)
        if q.ndim > 1 or v.ndim > 1:
            batch = checks.together(q.shape[:-1], v.shape[:-1])
            read, v, q = (
                np.ascontiguousarray(np.broadcast_to(x, (*batch, x.shape[-1])))
                for x in (read, v, q)
            )
        return State.known(read, v, q, robot.coordinates, robot.independent)
    # Loops that are open by little are closed; what is open by more is refused.
    given = checks.values_by_name(positions, robot.coordinates, "positions", "joint coordinate")
    q = of_tree(robot, given)
    closure_step = robot.kernel("closure_step")
    gap = closure_step(q)[1][..., 0]
    if not (widest := gap.max(initial=0.0)) <= tolerance:
        require_turns(given, robot.labels)
        checks.require_closed(gap, tolerance, lambda index: open_row(robot, q[index]))
    if widest > CLOSED:
        q, gap = settled(closure_step, q, robot.p)
        require_closing(robot, q, gap)
    # Coordinates agree with the closed configuration, but for whole turns, which are kept.
    made, labels = stacked(robot, q, rates), robot.labels
    windings, mismatch = labels.compared(given, made.positions)
    if not mismatch.max(initial=0.0) <= 10 * tolerance:
        require_turns(given, labels)
        require_consistent(made.positions, given, labels, mismatch > 10 * tolerance)
    return with_positions(made, labels.turned(made.positions, windings))


def require_turns(given: np.ndarray, labels: TurnedLabels) -> None:
    """Refuse quaternions of length zero."""
    for name, places in labels.all_quaternions.items():
        if not np.linalg.norm(given[..., places], axis=-1).min(initial=np.inf) > 0:
            raise LinkworkError(
                f"the quaternion of joint {name!r} is zero; give one of any other length, such "
                "as 1, 0, 0, 0"
            )


def require_consistent(
    closed: np.ndarray, given: np.ndarray, labels: TurnedLabels, wrong: np.ndarray
) -> None:
    """Refuse coordinates that contradict the closed configuration; wrong: which do (..., m).

    Angles may differ by whole turns where these act on nothing. A quaternion may be given at any
    length and with either sign.
    """
    if not wrong.any():
        return
    index = tuple(int(i) for i in np.argwhere(wrong)[0])
    name = labels.equations.mechanism.coordinates[index[-1]]
    there = np.broadcast_to(given, wrong.shape)[index[:-1]]
    value = there[index[-1]]
    for places in labels.all_quaternions.values():
        if index[-1] in places:
            p = there[places]
            value *= np.copysign(1 / np.linalg.norm(p), p @ closed[index[:-1]][places])
    acting = (
        ", and its spring, gear or thread counts whole turns" if labels.counted[index[-1]] else ""
    )
    raise LinkworkError(
        f"joint {name!r} is given as {value:.6g}, but the other joints make it "
        f"{closed[index]:.6g}{acting}"
    )


def require_closing(robot: Model, q: np.ndarray, gap: np.ndarray) -> None:
    """Refuse configurations that Newton's method does not close."""
    if not (gap <= OPEN_LOOPS).all():
        index = tuple(int(i) for i in np.argwhere(~(gap <= OPEN_LOOPS))[0])
        raise LinkworkError(
            f"the loops do not close from these positions: {open_row(robot, q[index])} stays "
            f"open by {gap[index]:.3g}; give positions nearer to a closed configuration, or "
            "close them by robot.assemble"
        )


def stacked(robot: Model, q: np.ndarray, rates: Rates) -> State:
    """Return the states of configurations q (..., nq) with rates, their leading dimensions brought
    together."""
    if rates is None:
        return robot.make_state(q, np.zeros((*q.shape[:-1], robot.mobility)))
    v = independent_rates(robot, rates, q)
    batch = checks.together(q.shape[:-1], v.shape[:-1])
    return robot.make_state(
        np.broadcast_to(q, (*batch, q.shape[-1])), np.broadcast_to(v, (*batch, robot.mobility))
    )


def start_of(robot: Model, guess: State | None) -> State:
    """Return a guess, `home` where there is none."""
    state = robot.home if guess is None else robot.own(guess)
    if state.batch:
        raise LinkworkError("the guess is a stack of states; give one of them")
    return state


def independent_rates(robot: Model, rates: Rates, q: np.ndarray) -> np.ndarray:
    """Return v (..., n) from an array, from the independent rates by name, or from n rates of any
    joints by name."""
    if rates is None:
        return np.zeros(robot.mobility)
    if isinstance(rates, Mapping) and set(rates) <= set(robot.independent):
        rates = {name: rates.get(name, 0.0) for name in robot.independent}
    if not isinstance(rates, Mapping) or set(rates) <= set(robot.independent):
        return checks.values_by_name(rates, robot.independent, "rates", "independent rate")
    checks.known(rates, robot.rates, "rate")
    if len(rates) != robot.mobility:
        raise LinkworkError(
            f"{checks.amount_is(len(rates), 'rate')} given; give {robot.mobility}, for "
            f"instance {', '.join(robot.independent)}"
        )
    given = checks.values_by_name(rates, tuple(rates), "rates", "rate")
    checks.together(given.shape[:-1], q.shape[:-1])
    v, told = rates_told(robot, tuple(rates), given, q, robot.p)
    if not told.all():
        raise LinkworkError(
            f"the rates {', '.join(rates)} do not determine the motion here; give others"
        )
    return v


def rates_told(
    robot: Model, names: tuple[str, ...], given: np.ndarray, q: np.ndarray, p: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return v (..., n) from n rates of any joints (..., n), and where these determine the
    motion."""
    L = robot.kernel("maps")(q, p)[0].reshape(*q.shape[:-1], robot.mobility, -1)
    A = np.swapaxes(L[..., [robot.rates.index(name) for name in names]], -1, -2)
    least, most = (np.linalg.norm(x, order, (-2, -1)) for x, order in ((A, -2), (L, 2)))
    told = least >= checks.PIVOT_BOUND**2 * most
    A = np.where(told[..., None, None], A, np.eye(robot.mobility))
    return np.linalg.solve(A, given[..., None])[..., 0], told


def of_tree(robot: Model, positions: np.ndarray) -> np.ndarray:
    """Return q (..., nq) from the coordinates of all joints (..., m), its quaternions at length
    1."""
    tree, topology = robot.equations.tree, robot.equations.topology
    if not topology.added:
        q = positions.take(robot.labels.of_tree, axis=-1)
    else:
        require_turns(positions, robot.labels)
        flat = positions.reshape(-1, positions.shape[-1])
        values = (dict(zip(robot.coordinates, row, strict=True)) for row in flat)
        found = [tree_coordinates(robot.mechanism, topology, tree, value) for value in values]
        q = np.array(found).reshape(*positions.shape[:-1], -1)
    if not tree.quaternions:
        return q
    with np.errstate(invalid="ignore"):
        return unit(tree, q)


def open_row(robot: Model, q: np.ndarray) -> str:
    """Name the closure row that is open most."""
    rows = robot.equations.rows
    return rows.names[int(np.argmax(np.abs(robot.chart.residuals(q) / rows.units)))]
