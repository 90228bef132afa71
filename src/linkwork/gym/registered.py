"""Registered environments: decision processes under names that `gymnasium.make` and `make_vec`
know."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from importlib import import_module
from typing import Any

import gymnasium

from linkwork import checks
from linkwork.errors import LinkworkError
from linkwork.gym.environment import Environment
from linkwork.gym.environments import Environments
from linkwork.gym.process import ENDLESS, DecisionProcess

READY = {
    "Linkwork/Reach-v0": ("reaching", 100),
    "Linkwork/Balance-v0": ("balancing", 250),
    "Linkwork/SwingUp-v0": ("swinging_up", 250),
}
"""Ready processes: their names in `linkwork.gym.catalogue`, and their horizons."""


def register(id: str, process: Callable[[], DecisionProcess], horizon: int) -> None:
    """Register a decision process for `gymnasium.make` and `gymnasium.make_vec`.

    Args:
        id: the name, such as "Mine/Reach-v0".
        process: returns the process when an environment is made.
        horizon: steps after which an episode is truncated.

    Raises:
        LinkworkError: a process that is no function, a horizon that is no number of steps.
    """
    if not isinstance(id, str) or not id:
        raise LinkworkError(f"the id is {checks.shown(id)}; give a name, such as 'mine/Robot-v0'")
    if not callable(process):
        raise LinkworkError(
            f"the process of {id!r} is {checks.shown(process)}; give a function that returns one"
        )
    horizon = checks.count(horizon, "horizon", ENDLESS)
    gymnasium.register(
        id,
        entry_point=partial(single, process),
        vector_entry_point=partial(several, process),
        max_episode_steps=horizon,
    )


def single(process: Callable[[], DecisionProcess], **options: Any) -> Environment:
    """Return one environment, without a limit of its own: `gymnasium.wrappers.TimeLimit` cuts its
    episodes off."""
    return Environment(process(), **{"max_episode_steps": ENDLESS, **options})


def several(process: Callable[[], DecisionProcess], num_envs: int, **options: Any) -> Environments:
    """Return environments side by side."""
    return Environments(process(), num_envs, **options)


def ready(name: str) -> DecisionProcess:
    """Return a process of the catalogue, made when it is first asked for."""
    return getattr(import_module("linkwork.gym.catalogue"), name)()


for own, (name, horizon) in READY.items():
    register(own, partial(ready, name), horizon)
