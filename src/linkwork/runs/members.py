"""Members: what the runs of an ensemble go out from. All that was given, put together, a row for
each member."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import product
from math import prod
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from linkwork.control.events import Event
from linkwork.errors import LinkworkError
from linkwork.mechanism import Mechanism, formulas
from linkwork.mechanism.numbers import edited, located, places_of
from linkwork.mechanism.refusal import MechanismError
from linkwork.model import checks
from linkwork.model.chart_transfer import reread
from linkwork.model.charts import CompiledChart
from linkwork.model.checks import OPEN_LOOPS
from linkwork.model.parameters import with_parameters
from linkwork.model.state import State
from linkwork.runs.cable_leaps import tell_leaps
from linkwork.runs.system import FREED, System, plain, require_starts, system
from linkwork.simulation import Sampled, Signal
from linkwork.simulation.many import MemberInputs, as_inputs, require_covers

if TYPE_CHECKING:
    from linkwork.model.model import Model


@dataclass(frozen=True, eq=False)
class Members:
    """Hold what the members of an ensemble go out from.

    system: what is integrated
    forces: the signals, or numbers (N, nu), of each member, in place of the system's; None: all
        share these
    chart: of the lanes; q (N, nq), v (N, n) in this chart; p: the system's parameters, (1, np) or
        (N, np)
    given: the states as they were given, one or a stack of N
    told: whether v tells all of their motion (N,)
    varied: values of parameters that vary, by name (N,)
    span: start and end of the runs [s]
    """

    robot: Model
    system: System
    forces: np.ndarray | Sequence[Signal] | None
    chart: CompiledChart
    given: State
    told: np.ndarray
    q: np.ndarray
    v: np.ndarray
    p: np.ndarray
    varied: Mapping[str, np.ndarray]
    span: tuple[float, float]

    def __len__(self) -> int:
        return len(self.q)

    def start(self, members: np.ndarray) -> np.ndarray:
        """Return the states y = (q, v, z) of some members (M, n), which all share their memory if
        all start alike."""
        rows = slice(1) if self.alike else self._rows(members)
        q, v = self.q[rows], self.v[rows]
        positions = self.given.positions[rows] if self.given.batch else self.given.positions
        z = self.system.start(self.robot, positions, q)
        z = np.broadcast_to(z, (len(q), z.shape[-1]))
        return np.broadcast_to(
            np.concatenate([q, v, z], axis=1), (len(members), q.shape[1] + v.shape[1] + z.shape[1])
        )

    @property
    def alike(self) -> bool:
        """Whether q and v repeat a single row."""
        return not any(self.q.strides[:1] + self.v.strides[:1])

    def state(self, member: int) -> State:
        """Return the state that one member was given."""
        return self.given.at(member) if self.given.batch else self.given

    def _rows(self, members: np.ndarray) -> np.ndarray | slice:
        """Return some members, in the order of their numbers, as rows of a table: all of them
        without a copy."""
        return slice(None) if len(members) == len(self) else members

    def p_robot(self, members: np.ndarray | slice = slice(None)) -> np.ndarray:
        """Return the robot's parameters (1, np) or of some members (M, np)."""
        return np.ascontiguousarray(
            (self.p[members] if len(self.p) > 1 else self.p)[:, : self.robot.p.size]
        )

    @property
    def signals(self) -> list[Signal]:
        """The inputs over time: those of all members, and those of each if they are given as
        such."""
        own = () if self.forces is None or isinstance(self.forces, np.ndarray) else self.forces
        return [self.system.inputs, *own]

    @cached_property
    def inputs(self) -> MemberInputs:
        """The inputs of all members."""
        acting = self.system.acting
        joined = acting is not None and (acting.timed or acting.references)
        if self.forces is None:
            given = self.system.inputs
        elif isinstance(self.forces, np.ndarray) and not joined:
            given = self.forces
        else:
            given = [self.signal(i) for i in range(len(self))]
        require_covers(given, *self.span)
        return as_inputs(given, len(self))

    def inputs_at(self, members: np.ndarray, t: np.ndarray, held: np.ndarray) -> np.ndarray:
        """Return the integrator's inputs (rows, nu) of a member in each row, at its time [s].

        held: by a sampled controller (rows, inputs)
        """
        if self.forces is None:
            given = self.system.inputs(t)
        else:
            of_each = {i: self.signal(i) for i in np.unique(members).tolist()}
            each = zip(members.tolist(), t, strict=True)
            given = np.array([of_each[i](time) for i, time in each])
        return np.concatenate([given, held], axis=1)

    def signal(self, member: int) -> Signal:
        """Return the inputs of one member: its forces, joined with what else varies in time."""
        if self.forces is None:
            return self.system.inputs
        given, acting = self.forces[member], self.system.acting
        own = given if isinstance(given, Signal) else constant(given)
        return acting.inputs(own) if acting else own

    @cached_property
    def watched(self) -> MemberInputs | None:
        """What no step of the members may pass over, None if their inputs are all of it."""
        if self.system.acting is None or self.system.acting.timely is None:
            return None
        chart, count = self.robot.chart, self.robot.p.size
        if self.forces is None and len(self.p) == 1:
            seen = self.system.watch(chart, self.span)
            return as_inputs(seen.signal, len(self)) if seen else None
        systems = [
            replace(self.system, inputs=self.signal(i), parameters=p[count:])
            for i, p in enumerate(np.broadcast_to(self.p, (len(self), self.p.shape[1])))
        ]
        seen = [system.watch(chart, self.span) for system in systems]
        if not any(seen):
            return None
        signals = [
            own.signal if own else system.inputs for own, system in zip(seen, systems, strict=True)
        ]
        return as_inputs(signals, len(self))

    def alone(self, member: int) -> tuple[Model, System]:
        """Return the robot and the system of one member."""
        values = {
            name: float(given[member])
            for name, given in self.varied.items()
            if name in self.robot.parameters
        }
        robot = with_parameters(self.robot, values) if values else self.robot
        p = self.p[member if len(self.p) > 1 else 0]
        return robot, replace(
            self.system, inputs=self.signal(member), parameters=p[robot.p.size :], faults=[]
        )


