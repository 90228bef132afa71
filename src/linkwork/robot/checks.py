"""Refusals at the robot's doors: each one sentence with what is wrong, where, and what would be right."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from typing import TYPE_CHECKING, NoReturn

import numpy as np
from numpy.typing import ArrayLike

from linkwork.errors import LinkworkError
from linkwork.robot.assembly import wrapped

if TYPE_CHECKING:
    from linkwork.robot.robot import Robot


PIVOT_BOUND = 1e-4  # errors of v enter the dependent rates multiplied by about 1 / pivot


class SingularError(LinkworkError):
    """Refuse a configuration where the actuated rates do not determine the motion."""


def finite(values: ArrayLike, what: str) -> np.ndarray:
    """Return values as floats; refuse what is not a finite number."""
    try:
        array = np.asarray(values, float)
    except (TypeError, ValueError):
        raise LinkworkError(f"{what} is {values!r}; give numbers") from None
    if not np.isfinite(array).all():
        index = tuple(int(i) for i in np.argwhere(~np.isfinite(array))[0])
        place = f"{what}[{', '.join(map(str, index))}]" if index else what
        raise LinkworkError(f"{place} is {array[index]}; give finite numbers")
    return array


def positive(value: float, what: str) -> None:
    if not 0 < value < np.inf:
        raise LinkworkError(f"{what} is {value}; give a positive number")


def known(names: Iterable[str], allowed: Sequence[str], kind: str) -> None:
    for name in names:
        if name not in allowed:
            raise LinkworkError(f"there is no {kind} {name!r}; the {kind}s are {', '.join(allowed)}")


def values_by_name(values: ArrayLike | Mapping[str, ArrayLike], names: Sequence[str], what: str) -> np.ndarray:
    """Return an array (..., len(names)) from an array in the order of the names or a mapping by name."""
    if isinstance(values, Mapping):
        known(values, names, "joint")
        missing = [name for name in names if name not in values]
        if missing:
            raise LinkworkError(f"{what} lack {', '.join(missing)}; give all of {', '.join(names)}")
        parts = [finite(values[name], f"{what}[{name!r}]") for name in names]
        return np.stack(np.broadcast_arrays(*parts), axis=-1)
    array = finite(values, what)
    if array.shape[-1:] != (len(names),):
        refuse_shape(array, what, names)
    return array


def refuse_shape(array: np.ndarray, what: str, names: Sequence[str]) -> NoReturn:
    raise LinkworkError(
        f"{what} has shape {array.shape}; give {len(names)} numbers in the last dimension: {', '.join(names)}"
    )


def refuse_foreign(state: object, joints: Sequence[str], actuators: Sequence[str]) -> None:
    """Refuse what is not a state of this robot; states of an equal robot (the same joints) are accepted."""
    found = getattr(state, "joints", None)
    if found is None:
        raise LinkworkError(f"a state is needed, not {type(state).__name__}; make one by robot.state or robot.assemble")
    if state.actuators != actuators:  # pyright: ignore[reportAttributeAccessIssue]
        raise LinkworkError(f"the state belongs to another robot: its rates are those of {', '.join(state.actuators)}")  # pyright: ignore
    if found != joints:
        raise LinkworkError(
            f"the state belongs to another robot: its joints are {', '.join(found)}, not {', '.join(joints)}"
        )


def require_closed(gap: np.ndarray, tolerance: float, row: Callable[[tuple[int, ...]], str]) -> None:
    """Refuse configurations whose loops are open; name the first of them and its worst row."""
    if not (gap > tolerance).any():
        return
    index = tuple(int(i) for i in np.argwhere(gap > tolerance)[0])
    which = f" of state {', '.join(map(str, index))}" if index else ""
    raise LinkworkError(
        f"the loops{which} are open by {gap[index]:.3g} ({row(index)}), more than the tolerance {tolerance:g}; "
        "close them by robot.assemble, or raise the tolerance"
    )


def require_consistent(
    closed: np.ndarray, given: np.ndarray, joints: Sequence[str], angular: np.ndarray, tolerance: float
) -> None:
    """Refuse coordinates that contradict the closed configuration; angles may differ by whole turns."""
    error = given - closed
    error = np.where(angular, wrapped(error), error)
    if not (np.abs(error) > 10 * tolerance).any():
        return
    index = tuple(int(i) for i in np.argwhere(np.abs(error) > 10 * tolerance)[0])
    raise LinkworkError(
        f"joint {joints[index[-1]]!r} is given as {given[index]:.6g}, but the other joints make it {closed[index]:.6g}"
    )


@contextmanager
def at(place: str) -> Iterator[None]:
    """Prefix the sentence of a refusal with the place where it happened."""
    try:
        yield
    except LinkworkError as error:
        raise type(error)(f"{place}{error}") from None


def singular(robot: Robot, pivot: np.ndarray) -> SingularError:
    """Return the refusal of a singular configuration, with its kind."""
    weakest = np.unravel_index(int(np.argmin(np.nan_to_num(pivot[..., 0], nan=-1.0))), pivot.shape[:-1])
    which = f" of state {', '.join(str(int(i)) for i in weakest)}" if weakest else ""
    return SingularError(
        f"the configuration{which} is actuator-singular (smallest relative pivot {float(pivot[(*weakest, 0)]):.2g}): with "
        f"{', '.join(robot.actuators)} locked the mechanism can still move, so their forces do not determine the motion; "
        "choose another configuration"
    )
