"""Draws: uniform random numbers for the episodes of many environments, each from a stream of its
own."""

from __future__ import annotations

import numpy as np

EPISODES = 16  # for which an environment draws at a time


class Draws:
    """Hand out so many numbers within 0 and 1 for an episode of any of N environments.

    What an environment is given depends on its own generator alone, neither on its neighbours nor
    on when these begin their episodes.
    """

    def __init__(self, generators: list[np.random.Generator], count: int):
        self.generators = generators
        self._numbers = np.empty((len(generators), EPISODES, count))
        self._next = np.full(len(generators), EPISODES)

    def renew(self, index: int, generator: np.random.Generator) -> None:
        """Let an environment draw from another generator from now on."""
        self.generators[index], self._next[index] = generator, EPISODES

    def take(self, who: np.ndarray) -> np.ndarray:
        """Return numbers (M, count) for the next episodes of some environments."""
        for i in who[self._next[who] == EPISODES].tolist():
            self.generators[i].random(out=self._numbers[i])
            self._next[i] = 0
        found = self._numbers[who, self._next[who]]
        self._next[who] += 1
        return found