def constant(values: np.ndarray) -> Signal:
    """Return numbers as a signal; those that are not finite are let through: they end their own
    member's run alone."""
    coefficients = np.zeros((1, 4, values.size))
    coefficients[0, 0] = values
    return Signal(np.array([0.0, np.inf]), coefficients, np.empty(0))


def members(
    robot: Model,
    states: State,
    forces: Any,
    parameters: Mapping[str, ArrayLike],
    drives: Mapping[str, Any] | None,
    wrenches: Sequence[Any],
    events: Sequence[Event],
    duration: float,
    joined: bool,
) -> Members:
    """Put together what the members go out from; refuse what does not fit.

    joined: whether the system is to be one with controllers, for forces alone, too
    """
    # What acts on all of them, and the states that they start in.
    own = isinstance(parameters, Mapping) and not parameters.keys().isdisjoint(robot.parameters)
    state = robot.own(states, alike=not own)
    if len(state.batch) > 1:
        raise LinkworkError(
            f"the states are a stack of the shape {state.batch}; give a list of N states, or one "
            "for all"
        )
    each, shared = forces_of_each(robot, forces)
    runs = system(robot, shared, drives, wrenches, events, {}, (0.0, duration), joined, state)
    # What varies: numbers of the robot and of what acts, one for each member.
    names = (*robot.parameters, *(runs.acting.parameters if runs.acting else ()))
    checks.known(parameters, names, "parameter", FREED)
    varied = {
        name: checks.finite(values, f"parameter {name!r}") for name, values in parameters.items()
    }
    for name, values in varied.items():
        if values.ndim > 1:
            raise LinkworkError(
                f"parameter {name!r} has the shape {values.shape}; give one number for each member"
            )
    # Members are as many as states, forces and parameters say alike.
    lengths = {f"parameter {name!r}": values.size for name, values in varied.items() if values.ndim}
    lengths |= {"states": state.batch[0]} if state.batch else {}
    lengths |= {"forces": len(each)} if each is not None else {}
    if len(set(lengths.values())) > 1:
        raise LinkworkError(
            "members do not fit together: "
            f"{', '.join(f'{count} of {what}' for what, count in lengths.items())}; give one for "
            "all, or equally many"
        )
    if runs.acting:
        runs.acting.require(varied)
    count = next(iter(lengths.values()), 1)
    # Parameters of each member.
    p = runs.p(robot.chart)[None, :]
    if varied:
        p = np.repeat(p, count, axis=0)
        for name, values in varied.items():
            p[:, names.index(name)] = values
    require_starts(runs, state, p[:, robot.p.size :])
    # The chart that runs start in, where the rates of all of them can be told in it.
    chart, q = robot.chart_of(state), np.broadcast_to(state.q, (count, state.q.shape[-1]))
    v, told = np.broadcast_to(state.rates, (count, state.rates.shape[-1])), np.ones(count, bool)
    if chart is robot.chart and chart is not robot.run_chart:
        chart = robot.run_chart
        v, told = reread(
            robot, robot.chart, chart, q, v, np.ascontiguousarray(p[:, : robot.p.size])
        )
    varied = {name: np.broadcast_to(values, count) for name, values in varied.items()}
    require_possible(
        robot, {name: values for name, values in varied.items() if name in robot.parameters}, q, p
    )
    tell_leaps(robot, q, p[:, : robot.p.size])
    return Members(robot, runs, each, chart, state, told, q, v, p, varied, (0.0, duration))


