"""Timing on a noisy machine: contenders take turns in short blocks, so that all of them see the
same weather."""

from __future__ import annotations

import gc
import os
import tempfile
from collections.abc import Callable, Hashable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from random import Random
from time import perf_counter
from typing import TypeVar
from unittest.mock import patch

import numpy as np

Name = TypeVar("Name", bound=Hashable)


@dataclass(frozen=True)
class Contender:
    """Name what is timed: a call, and how many items (states, runs) one call handles."""

    call: Callable[[], object]
    items: int = 1


def interleaved(
    contenders: Mapping[Name, Contender], rounds: int = 60, block: float = 2e-3
) -> dict[Name, np.ndarray]:
    """Time the contenders in turn, a block each, over and over, in an order that changes from turn
    to turn.

    Args:
        contenders: by name.
        rounds: number of turns.
        block: length of a block [s]; a call that takes longer is one block.

    The first call of a block of several is not counted: it finds the caches as the contender before
    left them.

    Returns:
        Seconds per item in each block, (rounds,) for each name.
    """
    counts = {name: calls_in(contender, block) for name, contender in contenders.items()}
    seconds = {name: np.empty(rounds) for name in contenders}
    order, shuffle = list(contenders), Random(1).shuffle
    gc.disable()
    try:
        for i in range(rounds):
            shuffle(order)
            for name in order:
                call, repeats = contenders[name].call, range(counts[name])
                if counts[name] > 1:
                    call()
                start = perf_counter()
                for _ in repeats:
                    call()
                seconds[name][i] = (perf_counter() - start) / (
                    counts[name] * contenders[name].items
                )
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


def ns(seconds: np.ndarray) -> float:
    """Return the median in nanoseconds."""
    return 1e9 * float(np.median(seconds))


def us(seconds: np.ndarray) -> float:
    """Return the median in microseconds."""
    return 1e6 * float(np.median(seconds))


def best(seconds: np.ndarray) -> str:
    """Say how long the quickest block took, in ns, µs or ms."""
    least = float(seconds.min())
    scale, unit = next(
        pair
        for pair in ((1e9, "ns"), (1e6, "µs"), (1e3, "ms"))
        if least * pair[0] < 1e3 or pair[1] == "ms"
    )
    return f"best {scale * least:.3g} {unit}"


@contextmanager
def empty_cache() -> Iterator[None]:
    """Let kernels be compiled anew: a folder of its own, empty at first, takes the place of the
    user's cache."""
    with tempfile.TemporaryDirectory() as folder, patch.dict(os.environ, LINKWORK_CACHE_DIR=folder):
        yield
