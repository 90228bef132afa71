"""Awaited: arrays in datasets of `xarray` that are found when they are first asked for, as those of
files are read.
"""

from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np
from xarray.backends import BackendArray
from xarray.core import indexing


class AwaitedArray(BackendArray):
    """Stand for an array of floats of some shape, which `find` gives when it is first asked for."""

    def __init__(self, shape: tuple[int, ...], find: Callable[[], np.ndarray]):
        self.shape, self.dtype, self._find = shape, np.dtype(float), find

    def __getitem__(self, key: Any) -> Any:
        outer = indexing.IndexingSupport.OUTER
        return indexing.explicit_indexing_adapter(key, self.shape, outer, self._part)

    def _part(self, key: tuple[Any, ...]) -> np.ndarray:
        return self._find()[key]

    def __reduce__(self) -> tuple[Any, ...]:
        return AwaitedArray, (self.shape, partial(np.asarray, self._find()))

    @classmethod
    def protected(cls, shape: tuple[int, ...], find: Callable[[], np.ndarray]) -> Any:
        """Return such an array that is kept when it was found, and copied when it is written to."""
        lazy = indexing.LazilyIndexedArray(cls(shape, find))
        return indexing.MemoryCachedArray(indexing.CopyOnWriteArray(lazy))  # pyright: ignore
