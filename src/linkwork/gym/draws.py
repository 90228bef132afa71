"""Draws: uniform random numbers for the episodes of many environments, each from a stream of its
own."""

from __future__ import annotations

import numpy as np

EPISODES = 64  # for which an environment draws at a time


class Draws:
    """Hold numbers within bounds for the episodes to come of N environments.

    What an environment is given depends on its own generator alone, neither on its neighbours nor
    on when these begin their episodes.

    Attributes:
        numbers: (N, EPISODES, count), of the episodes to come; next: which of them is the next one
            of each environment (N,).
    """

    def __init__(self, generators: list[np.random.Generator], bounds: np.ndarray):
        self.generators = generators
        self._least, self._span = bounds[:, 0], bounds[:, 1] - bounds[:, 0]
        self.numbers = np.empty((len(generators), EPISODES, len(bounds)))
        self.next = np.full(len(generators), EPISODES)

    def renew(self, index: int, generator: np.random.Generator) -> None:
        """Let an environment draw from another generator from now on."""
        self.generators[index], self.next[index] = generator, EPISODES

    def fill(self, who: np.ndarray) -> None:
        """Draw anew for those of some environments whose numbers are used up."""
        for i in who[self.next[who] == EPISODES].tolist():
            drawn = self.generators[i].random(self.numbers.shape[1:])
            self.numbers[i] = self._least + drawn * self._span
            self.next[i] = 0
