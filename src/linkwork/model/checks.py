"""Refusals at the robot's doors: each one sentence with what is wrong, where, and what would be
right."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from functools import lru_cache
from typing import NoReturn

import numpy as np
from numpy.typing import ArrayLike

from linkwork.checks import amount as amount
from linkwork.checks import amount_is as amount_is
from linkwork.checks import at as at
from linkwork.checks import finite, reals, shown
from linkwork.checks import in_order as in_order
from linkwork.checks import known as known
from linkwork.checks import names as names
from linkwork.checks import number as number
from linkwork.checks import positive as positive
from linkwork.equations.chart import Chart
from linkwork.errors import LinkworkError
from linkwork.model.state import State

DOUBLE = np.dtype(float)
OPEN_LOOPS = 1e-6  # gaps of loops, in the mechanism's own units, that no state of a robot has
APART = 1e-3  # of positions and those that q tells, in own units: what such gaps may make
PIVOT_BOUND = 1e-4  # errors of v enter the dependent rates multiplied by about 1 / pivot


class SingularError(LinkworkError):
    """Refuse a configuration where the actuated rates do not determine the motion."""


@lru_cache(maxsize=1024)
def sure(chart: Chart) -> float:
    """Return the relative pivot from which on errors are rounding alone: cofactors of a block
    behind it multiply as many of the elements that a weak pivot makes large as the block has
    rows."""
    sizes = [len(block.rows) for stage in chart.stages for block in stage.blocks[1:]]
    return PIVOT_BOUND ** (1 / max(sizes, default=1))


def weakest(pivot: np.ndarray) -> float:
    """Return the smallest size of pivots, infinite of none; of one state by plain numbers, which
    are the quicker ones."""
    return abs(pivot.item()) if pivot.size == 1 else np.abs(pivot).min(initial=np.inf)


def together(*shapes: tuple[int, ...]) -> tuple[int, ...]:
    """Return the common leading dimensions of stacks; refuse stacks of different length."""
    if len(shapes) == 1:
        return shapes[0]
    try:
        return np.broadcast_shapes(*shapes)
    except ValueError:
        lengths = " and ".join(map(str, shapes))
        raise LinkworkError(
            f"stacks of the shapes {lengths} do not fit together; give equal ones, or one of each"
        ) from None


def values_by_name(
    values: ArrayLike | Mapping[str, ArrayLike], names: Sequence[str], what: str, kind: str
) -> np.ndarray:
    """Return an array (..., len(names)) from an array in the order of the names or a mapping by
    name.

    what: the values; kind: what the names are those of
    """
    if isinstance(values, Mapping):
        known(values, names, kind)
        missing = [name for name in names if name not in values]
        if missing:
            other = (
                "; robot.assemble closes the loops from some of them" if what == "positions" else ""
            )
            raise LinkworkError(
                f"{what} lack {', '.join(missing)}; give all of {', '.join(names)}{other}"
            )
        return joined(values, names, what)
    array = finite(values, what)
    if array.shape[-1:] != (len(names),):
        refuse_shape(array, what, names)
    in_order(values, names, what)
    return array


def joined(values: Mapping[str, ArrayLike], names: Sequence[str], what: str) -> np.ndarray:
    """Return an array (..., len(names)) of values by name; all names have one."""
    parts = [finite(values[name], f"{what}[{name!r}]") for name in names]
    batch = together(*{part.shape for part in parts})
    if not batch:
        return np.array(parts)
    return np.stack([np.broadcast_to(part, batch) for part in parts], axis=-1)


def actuator_forces(
    forces: ArrayLike | Mapping[str, ArrayLike], actuators: Sequence[str]
) -> np.ndarray:
    """Return u (..., actuators) from an array in their order, or by name, zero where left out."""
    if not isinstance(forces, np.ndarray) and isinstance(forces, Mapping):
        known(forces, actuators, "actuator")
        return joined({name: forces.get(name, 0.0) for name in actuators}, actuators, "forces")
    return vector(forces, "forces", actuators, "actuator")


def vector(
    values: ArrayLike | Mapping[str, ArrayLike], what: str, names: Sequence[str], kind: str
) -> np.ndarray:
    """Return an array (..., len(names)) as `values_by_name` does; an array of floats is not looked
    through."""
    if type(values) is np.ndarray and values.dtype == DOUBLE and values.shape[-1:] == (len(names),):
        return values
    if isinstance(values, Mapping):
        return values_by_name(values, names, what, kind)
    array = reals(values)
    if array is None:
        raise LinkworkError(
            f"{what} is {shown(values)}; give {amount(len(names), 'number')}: {', '.join(names)}"
        )
    if array.shape[-1:] != (len(names),):
        refuse_shape(array, what, names)
    in_order(values, names, what)
    return array


def accelerations(
    values: ArrayLike | Mapping[str, ArrayLike], independent: Sequence[str]
) -> np.ndarray:
    """Return v' (..., n) from an array in the order of the independent rates, or by name."""
    return vector(values, "accelerations", independent, "independent rate")


