"""Environments: steps of many, through `step` as learning algorithms call it."""

from __future__ import annotations

import warnings
from collections.abc import Callable

import gymnasium
import numpy as np

import linkwork.gym  # noqa: F401, it registers the environments

from benchmarks.table import Figure, Listing, Section, quantity
from benchmarks.timing import Contender, interleaved, summary

READY = ("Linkwork/Reach-v0", "Linkwork/Balance-v0", "Linkwork/SwingUp-v0")
ROBOTS, STEPS, PROMISED = 4096, 100, 5.0  # [million steps a second]
METHOD = f"""
    `envs.step` of {ROBOTS:,} environments, one thread, {STEPS} steps in a row under random
    actions between the bounds, drawn before: motion, observation, reward, ends of episodes,
    and those that begin anew with the next step, as many as there are. An environment step of
    Linkwork/Reach-v0 is 20 ms of the 3-PRR by one step of the Runge-Kutta method of order 4, of
    Linkwork/Balance-v0 two of the Stewart platform with a ball, of Linkwork/SwingUp-v0 four of
    the five-bar. One: a single environment, `env.step`. CartPole-v1: Gymnasium's own vector
    environment of it in NumPy, two bodies and an explicit Euler step, for comparison.
    """


def run(rounds: int = 12, robots: int = ROBOTS, steps: int = STEPS) -> Section:
    """Time steps of all in turn."""
    contenders = {name: many(name, robots, steps) for name in READY}
    contenders["CartPole-v1 of Gymnasium"] = cart_poles(robots, steps)
    contenders["Linkwork/Reach-v0, one"] = one(READY[0], steps)
    seconds = interleaved(contenders, rounds)
    quickest = {name: float(values.min()) for name, values in seconds.items()}
    figure = Figure(
        "environment steps a second and core, the 3-PRR reaching",
        1e-6 / quickest[READY[0]],
        "million",
        PROMISED,
        "at least",
    )
    rows = [
        (name, quantity(1e9 * value, ""), quantity(1e-6 / value, ""))
        for name, value in quickest.items()
    ]
    raw = {name: summary(values) for name, values in seconds.items()}
    listing = Listing(("environment", "a step [ns]", "million steps a second"), rows)
    return Section("Learning", METHOD, [figure], {"seconds": raw}, listing=listing)


def many(name: str, count: int, steps: int) -> Contender:
    """Return steps of environments of ours."""
    envs = gymnasium.make_vec(name, num_envs=count, threads=1)
    envs.reset(seed=0)
    shape = steps, *envs.action_space.shape
    actions = np.random.default_rng(1).uniform(-1, 1, shape).astype(np.float32)
    return Contender(through(envs.step, actions), count * steps)


def one(name: str, steps: int) -> Contender:
    """Return steps of a single environment of ours, begun anew where it is over."""
    env = gymnasium.make(name, disable_env_checker=True).unwrapped
    env.reset(seed=0)
    shape = steps, *env.action_space.shape
    actions = np.random.default_rng(1).uniform(-1, 1, shape).astype(np.float32)

    def step(action: np.ndarray) -> None:
        *_, terminated, truncated, _ = env.step(action)
        if terminated or truncated:
            env.reset()

    return Contender(through(step, actions), steps)


def cart_poles(count: int, steps: int) -> Contender:
    """Return steps of Gymnasium's own environments."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        envs = gymnasium.make_vec("CartPole-v1", num_envs=count)
    envs.reset(seed=0)
    actions = np.random.default_rng(1).integers(0, 2, (steps, count))
    return Contender(through(envs.step, actions), count * steps)


def through(step: Callable[[np.ndarray], object], actions: np.ndarray) -> Callable[[], None]:
    """Return a call that steps through actions."""

    def call() -> None:
        for action in actions:
            step(action)

    return call
