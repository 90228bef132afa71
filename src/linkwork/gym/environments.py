"""Environments: many episodes of a decision process at a time, as Gymnasium's `VectorEnv`."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any, ClassVar, NoReturn

import numpy as np
from gymnasium.spaces import Box
from gymnasium.utils import seeding
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space
from numpy.typing import ArrayLike

from linkwork import checks
from linkwork.errors import LinkworkError
from linkwork.gym.draws import Draws
from linkwork.gym.native_episodes import Drawing, act, begin, conclude
from linkwork.gym.process import ENDLESS, OBSERVATION, REWARD, TERMINATION, DecisionProcess
from linkwork.model.state import State
from linkwork.runs.members import allowed
from linkwork.simulation import Status
from linkwork.simulation.compiled import entry_of
from linkwork.stepping.long_steps import tell_long_step
from linkwork.stepping.native_readings import ReadingTables
from linkwork.stepping.steppers import Steppers

REASONS = {
    Status.SINGULAR: "the pose is singular: no independent rates determine the motion from here",
    Status.CLOSURE_LOST: "the loops do not close any more",
    Status.NON_FINITE: "forces or accelerations are infinite or undefined from here",
    Status.EVENT: "a cable would leap to another side of a surface, with energy",
}
"""Why an episode was cut off where its robot could not be stepped on."""
ACT, BEGIN, CONCLUDE = entry_of(act), entry_of(begin), entry_of(conclude)


class Environments(VectorEnv):
    """Run N episodes of a decision process side by side, in the lanes of vector registers.

    An episode whose robot cannot be stepped on is truncated: the observation is that of the state
    before, and infos["reason"] says why.

    Args:
        process: what is observed, done and rewarded.
        num_envs: N.
        max_episode_steps: steps after which an episode is truncated; the process's horizon if left
            out.
        autoreset_mode: when episodes that are over begin anew: with the next step, whose action is
            not taken ("NextStep"); in the same step, whose infos["final_obs"] and
            infos["final_info"] tell the end ("SameStep"); by reset(options={"reset_mask": ...})
            alone ("Disabled").
        threads: over which the robots are dealt; all processors if left out.
        render_mode: "rgb_array", for pictures by `render`; None for none.

    Attributes:
        states: the robots' states, a stack of N; process: the decision process.
        observation_space, action_space: boxes (N, numbers); single_observation_space and
            single_action_space of one.

    Source: Gymnasium 1.4, `gymnasium.vector.VectorEnv`.
    """

    metadata: ClassVar[dict[str, Any]] = {  # pyright: ignore[reportIncompatibleVariableOverride]
        "render_modes": ["rgb_array"],
        "autoreset_mode": AutoresetMode.NEXT_STEP,
    }

    def __init__(
        self,
        process: DecisionProcess,
        num_envs: int = 1,
        *,
        max_episode_steps: int | None = None,
        autoreset_mode: AutoresetMode | str = AutoresetMode.NEXT_STEP,
        threads: int | None = None,
        render_mode: str | None = None,
    ):
        if not isinstance(process, DecisionProcess):
            raise LinkworkError(f"{checks.shown(process)} is no linkwork.gym.DecisionProcess")
        if not checks.among(render_mode, (None, "rgb_array")):
            raise LinkworkError(
                f"there is no render_mode {checks.shown(render_mode)}; there is 'rgb_array', whose "
                "pictures `render` returns"
            )
        self.process, self.num_envs = process, checks.count(num_envs, "num_envs", checks.MOST)
        horizon = process.horizon if max_episode_steps is None else max_episode_steps
        self._horizon = checks.count(horizon, "max_episode_steps", ENDLESS)
        self._mode = mode_of(autoreset_mode)
        own = {"autoreset_mode": self._mode, "render_fps": frames_a_second(process)}
        self.metadata = {**type(self).metadata, **own}  # pyright: ignore
        self.render_mode, self._cameras = render_mode, {}
        self._limits = np.column_stack((process.low, process.high))
        self.single_action_space = Box(*self._limits.T.astype(np.float32))
        self.single_observation_space = Box(-np.inf, np.inf, (process.observed,), np.float64)
        self.action_space = batch_space(self.single_action_space, self.num_envs)
        self.observation_space = batch_space(self.single_observation_space, self.num_envs)
        # The robots, and as many as there are starts, where episodes begin.
        starts = starts_of(process)
        self._starts = steppers_of(process, starts, 1)
        tell_long_step(self._starts.dt, self._starts.longest_step)
        begun = stacked(turned(process, starts), self.num_envs)
        self._robots = steppers_of(process, begun, threads)
        self._places = places(process, self._robots)
        self._drawn = np.array([*process.draws.values(), (0.0, 1.0)], float)  # bounds
        self._actions = self._robots.parameter_rows(process.action_names)
        # Episodes: random numbers, steps so far, and which are over.
        self._draws: Draws | None = None
        self._steps = np.zeros(self.num_envs, int)
        self._over = np.ones(self.num_envs, bool)
        self._used = np.zeros(self.num_envs, int)
        self._told = np.zeros((2, self.num_envs))  # rewards and terminations

    def __reduce__(self) -> NoReturn:
        raise LinkworkError(
            "environments cannot be copied or pickled: they hold compiled code and its memory; "
            "send a function that makes them"
        )

    @property
    def states(self) -> State:
        """The states of all robots, a stack of N."""
        return self._robots.states

    def extra(self, name: str) -> np.ndarray:
        """Return a further state of all environments (N,), by its name."""
        names = [each.name for each in self.process.read_extras]
        checks.known([name], names, "further state")
        return self._robots.z[:, names.index(name)].copy()

    def reset(
        self, *, seed: int | Sequence[int | None] | None = None, options: dict | None = None
    ) -> tuple[np.ndarray, dict[str, Any]]:
        """Begin episodes anew, and return the observations (N, numbers) and infos.

        Args:
            seed: of the random numbers: an integer s for s, s + 1, ... of the environments, or one
                for each; where it is left out they draw on.
            options: "reset_mask": which of them (N,), all if left out; "draws": values by name in
                place of drawn ones, one for all or for each of those that begin.

        Raises:
            LinkworkError: what does not fit; nothing is begun then.
        """
        given = checks.by_name(options, "options", "{'reset_mask': mask}")
        checks.known(given, ("reset_mask", "draws"), "option of reset")
        who = self._masked(given.get("reset_mask"))
        instead = self._instead(given.get("draws"), who.size)
        self._seed(seed, who)
        assert self._draws is not None
        self._draws.fill(who)
        for column, numbers in instead.items():
            self._draws.numbers[who, self._draws.next[who], column] = numbers
        self._begin(who)
        return self._observe(np.empty((self.num_envs, self.process.observed))), {}

    def step(
        self, actions: ArrayLike
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, dict[str, Any]]:
        """Take an action in each environment.

        Args:
            actions: (N, actions), cut to their bounds.

        Returns:
            observations (N, numbers), rewards, terminations, truncations (N,), and infos: "reason"
            of those whose robot could not be stepped on, "final_obs" and "final_info" as
            Gymnasium has them.

        Raises:
            LinkworkError: actions that do not fit or are not finite, before anything happens;
                functions of the process that are not finite at a state that was reached.
        """
        robots, begun = self._robots, np.flatnonzero(self._over)
        if begun.size and (self._draws is None or self._mode is AutoresetMode.DISABLED):
            raise LinkworkError(
                f"the episode of environment {begun[0]} has not begun, or is over; reset it before "
                "its next step"
            )
        self._act(actions)
        if begun.size:
            self._begin(begun)
        # What the robots come to; those that begin anew take no action.
        N = self.num_envs
        seen, rewards = np.empty((N, self.process.observed)), np.empty(N)
        terminations, truncations = np.empty(N, bool), np.empty(N, bool)
        told = ReadingTables(seen, self._told)
        if not robots.step_and_tell(told, self.process.substeps, idle=begun):
            self._require_finite(told)
        failed = CONCLUDE(
            self._told, begun, self._horizon, robots.herd, self._steps,
            rewards, terminations, truncations, self._over,
        )  # fmt: skip
        infos = self._reasons(robots.status != 0) if failed else {}
        if self._mode is AutoresetMode.SAME_STEP and self._over.any():
            infos = self._finish(seen, infos)
        return seen, rewards, terminations, truncations, infos

    def render(self) -> tuple[np.ndarray, ...]:  # pyright: ignore
        """Return a picture of each robot, (height, width, 3) numbers from 0 to 255.

        Raises:
            LinkworkError: environments that were made without render_mode="rgb_array", or that no
                episode has begun in.
        """
        return tuple(self.picture(i) for i in range(self.num_envs))

    def picture(self, number: int) -> np.ndarray:
        """Return the picture of one of the robots; what is seen grows with what it reaches.

        number: of the environment.
        """
        if self.render_mode is None:
            raise LinkworkError(
                "these environments were made without pictures; make them with "
                "render_mode='rgb_array'"
            )
        if self._draws is None:
            raise LinkworkError("no episode has begun; reset the environments before their picture")
        if not (checks.whole(number) and number < self.num_envs):
            raise LinkworkError(
                f"there is no environment {checks.shown(number)}; there are {self.num_envs}, from "
                "0 on"
            )
        # Matplotlib is asked for where pictures are.
        from linkwork.views.camera import Camera

        if number not in self._cameras:
            self._cameras[number] = Camera(self.process.robot)
        return self._cameras[number].picture(self.states.at(slice(number, number + 1)))

    def _act(self, actions: ArrayLike) -> None:
        """Take actions over, cut to their bounds; refuse those that do not fit."""
        given = checks.reals(actions)
        if given is None or given.shape != self.action_space.shape:
            what = checks.shown(actions) if given is None else f"of shape {given.shape}"
            raise LinkworkError(f"actions are {what}; give numbers {self.action_space.shape}")
        given = np.ascontiguousarray(given)
        if ACT(given, self._limits, self._robots.herd, self._actions):
            i = np.argwhere(~np.isfinite(given))[0, 0]
            raise LinkworkError(
                f"the action of environment {i} is {given[i].tolist()}; give finite numbers"
            )

    def _begin(self, who: np.ndarray) -> None:
        """Begin episodes of some environments, at starts and with numbers that are drawn."""
        assert self._draws is not None
        robots, starts, draws = self._robots, self._starts, self._draws
        states, parameters = self._places
        drawing = Drawing(draws.numbers, draws.next, states, parameters, len(starts))
        changed, used = BEGIN(
            robots.place, who, starts.place, robots.charts_of(starts), drawing,
            self._steps, self._over, self._used,
        )  # fmt: skip
        robots.note_put(starts, changed)
        if used:
            draws.fill(self._used[:used])

    def _instead(self, given: Any, count: int) -> dict[int, np.ndarray]:
        """Return numbers in place of drawn ones, by their columns; refuse what does not fit."""
        names, found = [*self.process.draws], {}
        given = checks.by_name(given, "draws", "{'goal': 0.1}")
        checks.known(given, names, "number that is drawn")
        for name, value in given.items():
            numbers = checks.finite(value, f"the draw of {name!r}")
            if numbers.shape not in ((), (count,)):
                raise LinkworkError(
                    f"draws of {name!r} are of shape {numbers.shape}; give one number, or "
                    f"{count}: one for each environment that begins"
                )
            if name in self.process.robot.parameters:
                for value in (numbers.min(), numbers.max()):
                    if not allowed(self.process.robot.mechanism, {name: value}):
                        raise LinkworkError(
                            f"the draw of {name!r} is {value:g}, which the robot's description may "
                            "not hold; give another number"
                        )
            found[names.index(name)] = numbers
        return found

    def _finish(self, seen: np.ndarray, infos: dict[str, Any]) -> dict[str, Any]:
        """Begin episodes anew where others are over, observe these, and return infos that tell how
        the others ended."""
        who = np.flatnonzero(self._over)
        final = np.full(self.num_envs, None, object)
        for i, row in zip(who.tolist(), seen[who], strict=True):
            final[i] = row
        infos = {"final_obs": final, "_final_obs": self._over.copy(), "final_info": infos}
        infos["_final_info"] = self._over.copy()
        self._begin(who)
        self._observe(seen, who)
        return infos

    def _observe(self, seen: np.ndarray, who: np.ndarray | None = None) -> np.ndarray:
        """Write the observations (N, numbers) of some, or of all, and return them."""
        told = ReadingTables(seen, self._told)
        if not self._robots.tell(told, who):
            self._require_finite(told)
        return seen

    def _require_finite(self, told: ReadingTables) -> None:
        """Refuse what is undefined."""
        for i, (*seen, reward, over) in enumerate(np.column_stack((told.rows, told.columns.T))):
            named = [*((OBSERVATION, x) for x in seen), (REWARD, reward), (TERMINATION, over)]
            for what, value in named:
                if not np.isfinite(value):
                    raise LinkworkError(
                        f"{what} of environment {i} is {value} at t = {self._robots.time[i]:g} s; "
                        "write it so that it is finite wherever the robot comes to, or end the "
                        "episode before"
                    )

    def _reasons(self, failed: np.ndarray) -> dict[str, Any]:
        """Return infos that tell why robots could not be stepped on."""
        told = np.full(self.num_envs, None, object)
        for i in np.flatnonzero(failed).tolist():
            status = Status(self._robots.status[i])
            told[i] = REASONS.get(status, status.name)
        return {"reason": told, "_reason": failed}

    def _masked(self, mask: Any) -> np.ndarray:
        """Return which environments are to begin; refuse a mask that does not fit."""
        if mask is None:
            return np.arange(self.num_envs)
        given = np.asarray(mask)
        if given.dtype != bool or given.shape != (self.num_envs,) or not given.any():
            raise LinkworkError(
                f"the reset_mask is {checks.shown(mask)}; give {self.num_envs} truth values, of "
                "which some are true"
            )
        if self._draws is None and not given.all():
            raise LinkworkError("no episode has begun yet; reset all environments first")
        return np.flatnonzero(given)

    def _seed(self, seed: Any, who: np.ndarray) -> None:
        """Give environments generators of random numbers: those that begin by their seeds."""
        seeds = seeds_of(seed, self.num_envs)
        if isinstance(seed, int | np.integer):
            super().reset(seed=int(seed))
        if self._draws is None:
            fresh = np.random.SeedSequence(self.np_random.integers(2**63)).spawn(self.num_envs)
            generators = [np.random.default_rng(each) for each in fresh]
            self._draws = Draws(generators, self._drawn)
        for i in who.tolist() if seeds else ():
            if seeds[i] is not None:
                self._draws.renew(i, seeding.np_random(seeds[i])[0])


def seeds_of(seed: Any, count: int) -> list[int | None]:
    """Return a seed for each environment, or none at all; refuse what is no whole number."""
    if seed is None:
        return []
    if checks.whole(seed):
        seeds: list[Any] = [seed + i for i in range(count)]
    else:
        seeds = [*seed] if isinstance(seed, Sequence | np.ndarray) else [seed]
    for each in seeds:
        if each is not None and not checks.whole(each):
            raise LinkworkError(
                f"a seed is {checks.shown(each)}; give a whole number that is not negative, or "
                "one for each environment"
            )
    if len(seeds) != count:
        raise LinkworkError(f"there are {len(seeds)} seeds; give an integer, or {count} of them")
    return [None if each is None else int(each) for each in seeds]


def frames_a_second(process: DecisionProcess) -> int:
    """Return how many decisions there are in a second, at least 1: of a film in real time."""
    return max(round(1 / process.dt), 1)


def mode_of(mode: AutoresetMode | str) -> AutoresetMode:
    """Return an autoreset mode by its name; refuse what is none."""
    try:
        return AutoresetMode(mode)
    except ValueError:
        names = ", ".join(repr(each.value) for each in AutoresetMode)
        raise LinkworkError(f"there is no autoreset_mode {mode!r}; there are {names}") from None


def stacked(state: State, count: int) -> State:
    """Return a stack of so many times the same state."""
    positions, rates, q = (
        np.broadcast_to(values, (count, values.size)).copy()
        for values in (state.positions, state.rates, state.q)
    )
    return State.known(positions, rates, q, state.coordinates, state.independent)


def starts_of(process: DecisionProcess) -> State:
    """Return the states that episodes begin in, a stack."""
    given = process.robot.home if process.starts is None else process.starts
    given = process.robot.own(given)
    return given if given.batch else stacked(given, 1)


def turned(process: DecisionProcess, starts: State) -> State:
    """Return the first start, with whole turns in all coordinates of which any start has some:
    robots that begin there have the states that tell turns which those of the starts have."""
    robot, first = process.robot, starts.at(0)
    (read,) = robot.kernel("positions")(first.q)
    windings = np.abs(robot.windings(starts)).max(axis=0)
    return replace(first, positions=robot.labels.turned(read, windings))


def steppers_of(process: DecisionProcess, states: State, threads: int | None) -> Steppers:
    """Return steppers of a process's robot at states, with a number for each of what is drawn."""
    own = {
        name: np.full(len(states), value)
        for name, value in process.robot.parameters.items()
        if name in process.draws
    }
    return Steppers(
        process.robot,
        states,
        process.dt / process.substeps,
        process,
        drives=process.drives,
        wrenches=process.wrenches,
        parameters=own,
        readings=process.readings,
        threads=threads,
    )


