"""Variables: arrays over named axes, and the datasets of `xarray` that hold them.

An axis that comes again, such as that of a robot's joints, is indexed once: that takes most of the
time that a dataset of a short run takes.
"""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from functools import lru_cache
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np

from linkwork.errors import LinkworkError

if TYPE_CHECKING:
    import xarray

FEW = 1000  # labels of an axis that are kept
Value = TypeVar("Value")


class LazyAttribute:
    """Let a value be given, or what finds it when it is first asked for."""

    def __set_name__(self, owner: type, name: str) -> None:
        self.name = name

    def __get__(self, run: object, owner: type | None = None) -> Any:
        if run is None:
            raise AttributeError(self.name)  # a field without a default
        value = vars(run)[self.name]
        if callable(value):
            value = vars(run)[self.name] = value()
            if isinstance(value, np.ndarray):
                value.flags.writeable = False
        return value

    def __set__(self, run: object, value: object) -> None:
        vars(run)[self.name] = value


class Deferred(Mapping[str, Value]):
    """Hold values in groups, each found when one of it is first asked for: what nobody looks at
    costs nothing.

    groups: what finds a group, by the names that it may give
    """

    def __init__(self, groups: Mapping[tuple[str, ...], Callable[[], Mapping[str, Value]]]):
        self._groups = groups
        self._found: dict[tuple[str, ...], Mapping[str, Value]] = {}

    def _group(self, names: tuple[str, ...]) -> Mapping[str, Value]:
        if names not in self._found:
            self._found[names] = self._groups[names]()
        return self._found[names]

    def __getitem__(self, name: str) -> Value:
        for names in self._groups:
            if name in names:
                return self._group(names)[name]
        raise KeyError(name)

    def __iter__(self) -> Iterator[str]:
        return iter([name for names in self._groups for name in self._group(names)])

    def __len__(self) -> int:
        return sum(len(self._group(names)) for names in self._groups)

    def __repr__(self) -> str:
        return repr(dict(self))


@dataclass(frozen=True, eq=False)
class Variable:
    """Name the axes of an array: `dims`, one name for each axis; `attrs` hold at least the "units".

    values: the array, or what finds it when it is first asked for; then `shape` is to be given
    """

    dims: tuple[str, ...]
    values: np.ndarray = LazyAttribute()  # pyright: ignore
    attrs: Mapping[str, Any] = field(default_factory=dict)
    shape: tuple[int, ...] = ()

    def __post_init__(self):
        if not self.known:
            return
        values = np.asarray(self.values)
        if values.ndim != len(self.dims):
            raise LinkworkError(
                f"an array of the shape {values.shape} needs {values.ndim} axis names, not "
                f"{self.dims}"
            )
        values = values.view()
        values.flags.writeable = False
        object.__setattr__(self, "values", values)
        object.__setattr__(self, "shape", values.shape)

    def __getstate__(self) -> dict[str, Any]:
        return vars(self) | {"values": self.values}

    @property
    def known(self) -> bool:
        """Whether the array was given, or asked for."""
        return not callable(vars(self)["values"])


def dataset_of(
    variables: Mapping[str, Variable], coords: Mapping[str, Variable], attrs: Mapping[str, Any]
) -> "xarray.Dataset":
    """Return variables over axes with labels `coords` as an `xarray.Dataset`."""
    import xarray

    arrays, indexes = {}, {}
    for name, variable in coords.items():
        if variable.dims == (name,):
            values = variable.values
            few = values.dtype == object and values.size <= FEW
            indexes[name] = kept_index(name, tuple(values)) if few else index_of(name, values)
            arrays |= indexes[name].create_variables({name: entry(variable)})
        else:
            arrays[name] = entry(variable)
    labels = xarray.Coordinates(arrays, indexes=indexes)
    values = {name: entry(variable) for name, variable in variables.items()}
    return xarray.Dataset(values, labels, dict(attrs))


def entry(variable: Variable) -> "xarray.Variable":
    """Return a variable as `xarray` holds it; an array that was not asked for yet still is not."""
    import xarray

    if variable.known:
        return xarray.Variable(variable.dims, variable.values, dict(variable.attrs))
    from linkwork.simulation.awaited import AwaitedArray

    values = AwaitedArray.protected(variable.shape, lambda: variable.values)
    return xarray.Variable(variable.dims, values, dict(variable.attrs))


def index_of(axis: str, labels: np.ndarray) -> "xarray.indexes.PandasIndex":
    """Return the index of an axis."""
    import xarray.indexes

    variable = xarray.Variable((axis,), labels)
    return xarray.indexes.PandasIndex.from_variables({axis: variable}, options={})


@lru_cache(maxsize=256)
def kept_index(axis: str, labels: tuple[Any, ...]) -> "xarray.indexes.PandasIndex":
    """Return the index of an axis with few labels, which nobody may change."""
    names = np.array(labels, dtype=object)
    names.flags.writeable = False
    return index_of(axis, names)
