"""Files of runs: arrays over named axes as NetCDF and CSV, each written whole or not at all."""

from __future__ import annotations

import contextlib
import csv
import io
import json
import os
import uuid
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from linkwork.errors import LinkworkError
from linkwork.simulation.variables import Variable

if TYPE_CHECKING:
    import xarray

TIME = "time"
EMPTY = "without_elements"  # attribute of a file: what has no element, which NetCDF 3 cannot hold
Arrays = dict[str, Variable]


def write_netcdf(path: Path, dataset: xarray.Dataset, told: Mapping[str, Any]) -> None:
    """Write a dataset as NetCDF (version 3), with attributes beside its own."""
    told = dict(told)
    empty = {
        str(name): (variable.dims, variable.attrs, name in dataset.coords)
        for name, variable in dataset.variables.items()
        if not variable.size
    }
    if empty:
        told[EMPTY] = json.dumps(empty)
    try:
        dataset.drop_vars(list(empty)).assign_attrs(told).to_netcdf(path, engine="scipy")
    except (TypeError, ValueError) as error:
        raise LinkworkError(f"NetCDF cannot hold what the run holds: {error}") from error


def read_netcdf(path: Path) -> tuple[Arrays, Arrays, dict[str, Any]]:
    """Return the variables, the axes' labels and the attributes that `write_netcdf` wrote.

    Raises:
        LinkworkError: the file is missing, no NetCDF file, or damaged.
    """
    import xarray

    # A file that can be read.
    try:
        dataset = xarray.load_dataset(path, engine="scipy")
    except OSError as error:
        raise LinkworkError(
            f"cannot read a run from '{path}': {error.strerror or error}"
        ) from error
    except Exception as error:  # a damaged header misleads the reader in any way
        raise LinkworkError(
            f"cannot read a run from '{path}': it is not a NetCDF file, or damaged"
        ) from error
    # What it holds, and what NetCDF 3 cannot: arrays without elements.
    attrs = dict(dataset.attrs)
    variables, coords = _variables(dataset.data_vars), _variables(dataset.coords)
    for name, (dims, own, *along) in json.loads(attrs.pop(EMPTY, "{}")).items():
        shape, labels = [dataset.sizes.get(dim, 0) for dim in dims], name in dims
        (coords if labels or any(along) else variables)[name] = Variable(
            tuple(dims), np.empty(shape, str if labels else float), own
        )
    return variables, coords, attrs


def _variables(arrays: Mapping[Any, xarray.DataArray]) -> Arrays:
    return {
        str(name): Variable(tuple(map(str, array.dims)), array.values, dict(array.attrs))
        for name, array in arrays.items()
    }


def write_csv(
    path: Path, message: str, variables: Mapping[str, Variable], coords: Mapping[str, Variable]
) -> None:
    """Write what varies with time, a row for each time; units, constants and the message stand
    above in lines that begin with #."""
    time = coords[TIME]
    moving = {name: v for name, v in variables.items() if TIME in v.dims}
    heading, columns = [f"{TIME} [{time.attrs.get('units', '')}]"], [(TIME, time.values)]
    for name, variable in moving.items():
        heading.append(f"{name} [{variable.attrs.get('units', '')}]")
        columns += _columns(name, variable, coords)
    constants = [
        f"{column} = {value} [{variable.attrs.get('units', '')}]"
        for name, variable in variables.items()
        if name not in moving
        for column, value in _columns(name, variable, coords)
    ]
    names = io.StringIO()
    csv.writer(names, lineterminator="\n").writerow(name for name, _ in columns)
    with path.open("w", encoding="utf-8", newline="") as file:
        for line in [message, "units: " + ", ".join(heading), *constants]:
            file.write("# " + " ".join(line.split()) + "\n")
        file.write(names.getvalue())
        np.savetxt(
            file, np.column_stack([values for _, values in columns]), fmt="%.17g", delimiter=","
        )


def _columns(
    name: str, variable: Variable, coords: Mapping[str, Variable]
) -> list[tuple[str, np.ndarray]]:
    """Return the variable's components, named quantity.label.label ..., each over time where it
    varies with time."""
    values, dims = variable.values, variable.dims
    if TIME in dims:
        values = np.moveaxis(values, dims.index(TIME), -1)
        dims = [dim for dim in dims if dim != TIME]
    labels = [
        coords[dim].values if dim in coords else range(n)
        for dim, n in zip(dims, values.shape, strict=False)
    ]
    return [
        (
            ".".join([name, *(str(axis[i]) for axis, i in zip(labels, index, strict=True))]),
            values[index],
        )
        for index in np.ndindex(*values.shape[: len(dims)])
    ]


@contextlib.contextmanager
def whole_or_nothing(path: Path) -> Iterator[Path]:
    """Give a neighbouring path to write to, which becomes `path` when all is written and vanishes
    when anything fails."""
    if not path.parent.is_dir():
        raise LinkworkError(f"cannot write '{path}': there is no folder '{path.parent}'")
    if path.is_dir():
        raise LinkworkError(f"cannot write '{path}': it is a folder")
    part = path.with_name(f".{path.name}.{uuid.uuid4().hex[:8]}.part")
    try:
        yield part
        os.replace(part, path)
    except OSError as error:
        raise LinkworkError(f"cannot write '{path}': {error.strerror or error}") from error
    finally:
        # Where nothing can be written there is nothing to remove either.
        with contextlib.suppress(OSError):
            part.unlink(missing_ok=True)