def places(process: DecisionProcess, robots: Steppers) -> np.ndarray:
    """Return where numbers that are drawn are written to, (2, numbers): rows of states, -1 for
    none, and of parameters; refuse what nobody reads.

    Numbers of the robot may be those that its description may hold at all corners of their bounds.
    """
    states, found = [each.name for each in process.read_extras], []
    first = robots.y.shape[1] - robots.z.shape[1]
    for name in process.draws:
        parameter = name in robots.parameters and name not in process.action_names
        if name in states:
            found.append((first + states.index(name), -1))
            continue
        if not parameter:
            raise LinkworkError(
                f"draws name {name!r}, which is no further state, no free parameter of the robot, "
                "and no parameter that a function reads by state.parameter(name, default)"
            )
        if not robots.parameters[name].flags.writeable:
            raise LinkworkError(
                f"{name!r} may not be drawn: the loops close otherwise by it; draw masses and what "
                "else leaves them closed"
            )
        found.append((-1, *robots.parameter_rows([name])))
    own = {name: process.draws[name] for name in process.draws if name in process.robot.parameters}
    for end in (0, 1):
        if not allowed(process.robot.mechanism, {n: bounds[end] for n, bounds in own.items()}):
            raise LinkworkError(
                f"bounds of {', '.join(own)} hold numbers that the robot's description may not"
            )
    return np.array(found, np.intp).reshape(-1, 2).T.copy()
