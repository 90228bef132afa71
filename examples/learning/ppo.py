"""Reach by trial and error: proximal policy optimisation, plain, in JAX, on the 3-PRR.

    python examples/learning/ppo.py [environment steps]

256 robots act under a Gaussian policy; advantages are estimated from what they were rewarded with,
and policy and value are improved by clipped ratios (Schulman et al., arXiv 1707.06347; advantages:
1506.02438). It writes learning_ppo.csv: environment steps so far, and what the policy, without its
noise, is worth then. 1.5 million steps take a minute or two on two cores, most of it in the
networks.
"""

import sys
from functools import partial
from time import perf_counter

import gymnasium
import jax
import jax.numpy as jnp
import numpy as np
from scoring import SCALE, score

TOTAL = int(sys.argv[1]) if len(sys.argv) > 1 else 1_500_000
ROBOTS, LENGTH, EPOCHS, PARTS = 256, 32, 4, 4
GAMMA, LAMBDA, CLIP, RATE, WIDTH = 0.97, 0.95, 0.2, 1e-3, 64


def layers(key, sizes):
    """Return weights and biases of a network, the last layer small."""
    keys = jax.random.split(key, len(sizes) - 1)
    gains = [1.0] * (len(sizes) - 2) + [0.01]
    return [
        (g * jax.random.normal(k, (m, n)) / np.sqrt(m), jnp.zeros(n))
        for k, g, m, n in zip(keys, gains, sizes, sizes[1:], strict=False)
    ]


def network(weights, x):
    for W, b in weights[:-1]:
        x = jnp.tanh(x @ W + b)
    return x @ weights[-1][0] + weights[-1][1]


evaluate = jax.jit(network)


def log_density(parameters, x, action):
    """Return the logarithm of the policy's density of an action, but for a constant."""
    spread = parameters["log_spread"]
    away = (action - network(parameters["policy"], x)) / jnp.exp(spread)
    return -0.5 * (away**2).sum(-1) - spread.sum()


@jax.jit
def act(parameters, x, key):
    """Return actions that are drawn, and the values of what is seen."""
    mean = network(parameters["policy"], x)
    noise = jax.random.normal(key, mean.shape)
    return mean + jnp.exp(parameters["log_spread"]) * noise, network(parameters["value"], x)[:, 0]


def acted(parameters, seen):
    """Return the actions for what robots see, without noise."""
    return np.asarray(evaluate(parameters["policy"], SCALE * seen))


def loss(parameters, x, action, density, advantage, target):
    ratio = jnp.exp(log_density(parameters, x, action) - density)
    clipped = jnp.clip(ratio, 1 - CLIP, 1 + CLIP)
    gained = jnp.minimum(ratio * advantage, clipped * advantage).mean()
    value = network(parameters["value"], x)[:, 0]
    return -gained + 0.5 * ((value - target) ** 2).mean()


@jax.jit
def improve(parameters, moments, count, key, x, action, advantage, target):
    """Return parameters after Adam's steps over all parts of the data, some epochs."""
    density = log_density(parameters, x, action)

    def step(carry, rows):
        parameters, (m, v), count = carry
        a = advantage[rows]
        a = (a - a.mean()) / (a.std() + 1e-8)
        g = jax.grad(loss)(parameters, x[rows], action[rows], density[rows], a, target[rows])
        m = jax.tree.map(lambda m, g: 0.9 * m + 0.1 * g, m, g)
        v = jax.tree.map(lambda v, g: 0.999 * v + 0.001 * g**2, v, g)
        count = count + 1
        size = RATE * jnp.sqrt(1 - 0.999**count) / (1 - 0.9**count)
        parameters = jax.tree.map(
            lambda p, m, v: p - size * m / (jnp.sqrt(v) + 1e-8), parameters, m, v
        )
        return (parameters, (m, v), count), None

    orders = [jax.random.permutation(k, len(x)) for k in jax.random.split(key, EPOCHS)]
    rows = jnp.concatenate(orders).reshape(EPOCHS * PARTS, -1)
    return jax.lax.scan(step, (parameters, moments, count), rows)[0]


def advantages(rewards, over, values, last):
    """Return generalised advantages (LENGTH, ROBOTS), backwards from the values at the end."""
    found, ahead, carried = np.zeros_like(rewards), last, 0.0
    for k in reversed(range(LENGTH)):
        going = 1.0 - over[k]
        carried = rewards[k] + GAMMA * ahead * going - values[k] + GAMMA * LAMBDA * going * carried
        found[k], ahead = carried, values[k]
    return found


def main():
    envs = gymnasium.make_vec(
        "Linkwork/Reach-v0",
        num_envs=ROBOTS,
        autoreset_mode=gymnasium.vector.AutoresetMode.SAME_STEP,
    )
    sees, acts = envs.single_observation_space.shape[0], envs.single_action_space.shape[0]
    key, first, second = jax.random.split(jax.random.key(0), 3)
    parameters = {
        "policy": layers(first, (sees, WIDTH, WIDTH, acts)),
        "value": layers(second, (sees, WIDTH, WIDTH, 1)),
        "log_spread": jnp.full(acts, -0.7),
    }
    zeros = jax.tree.map(jnp.zeros_like, parameters)
    moments, count, curve = (zeros, zeros), 0, []
    seen, _ = envs.reset(seed=0)
    begun = perf_counter()
    for turn in range(1, TOTAL // (ROBOTS * LENGTH) + 1):
        # All robots act for a while.
        x = np.zeros((LENGTH, ROBOTS, sees), np.float32)
        action = np.zeros((LENGTH, ROBOTS, acts), np.float32)
        rewards, over, values = np.zeros((3, LENGTH, ROBOTS), np.float32)
        for k in range(LENGTH):
            key, own = jax.random.split(key)
            x[k] = SCALE * seen
            action[k], values[k] = map(np.asarray, act(parameters, x[k], own))
            seen, rewards[k], terminated, truncated, infos = envs.step(action[k])
            over[k] = terminated | truncated
            # An episode that was cut off would have gone on: its end is worth its value.
            cut = np.flatnonzero(truncated & ~terminated)
            if cut.size:
                ends = np.stack([infos["final_obs"][i] for i in cut])
                worth = network(parameters["value"], SCALE * ends)[:, 0]
                rewards[k, cut] += GAMMA * np.asarray(worth)
        # What was better than expected is made more likely.
        last = np.asarray(act(parameters, SCALE * seen, own)[1])
        advantage = advantages(rewards, over, values, last)
        data = (
            part.reshape(-1, *part.shape[2:]) for part in (x, action, advantage, advantage + values)
        )
        key, own = jax.random.split(key)
        parameters, moments, count = improve(parameters, moments, count, own, *data)
        if turn % 4 == 0:
            gained = score(partial(acted, parameters))
            curve.append((turn * ROBOTS * LENGTH, gained))
            print(
                f"{curve[-1][0]:9,d} steps   return {gained:6.2f}   {perf_counter() - begun:.1f} s"
            )
    np.savetxt("learning_ppo.csv", curve, "%.6g", ",", header="steps,return", comments="")


if __name__ == "__main__":
    main()
