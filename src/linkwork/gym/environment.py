"""A single environment, as Gymnasium's `Env`."""

from __future__ import annotations

from typing import Any, ClassVar

import numpy as np
from gymnasium import Env
from gymnasium.vector import AutoresetMode
from numpy.typing import ArrayLike

from linkwork import checks
from linkwork.errors import LinkworkError
from linkwork.gym.environments import Environments, frames_a_second
from linkwork.gym.process import DecisionProcess
from linkwork.model.state import State


class Environment(Env):
    """Run an episode of a decision process at a time; one of `Environments`, to the last bit.

    Args:
        process: what is observed, done and rewarded.
        max_episode_steps: steps after which an episode is truncated; the process's horizon if left
            out.
        render_mode: "rgb_array", for pictures by `render`; None for none.
    """

    metadata: ClassVar[dict[str, Any]] = {  # pyright: ignore[reportIncompatibleVariableOverride]
        "render_modes": ["rgb_array"]
    }

    def __init__(
        self,
        process: DecisionProcess,
        *,
        max_episode_steps: int | None = None,
        render_mode: str | None = None,
    ):
        self._one = Environments(
            process,
            max_episode_steps=max_episode_steps,
            autoreset_mode=AutoresetMode.DISABLED,
            threads=1,
            render_mode=render_mode,
        )
        self.process, self.render_mode = process, render_mode
        own = {"render_fps": frames_a_second(process)}
        self.metadata = type(self).metadata | own  # pyright: ignore
        self.action_space = self._one.single_action_space
        self.observation_space = self._one.single_observation_space

    @property
    def state(self) -> State:
        """The robot's state."""
        return self._one.states.at(0)

    def reset(
        self, *, seed: int | None = None, options: dict | None = None
    ) -> tuple[np.ndarray, dict[str, Any]]:
        """Begin an episode; return the observation and an empty info. Of the options there is
        "draws", as `Environments.reset` has it."""
        if seed is not None and not checks.whole(seed):
            raise LinkworkError(
                f"a seed is {checks.shown(seed)}; give a whole number that is not negative"
            )
        observations, _ = self._one.reset(seed=seed, options=options)
        super().reset(seed=None if seed is None else int(seed))
        return observations[0], {}

    def render(self) -> np.ndarray:  # pyright: ignore
        """Return a picture of the robot, (height, width, 3) numbers from 0 to 255.

        Raises:
            LinkworkError: an environment that was made without render_mode="rgb_array".
        """
        return self._one.picture(0)

    def step(self, action: ArrayLike) -> tuple[np.ndarray, float, bool, bool, dict[str, Any]]:
        """Take an action; return observation, reward, terminated, truncated and info, whose
        "reason" says why the robot could not be stepped on, if so."""
        given, size = checks.reals(action), self.process.size
        if given is None or given.shape != (size,):
            what = checks.shown(action) if given is None else f"of shape {given.shape}"
            raise LinkworkError(f"the action is {what}; give {checks.amount(size, 'number')}")
        observations, rewards, terminations, truncations, infos = self._one.step(given[None])
        info = {"reason": infos["reason"][0]} if infos else {}
        return (
            observations[0],
            float(rewards[0]),
            bool(terminations[0]),
            bool(truncations[0]),
            info,
        )
