"""Members: what the runs of an ensemble go out from. All that was given, put together, a row for each member."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from linkwork.errors import LinkworkError
from linkwork.robot import checks
from linkwork.robot.state import State
from linkwork.robot.system import System, as_input, system
from linkwork.simulation import Sampled, Signal, as_signal

if TYPE_CHECKING:
    from linkwork.robot.robot import Robot


@dataclass(frozen=True, eq=False)
class Members:
    """Hold what the members of an ensemble go out from.

    system: what is integrated; forces: the signals, or numbers (N, nu), of each member, None where all share the system's
    q (N, nq), v (N, n) in the chart that runs start in; p: the system's parameters, (1, np) or (N, np)
    varied: values of parameters that vary, by name (N,); own: which of them are the robot's
    """

    robot: Robot
    system: System
    forces: np.ndarray | Sequence[Signal] | None
    q: np.ndarray
    v: np.ndarray
    p: np.ndarray
    varied: Mapping[str, np.ndarray]

    def __len__(self) -> int:
        return len(self.q)

    def start(self, members: np.ndarray) -> np.ndarray:
        """Return the states y = (q, v, z) of some members (M, n)."""
        z = np.broadcast_to(self.system.start, (len(members), len(self.system.extras)))
        return np.concatenate([self.q[members], self.v[members], z], axis=1)

    def p_robot(self, members: np.ndarray | slice = slice(None)) -> np.ndarray:
        """Return the robot's parameters (1, np) or of some members (M, np)."""
        return np.ascontiguousarray((self.p[members] if len(self.p) > 1 else self.p)[:, : self.robot.p.size])

    def inputs(self, members: np.ndarray) -> Signal | np.ndarray | list[Signal]:
        """Return the inputs of some members."""
        if self.forces is None:
            return self.system.inputs
        return self.forces[members] if isinstance(self.forces, np.ndarray) else [self.forces[i] for i in members]

    def alone(self, member: int) -> tuple[Robot, System]:
        """Return the robot and the system of one member."""
        values = {name: float(given[member]) for name, given in self.varied.items() if name in self.robot.parameters}
        robot = self.robot.with_parameters(values) if values else self.robot
        p = self.p[member if len(self.p) > 1 else 0]
        inputs = self.inputs(np.array([member]))
        signal = inputs if isinstance(inputs, Signal) else as_signal(inputs[0])
        return robot, replace(self.system, inputs=signal, parameters=p[robot.p.size :], faults=[])


def members(
    robot: Robot,
    states: State,
    forces: Any,
    parameters: Mapping[str, ArrayLike],
    drives: Mapping[str, Any] | None,
    wrenches: Sequence[Any],
    duration: float,
) -> Members:
    """Put together what the members go out from; refuse what does not fit."""
    state = robot.own(states)
    if len(state.batch) > 1:
        raise LinkworkError(
            f"the states are a stack of the shape {state.batch}; give a list of N states, or one for all"
        )
    each, shared = forces_of_each(robot, forces)
    if each is not None and (drives or wrenches):
        raise LinkworkError("with drives or wrenches all members share their forces; give one set, or vary parameters")
    runs = system(robot, shared, drives, wrenches, (), {}, (0.0, duration))
    if runs.sampler is not None:
        raise LinkworkError(
            "members of an ensemble cannot be led by a Sampler; give the controller itself, or simulate each"
        )
    names = (*robot.parameters, *(runs.acting.parameters if runs.acting else ()))
    checks.known(parameters, names, "parameter")
    varied = {name: checks.finite(values, f"parameter {name!r}") for name, values in parameters.items()}
    for name, values in varied.items():
        if values.ndim > 1:
            raise LinkworkError(f"parameter {name!r} has the shape {values.shape}; give one number for each member")
    lengths = {f"parameter {name!r}": values.size for name, values in varied.items() if values.ndim}
    lengths |= {"states": state.batch[0]} if state.batch else {}
    lengths |= {"forces": len(each)} if each is not None else {}
    if len(set(lengths.values())) > 1:
        raise LinkworkError(
            f"members do not fit together: {', '.join(f'{count} of {what}' for what, count in lengths.items())};"
            " give one for all, or equally many"
        )
    count = next(iter(lengths.values()), 1)
    p = runs.p(robot.chart)[None, :]
    if varied:
        p = np.repeat(p, count, axis=0)
        for name, values in varied.items():
            p[:, names.index(name)] = values
    q, home, chart = np.broadcast_to(state.q, (count, state.q.shape[-1])), robot.chart_of(state), robot.run_chart
    v = np.broadcast_to(state.rates, (count, state.rates.shape[-1]))
    if chart is not home:
        v = chart.from_tree(home.kernel("tree_rates")(q, v, p[:, : robot.p.size])[0])
    varied = {name: np.broadcast_to(values, count) for name, values in varied.items()}
    return Members(robot, runs, each, q, v, p, varied)


def forces_of_each(robot: Robot, forces: Any) -> tuple[np.ndarray | list[Signal] | None, Any]:
    """Return the forces of each member, numbers (N, nu) or N signals, or None; and those that all share."""
    if isinstance(forces, Mapping) and any(np.ndim(values) for values in forces.values()):
        forces = checks.actuator_forces(forces, robot.actuators)
    if isinstance(forces, Mapping | Sampled | Signal) or callable(forces) or forces is None:
        return None, forces
    if isinstance(forces, Sequence) and any(isinstance(given, Sampled | Signal) for given in forces):
        return [as_input(robot, given) for given in forces], None
    try:
        table = np.asarray(forces, float)
    except (TypeError, ValueError):
        return None, forces
    if table.ndim < 2:
        return None, forces
    if table.ndim > 2 or table.shape[1] != len(robot.actuators):
        checks.refuse_shape(table, "forces", robot.actuators)
    return table, None
