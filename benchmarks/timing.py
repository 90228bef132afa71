"""Timing on a noisy machine: contenders take turns in short blocks, so that all of them see the same weather."""

from __future__ import annotations

import gc
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from time import perf_counter

import numpy as np


@dataclass(frozen=True)
class Contender:
    """Name what is timed: a call, and how many items (states, runs) one call handles."""

    call: Callable[[], object]
    items: int = 1


def interleaved(contenders: Mapping[str, Contender], rounds: int = 60, block: float = 2e-3) -> dict[str, np.ndarray]:
    """Time the contenders in turn, a block each, over and over.

    Args:
        contenders: by name.
        rounds: number of turns.
        block: length of a block [s]; a call that takes longer is one block.

    The first call of a block of several is not counted: it finds the caches as the contender before left them.

    Returns:
        Seconds per item in each block, (rounds,) for each name.
    """
    counts = {name: calls_in(contender, block) for name, contender in contenders.items()}
    seconds = {name: np.empty(rounds) for name in contenders}
    gc.disable()
    try:
        for i in range(rounds):
            for name, contender in contenders.items():
                call, repeats = contender.call, range(counts[name])
                if counts[name] > 1:
                    call()
                start = perf_counter()
                for _ in repeats:
                    call()
                seconds[name][i] = (perf_counter() - start) / (counts[name] * contender.items)
    finally:
        gc.enable()
    return seconds


def calls_in(contender: Contender, block: float) -> int:
    """Return how many calls fill a block of so many seconds, at least 1."""
    contender.call()
    count = 1
    while True:
        start = perf_counter()
        for _ in range(count):
            contender.call()
        taken = perf_counter() - start
        if taken > block / 4 or taken > 0.05:
            return max(1, round(block * count / taken))
        count *= 2


def summary(seconds: np.ndarray) -> dict[str, float]:
    """Return the median and the best of many blocks [s]."""
    return {"median": float(np.median(seconds)), "best": float(seconds.min())}
