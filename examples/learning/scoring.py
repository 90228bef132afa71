"""What a policy is worth: the mean return of fresh episodes, in which nothing is learned."""

from collections.abc import Callable

import gymnasium
import numpy as np

import linkwork.gym  # noqa: F401, it registers the environments

SCALE = np.array([20, 20, 5, 4, 4, 1, 10, 10, 5, 10, 10, 10])
"""What is seen in Linkwork/Reach-v0, to about one."""


def score(act: Callable[[np.ndarray], np.ndarray], episodes: int = 200) -> float:
    """Return the mean return under actions act(observations), from fixed seeds."""
    envs = gymnasium.make_vec("Linkwork/Reach-v0", num_envs=episodes)
    seen, _ = envs.reset(seed=1_000_000)
    returns, going = np.zeros(episodes), np.ones(episodes, bool)
    while going.any():
        seen, rewards, terminated, truncated, _ = envs.step(act(seen))
        returns += going * rewards
        going &= ~(terminated | truncated)
    return float(returns.mean())
