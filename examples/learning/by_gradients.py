"""Reach by gradients: the motion is differentiated, and a hundredth of the steps is enough.

    python examples/learning/by_gradients.py [environment steps]

The task of ppo.py. `linkwork.gym.smooth` gives it as functions of CasADi, so that the derivative of
what a quarter of a second brings is exact, through the closed loops: nothing is tried out at
random. Four robots go on from window to window under tanh of a linear policy, 39 numbers in all,
which Adam improves (Kingma & Ba, arXiv 1412.6980; windows: Xu et al., arXiv 2204.07137). It writes
learning_by_gradients.csv as ppo.py does.
"""

import sys
from functools import partial
from time import perf_counter

import casadi as ca
import numpy as np
from scoring import SCALE, score

from linkwork.gym import smooth
from linkwork.gym.catalogue import reaching

TOTAL = int(sys.argv[1]) if len(sys.argv) > 1 else 5_000
ROBOTS, WINDOW, RATE, LONGEST = 4, 12, 0.25, 50.0  # LONGEST: of a gradient
process = reaching()
whole = smooth(process)
SEES, ACTS = process.observed, process.size
low, high = np.array([*process.draws.values()]).T


def policy(weights, seen):
    """Return the action, in symbols."""
    W = ca.reshape(weights[: SEES * ACTS], ACTS, SEES)
    return ca.tanh(W @ (SCALE * seen) + weights[SEES * ACTS :])


def acted(weights, seen):
    """Return the actions for what many robots see (N, numbers)."""
    W = weights[: SEES * ACTS].reshape(SEES, ACTS)
    return np.tanh(SCALE * seen @ W + weights[SEES * ACTS :])


def window() -> ca.Function:
    """Return (weights, goal, y) -> return of a window, its gradient, the states and ends on it."""
    weights = ca.MX.sym("weights", SEES * ACTS + ACTS)
    goal, y = ca.MX.sym("goal", len(whole.draws)), ca.MX.sym("y", whole.starts.shape[1])
    seen, *_ = whole.read(0, y, np.zeros(ACTS), goal)
    action = policy(weights, seen)
    after = whole.step(0, y, action, goal)
    _, reward, over = whole.read(process.dt, after, action, goal)
    one = ca.Function("one", [y, weights, goal], [after, reward, over])
    ys, rewards, ends = one.mapaccum(WINDOW)(
        y, ca.repmat(weights, 1, WINDOW), ca.repmat(goal, 1, WINDOW)
    )
    gained = ca.sum2(rewards)
    outputs = [gained, ca.gradient(gained, weights), ys, ends]
    return ca.Function("window", [weights, goal, y], outputs)


def main():
    draw, windows = np.random.default_rng(0), window()
    weights, first, second = np.zeros((3, SEES * ACTS + ACTS))
    goals, ys = draw.uniform(low, high, (ROBOTS, ACTS)), np.tile(whole.starts[0], (ROBOTS, 1))
    ages = np.arange(ROBOTS) * WINDOW
    curve, begun, turns = [], perf_counter(), TOTAL // (ROBOTS * WINDOW)
    for turn in range(1, turns + 1):
        uphill = np.zeros_like(weights)
        for i in range(ROBOTS):
            _, slope, states, ends = (part.full() for part in windows(weights, goals[i], ys[i]))
            ages[i] += WINDOW
            # A motion into a singular pose has no gradient; its episode ends all the same.
            sound = np.isfinite(slope).all() and np.isfinite(states).all()
            if sound:
                uphill += slope[:, 0] / max(1.0, np.linalg.norm(slope) / LONGEST) / ROBOTS
                ys[i] = states[:, -1]
            if not sound or ends.any() or ages[i] >= process.horizon:
                ys[i], goals[i], ages[i] = whole.starts[0], draw.uniform(low, high), 0
        first, second = 0.9 * first + 0.1 * uphill, 0.99 * second + 0.01 * uphill**2
        spread = np.sqrt(second / (1 - 0.99**turn)) + 1e-8
        rate = RATE * (1 - (turn - 1) / turns)
        weights = weights + rate * first / (1 - 0.9**turn) / spread
        if turn % 10 == 0:
            gained = score(partial(acted, weights))
            curve.append((turn * ROBOTS * WINDOW, gained))
            print(
                f"{curve[-1][0]:9,d} steps   return {gained:6.2f}   {perf_counter() - begun:.1f} s"
            )
    np.savetxt("learning_by_gradients.csv", curve, "%.6g", ",", header="steps,return", comments="")


if __name__ == "__main__":
    main()