def refuse_shape(array: np.ndarray, what: str, names: Sequence[str]) -> NoReturn:
    if not names:
        raise LinkworkError(f"{what} has shape {array.shape}; there are none here: give []")
    raise LinkworkError(
        f"{what} has shape {array.shape}; give {amount(len(names), 'number')} in the last "
        f"dimension: {', '.join(names)}"
    )


def refuse_foreign(
    state: object, coordinates: Sequence[str], charts: Iterable[tuple[object, ...]], nq: int
) -> None:
    """Refuse what is not a state of this robot; states of an equal robot (the same joints) are
    accepted.

    nq: how many coordinates its tree has
    """
    if not isinstance(state, State):
        raise LinkworkError(
            f"a state is needed, not {type(state).__name__}; make one by robot.state or "
            "robot.assemble"
        )
    if state.independent not in charts:
        rates = ", ".join(state.independent)
        raise LinkworkError(f"the state belongs to another robot: its rates are those of {rates}")
    if state.coordinates != coordinates:
        found = ", ".join(state.coordinates)
        raise LinkworkError(
            f"the state belongs to another robot: its joints are {found}, not "
            f"{', '.join(coordinates)}"
        )
    counts = {"positions": len(coordinates), "rates": len(state.independent), "q": nq}
    for name, count in counts.items():
        if getattr(state, name).shape != (*state.batch, count):
            raise LinkworkError(
                f"the state's {name} have the shape {getattr(state, name).shape}, not "
                f"{(*state.batch, count)}; make it by robot.state or robot.assemble"
            )
    if not state.batch:
        finite(state.q, "the state's q")


def refuse_apart(state: State, gap: np.ndarray, told: np.ndarray, sizes: np.ndarray) -> None:
    """Refuse a state whose loops are open, or whose positions are not those that its q tells.

    gap: of the loops (...), in own units; told: positions by q (..., m); sizes: own units of these
    (m)
    """
    if (worst := float(gap.max(initial=0.0))) > OPEN_LOOPS:
        raise LinkworkError(
            f"the state belongs to another robot: its loops are open by {worst:.3g} here; make one "
            "by this robot"
        )
    if state.batch and not np.isfinite(state.q).all():  # some of it has failed
        return
    apart = np.abs(told - state.positions) / sizes
    if not (apart <= APART).all():
        place = np.unravel_index(int(np.argmax(np.nan_to_num(apart, nan=np.inf))), apart.shape)
        raise LinkworkError(
            f"the state's positions are not those of its q: {state.coordinates[int(place[-1])]} is "
            f"{state.positions[place]:.6g}, and by q {told[place]:.6g}; make it by robot.state or "
            "robot.assemble"
        )


def require_closed(
    gap: np.ndarray, tolerance: float, row: Callable[[tuple[int, ...]], str]
) -> None:
    """Refuse configurations whose loops are open; name the first of them, and its worst row."""
    if (gap <= tolerance).all():
        return
    index = tuple(int(i) for i in np.argwhere(~(gap <= tolerance))[0])
    which = f" of state {', '.join(map(str, index))}" if index else ""
    raise LinkworkError(
        f"the loops{which} are open by {gap[index]:.3g} ({row(index)}), more than the tolerance "
        f"{tolerance:g}; close them by robot.assemble, or raise the tolerance"
    )


def singular(independent: Sequence[str], pivot: np.ndarray) -> SingularError:
    """Return the refusal of a configuration where the independent rates do not determine the
    motion."""
    weakest = np.unravel_index(
        int(np.argmin(np.nan_to_num(np.abs(pivot[..., 0]), nan=-1.0))), pivot.shape[:-1]
    )
    which = f" of state {', '.join(str(int(i)) for i in weakest)}" if weakest else ""
    return SingularError(
        f"the configuration{which} is singular (smallest relative pivot "
        f"{abs(float(pivot[(*weakest, 0)])):.2g}): with {', '.join(independent)} locked the "
        "mechanism can still move (where they are the actuators: it is actuator-singular); "
        "choose another configuration, or other independent rates by robot.in_chart"
    )
