"""Decision processes: what is asked of a robot in an episode, as functions that are traced into
compiled code.

    s_(k+1) = f(s_k, a_k),    o_k = observation(t, s_k),    r_k = reward(t, s_(k+1), a_k)

f is the motion over dt under forces that the action a stands for; the episode is over where
`terminated` says so, and cut off after `horizon` steps.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from linkwork import checks, math
from linkwork.control.acting import require_drives
from linkwork.control.drives import Drive, Extra
from linkwork.control.observation import Names, Observation
from linkwork.control.tracing import Law, Tracer, column
from linkwork.control.tracing import shown as told
from linkwork.control.wrenches import Wrench
from linkwork.errors import LinkworkError
from linkwork.model.state import State
from linkwork.robot import Robot

Decided = Callable[[Any, Observation, np.ndarray], Any]
REWARD, TERMINATION, OBSERVATION = "the reward", "the termination", "the observation"
ENDLESS = 2**62  # steps of an episode, at most: those of one that is never cut off


@dataclass(frozen=True, eq=False)
class DecisionProcess:
    """State what is observed, done and rewarded when a robot learns: a Markov decision process.

    All functions take the time since the episode began t [s] and the state as controllers see it
    (`linkwork.control.Observation`); they are traced with symbols once and compiled, and are
    written as controllers are, with `linkwork.math` and without branches on values.

    Attributes:
        robot: the robot, which may have free parameters.
        dt: time from decision to decision [s].
        low, high: bounds of the action (actions), in its own units; actions beyond are cut to them.
        observation: (t, state) -> numbers o.
        reward: (t, state, action) -> a number, for the state that the action led to.
        terminated: (t, state) -> whether the episode is over there (a number that is not zero);
            never if left out.
        forces: (t, state, action) -> forces u of the actuators, or commands of their drives; the
            action itself if left out.
        states, rates: further states z of the world (`linkwork.control.Extra`: name, unit,
            initial value), read by state.extra(name); (t, state, action) -> their rates z'.
        draws: numbers that are drawn anew, uniformly, for each episode: bounds by name. The name is
            that of a parameter which functions read by state.parameter(name, default), of a
            further state, whose initial value it is, or of a free parameter of the robot that
            leaves its loops closed, such as a mass.
        starts: states of which episodes begin in one that is drawn; home if left out.
        horizon: steps after which an episode is cut off (truncated).
        substeps: steps of the method (Runge-Kutta, order 4) in dt.
        drives, wrenches: as for `Robot.simulate`.

    Source: Sutton & Barto, Reinforcement Learning, 2nd ed. 2018, ch. 3.
    """

    robot: Robot
    dt: float
    low: ArrayLike
    high: ArrayLike
    observation: Law
    reward: Decided
    terminated: Law | None = None
    forces: Decided | None = None
    states: Sequence[Extra] = ()
    rates: Decided | None = None
    draws: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    starts: State | None = None
    horizon: int = 200
    substeps: int = 1
    drives: Mapping[str, Drive] = field(default_factory=dict)
    wrenches: Sequence[Wrench] = ()

    def __post_init__(self) -> None:
        # The robot, and the bounds of the action.
        if not isinstance(self.robot, Robot):
            raise LinkworkError(
                f"the robot of a process is {checks.shown(self.robot)}; give a linkwork.Robot, "
                "such as Robot('prr3')"
            )
        low, high = (
            np.atleast_1d(checks.finite(getattr(self, name), name)) for name in ("low", "high")
        )
        if low.ndim != 1 or low.shape != high.shape or not low.size or not (low < high).all():
            raise LinkworkError(
                f"bounds of the action are {low.tolist()} and {high.tolist()}; give as many "
                "lower ones as upper ones, each below its upper one"
            )
        object.__setattr__(self, "low", low)
        object.__setattr__(self, "high", high)
        # Numbers and functions.
        checks.positive(self.dt, "dt", "s")
        for name, most in (("horizon", ENDLESS), ("substeps", None)):
            object.__setattr__(self, name, checks.count(getattr(self, name), name, most))
        for name in ("observation", "reward", "terminated", "forces", "rates"):
            given = getattr(self, name)
            if not (callable(given) or (given is None and name not in ("observation", "reward"))):
                raise LinkworkError(f"{name} is {checks.shown(given)}; give a function")
        if self.forces is None and low.size != len(self.robot.actuators):
            raise LinkworkError(
                f"an action has {checks.amount(low.size, 'number')}, and the robot "
                f"{checks.amount(len(self.robot.actuators), 'actuator')}; say by forces what an "
                "action does"
            )
        # Further states, drives, and what is drawn.
        object.__setattr__(self, "states", extras_of(self.states))
        if bool(self.states) != (self.rates is not None):
            raise LinkworkError("further states have rates, and rates are of states; give both")
        for name, example in (
            ("drives", "{'slide_1': linkwork.control.Saturated(limit=2.0)}"),
            ("draws", "{'goal': (-1.0, 1.0)}"),
        ):
            object.__setattr__(self, name, checks.by_name(getattr(self, name), name, example))
        require_drives(self.robot.names, self.drives)
        for name, bounds in self.draws.items():
            given = checks.finite(bounds, f"the bounds of {name!r}")
            if given.shape != (2,) or given[0] > given[1]:
                raise LinkworkError(
                    f"the bounds of {name!r} are {checks.shown(bounds)}; give the least and the "
                    "largest value"
                )

    def action(self, state: Observation) -> np.ndarray:
        """Return the action that is taken, as functions read it."""
        return math.array([state.parameter(name, 0.0) for name in self.action_names])

    @property
    def size(self) -> int:
        """How many numbers an action has."""
        return np.size(self.low)

    @property
    def action_names(self) -> list[str]:
        """Names of the parameters by which functions read the action."""
        return [f"action[{i}]" for i in range(self.size)]

    @property
    def extras(self) -> tuple[Extra, ...]:
        """Further states, as controllers have them."""
        return tuple(self.states)

    def __call__(self, t: Any, state: Observation) -> Any:
        """Return the forces, with the rates of further states if there are any: the law that the
        robot moves under."""
        action = self.action(state)
        forces = action if self.forces is None else self.forces(t, state, action)
        return (forces, self.rates(t, state, action)) if self.rates else forces

    @cached_property
    def observed(self) -> int:
        """How many numbers an observation has.

        Raises:
            LinkworkError: a function that cannot be traced, or gives what does not fit.
        """
        names: Names = replace(self.robot.names, extras=tuple(x.name for x in self.read_extras))
        tracer = Tracer(names)
        count = tracer.trace(self.observation, flat, OBSERVATION).numel()
        for function, what in ((self.rewarding, REWARD), (self.ending, TERMINATION)):
            tracer.trace(function, lambda value, what=what: column(value, ("value",), what), what)
        tracer.check((0.0, self.dt * self.horizon))
        return count

    @property
    def read_extras(self) -> tuple[Extra, ...]:
        """All states beside the robot's own that functions may read: of drives, and further
        ones."""
        own = [
            x._replace(name=f"{name}.{x.name}")
            for name, drive in self.drives.items()
            for x in drive.extras
        ]
        return (*own, *self.extras)

    @property
    def readings(self) -> tuple[Law, ...]:
        """What is read after each step: the numbers of the observation, the reward, the
        termination."""
        seen = [
            lambda t, state, i=i: flat(self.observation(t, state))[i] for i in range(self.observed)
        ]
        return (*seen, self.rewarding, self.ending)

    def rewarding(self, t: Any, state: Observation) -> Any:
        """Return the reward."""
        return self.reward(t, state, self.action(state))

    def ending(self, t: Any, state: Observation) -> Any:
        """Return what is not zero where the episode is over."""
        return 0.0 if self.terminated is None else self.terminated(t, state)


def flat(values: Any) -> Any:
    """Return numbers, or symbols, as a column; refuse what is no list of them."""
    try:
        array = math.array(values).ravel()
    except (TypeError, ValueError):
        array = np.empty(0)
    if not array.size or values is None:
        raise LinkworkError(f"{OBSERVATION} returns {told(values)}; give numbers, at least one")
    return column(array, [f"[{i}]" for i in range(array.size)], OBSERVATION)


def extras_of(states: Any) -> tuple[Extra, ...]:
    """Return further states; refuse what is none."""
    found = []
    for each in checks.several(states, object, "states"):
        match each:
            case [str() as name, str() as unit, initial]:
                found.append(Extra(name, unit, checks.number(initial, f"the start of {name!r}")))
            case _:
                raise LinkworkError(
                    f"a further state is {checks.shown(each)}; give its name, unit and value at "
                    "the start, such as ('ball.x', 'm', 0.0)"
                )
    return tuple(found)