def require_possible(
    robot: Model, own: Mapping[str, np.ndarray], q: np.ndarray, p: np.ndarray
) -> None:
    """Refuse members with numbers that no description may hold, or whose loops are open.

    Args:
        own: values of the robot's parameters by name (N,).
        q: (N, nq); p: of the system (N, np).
    """
    if not own or not len(q):
        return
    require_numbers(robot.mechanism, own)
    require_closed(robot, q, p, np.arange(len(q)))


def require_numbers(mechanism: Mechanism, own: Mapping[str, np.ndarray]) -> None:
    """Refuse numbers by path, (N,) each, that no description may hold."""
    if not (able := possible(mechanism, own, len(next(iter(own.values()))))).all():
        member = int(np.argmin(able))
        with checks.at(f"member {member}: "):
            edited(mechanism, {name: float(values[member]) for name, values in own.items()})


def require_closed(robot: Model, q: np.ndarray, p: np.ndarray, numbers: np.ndarray) -> None:
    """Refuse members, of some numbers (N,), whose loops are open; q: (N, nq); p: (N, np)."""
    gap = robot.kernel("closure_step")(q, np.ascontiguousarray(p[:, : robot.p.size]))[1][..., 0]
    if not (gap <= OPEN_LOOPS).all():
        first = int(np.argmin(gap <= OPEN_LOOPS))
        raise LinkworkError(
            f"member {numbers[first]}: the state belongs to another robot: its loops are open by "
            f"{gap[first]:.3g} here; make one by the robot with these parameters"
        )


def possible(mechanism: Mechanism, own: Mapping[str, np.ndarray], size: int) -> np.ndarray:
    """Return which members of a number (N,) have numbers (N,) by path that a description may hold.

    An element's numbers are possible or not whatever others have. What an element may hold is
    convex, but where formulas bend it, or zero is no number for it: the corners of the box about
    all members, and its zeros, stand for them, where they are fewer.
    """
    able = np.ones(size, bool)
    for names in of_elements(mechanism, own) if size else ():
        table = np.stack([own[name] for name in names], axis=1)
        columns = table.T.tolist()
        ends = [sorted({min(each), max(each), *({0.0} & {*each})}) for each in columns]
        corners = (dict(zip(names, corner, strict=True)) for corner in product(*ends))
        few = prod(map(len, ends)) < size and straight(mechanism, names)
        if few and all(allowed(mechanism, corner) for corner in corners):
            continue
        rows, places = np.unique(table, axis=0, return_inverse=True)
        each = [allowed(mechanism, dict(zip(names, row, strict=True))) for row in rows.tolist()]
        able &= np.array(each)[places.reshape(-1)]
    return able


def of_elements(mechanism: Mechanism, paths: Iterable[str]) -> list[tuple[str, ...]]:
    """Return paths of numbers in groups that have no body, joint or other element in common."""
    groups: list[tuple[set[tuple[str, ...]], tuple[str, ...]]] = []
    for path in paths:
        elements, names = {where[:2] for where in places_of(mechanism, path)}, (path,)
        for group in [group for group in groups if group[0] & elements]:
            groups.remove(group)
            elements, names = elements | group[0], group[1] + names
        groups.append((elements, names))
    return [names for _, names in groups]


def straight(mechanism: Mechanism, paths: Iterable[str]) -> bool:
    """Tell whether all that follows from some numbers, by path, is a sum of multiples of them."""
    named = any(located(mechanism, path)[0][0] == "let" for path in paths)
    texts = mechanism.formulas.values() if named else ()
    return all(map(formulas.is_linear, texts))


def allowed(mechanism: Mechanism, values: Mapping[str, float]) -> bool:
    """Tell whether a description may hold some numbers by path."""
    try:
        edited(mechanism, {name: float(value) for name, value in values.items()})
    except MechanismError:
        return False
    return True


def forces_of_each(robot: Model, forces: Any) -> tuple[np.ndarray | list[Signal] | None, Any]:
    """Return the forces of each member, numbers (N, nu) or N signals, or None; and those that all
    share."""
    if isinstance(forces, Mapping) and any(np.ndim(values) for values in forces.values()):
        forces = checks.actuator_forces(forces, robot.actuators)
    if isinstance(forces, Mapping | Sampled | Signal) or callable(forces) or forces is None:
        return None, forces
    if isinstance(forces, Sequence) and any(
        isinstance(given, Sampled | Signal) for given in forces
    ):
        return [plain(robot, given).inputs for given in forces], None
    try:
        table = np.asarray(forces, float)
    except (TypeError, ValueError, OverflowError):
        return None, forces
    if table.ndim < 2:
        return None, forces
    if table.ndim > 2 or table.shape[1] != len(robot.actuators):
        checks.refuse_shape(table, "forces", robot.actuators)
    checks.in_order(forces, robot.actuators, "forces")
    return table, None
