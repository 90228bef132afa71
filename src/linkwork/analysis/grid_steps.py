"""Steps on a grid: which poses lie near others, and from which of them each is gone to."""

from __future__ import annotations

from math import prod

import numpy as np

FEW = 3  # axes of a grid up to which poses that are three steps away are near, too


def neighbours(
    shape: tuple[int, ...], sources: np.ndarray, targets: np.ndarray, steps: np.ndarray
) -> list[tuple[np.ndarray, np.ndarray]]:
    """Return the targets that have a source some steps (K, axes) from them on the grid, and that
    source (indices), step by step."""
    some, found = np.flatnonzero(sources), []
    strides = [prod(shape[axis + 1 :]) for axis in range(len(shape))]
    places = [some // stride % size for stride, size in zip(strides, shape, strict=True)]
    for step in steps.tolist():
        ahead = sum(by * stride for by, stride in zip(step, strides, strict=True))
        moved = [
            (place + by, size) for place, by, size in zip(places, step, shape, strict=True) if by
        ]
        begun = some[np.logical_and.reduce([(to >= 0) & (to < size) for to, size in moved])]
        begun = begun[targets[begun + ahead]]
        found.append((begun + ahead, begun))
    return found


def beside(axes: int) -> np.ndarray:
    """Return the steps (2 axes, axes) to the poses beside one on a grid."""
    ahead = np.eye(axes, dtype=int)
    return np.stack([ahead, -ahead], axis=1).reshape(2 * axes, axes)


def aside(axes: int) -> np.ndarray:
    """Return the steps (K, axes) to further poses near one on a grid, the nearest first: by two in
    all, or three over few axes."""
    most = 3 if axes <= FEW else 2
    found = {(0,) * axes}
    for _ in range(most):
        found |= {tuple((np.array(step) + to).tolist()) for step in found for to in beside(axes)}
    kept = sorted(
        (step for step in found if np.abs(step).sum() > 1),
        key=lambda step: (np.square(step).sum(), step),
    )
    return np.array(kept, int).reshape(len(kept), axes)


def one_of(pairs: list[tuple[np.ndarray, np.ndarray]], count: int) -> tuple[np.ndarray, np.ndarray]:
    """Return each target once, with the last of its sources."""
    source = np.full(count, -1)
    for targets, sources in pairs:
        source[targets] = sources
    found = np.flatnonzero(source >= 0)
    return found, source[found]
