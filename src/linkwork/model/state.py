"""States and motions: what a user passes around. Both are frozen and may be stacked along leading
dimensions."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Self

import numpy as np
from numpy.typing import ArrayLike

from linkwork.checks import amount, finite, in_order, reals, shown
from linkwork.errors import LinkworkError
from linkwork.notebooks import Portrayed
from linkwork.readonly import ReadOnlyArrays
from linkwork.simulation.variables import LazyAttribute

Names = tuple[str, ...]
SHOWN, POSITIONS, RATES = 6, 24, 12  # names, numbers of one state in a repr


@dataclass(frozen=True, eq=False)
class State(ReadOnlyArrays):
    """Hold a closed configuration and its independent rates; leading dimensions stack states.

    positions: coordinates of all joints (..., m) [m, rad; 1 of quaternions], in the order of
        `coordinates`
    rates: independent rates v (..., n) [m/s, rad/s], in the order of `independent`
    q: the tree's coordinates (..., nq), of which all the others are functions
    coordinates, independent: names

    One that is made by hand is looked at by each call of a robot that it is given to, which refuses
    numbers that do not belong together.
    """

    positions: np.ndarray
    rates: np.ndarray
    q: np.ndarray
    coordinates: tuple[str, ...]
    independent: tuple[str, ...]

    def __post_init__(self) -> None:
        for name in ("positions", "rates", "q"):
            values = getattr(self, name)
            if (array := reals(values)) is None or not array.ndim:
                raise LinkworkError(f"the state's {name} are {shown(values)}; give arrays")
            object.__setattr__(self, name, array)
        for name in ("coordinates", "independent"):  # by which robots know their own states
            object.__setattr__(self, name, tuple([*getattr(self, name)]))
        super().__post_init__()

    @classmethod
    def known(
        cls, positions: Any, rates: Any, q: Any, coordinates: Names, independent: Names
    ) -> Self:
        """Return a state of numbers that a robot has found: one of its own, which it looks at no
        more."""
        state = object.__new__(cls)
        own = {"positions": positions, "rates": rates, "q": q}
        vars(state).update(own, coordinates=coordinates, independent=independent)
        ReadOnlyArrays.__post_init__(state)
        return state

    def __getitem__(self, coordinate: str) -> np.ndarray:
        """Return one joint coordinate (...) [m, rad]."""
        if not isinstance(coordinate, str) or coordinate not in self.coordinates:
            raise LinkworkError(
                f"there is no joint {shown(coordinate)}; the joints are "
                f"{', '.join(self.coordinates)}"
            )
        return self.positions[..., self.coordinates.index(coordinate)]

    def __iter__(self) -> Iterator[State]:
        """Yield the states of a stack, one after the other."""
        return (self.at(index) for index in range(len(self)))

    def __len__(self) -> int:
        """Return how many states are stacked along the first dimension."""
        if not self.batch:
            raise LinkworkError(
                "this is one state, not a stack; state.positions are its values, named by "
                "state.coordinates"
            )
        return self.batch[0]

    def __bool__(self) -> bool:
        return True

    @property
    def batch(self) -> tuple[int, ...]:
        """Return the leading dimensions: () for one state."""
        return self.q.shape[:-1]

    def with_rates(self, rates: ArrayLike | Mapping[str, float]) -> State:
        """Return the same configuration with other independent rates [m/s, rad/s], n for all or of
        each state (..., n), or by name, others zero."""
        if isinstance(rates, Mapping):
            if not set(rates) <= set(self.independent):
                raise LinkworkError(
                    f"rates of {', '.join(map(str, rates))} do not fit; give some of "
                    f"{', '.join(self.independent)}"
                )
            rates = [rates.get(name, 0.0) for name in self.independent]
        values, shape = finite(rates, "the rates"), self.rates.shape
        if values.shape not in (shape, shape[-1:]):
            raise LinkworkError(
                f"rates {shown(values.tolist())} do not fit; give {len(self.independent)} finite "
                f"numbers: {', '.join(self.independent)}"
            )
        in_order(rates, self.independent, "the rates")
        values = np.broadcast_to(values, shape).copy()
        return State.known(self.positions, values, self.q, self.coordinates, self.independent)

    def at(self, index: int | slice | np.ndarray) -> State:
        """Return some of the stacked states.

        index: into the leading dimensions, as NumPy takes it.
        """
        if not self.batch:
            raise LinkworkError("this is one state, not a stack of states; it has no index")
        try:
            parts = self.positions[index], self.rates[index], self.q[index]
            return State.known(*parts, self.coordinates, self.independent)
        except (IndexError, TypeError, ValueError):
            raise LinkworkError(
                f"index {shown(index)} does not fit a stack of states of the shape {self.batch}"
            ) from None

    def __repr__(self) -> str:
        if self.batch:
            return f"State(stack of shape {self.batch}, coordinates: {_some(self.coordinates)})"
        positions, rates = (
            _some([f"{name}={x:.6g}" for name, x in zip(names, values.flat, strict=False)], most)
            for names, values, most in (
                (self.coordinates, self.positions, POSITIONS),
                (self.independent, self.rates, RATES),
            )
        )
        return f"State({positions}; rates: {rates})"


def with_positions(state: State, positions: np.ndarray) -> State:
    """Return the same states told with other positions (..., m), such as with whole turns of joints
    that close loops."""
    return State.known(positions, state.rates, state.q, state.coordinates, state.independent)


class Reached(State):
    """Hold states whose positions are given, or found when they are first asked for."""

    positions = LazyAttribute()  # pyright: ignore

    def __getstate__(self) -> dict[str, Any]:
        return vars(self) | {"positions": self.positions}


@dataclass(frozen=True, eq=False)
class Motion(ReadOnlyArrays, Portrayed):
    """Hold a motion of the whole mechanism over time (K samples).

    time: (K,) [s]; state: the K states; accelerations: of the independent rates (K, n)
    joint_rates, joint_accelerations: of all joints (K, m)
    tool: the coordinates in which the tool was led (K, d) [m, rad], and what: their names
    forces: of the actuators (K, actuators) [N, N m], where the motion was found with them
    """

    time: np.ndarray
    state: State
    accelerations: np.ndarray
    joint_rates: np.ndarray
    joint_accelerations: np.ndarray
    tool: np.ndarray
    what: tuple[str, ...] = ()
    forces: np.ndarray | None = None

    def __repr__(self) -> str:
        count, joints = len(self.time), _some(self.state.coordinates)
        span = f" from {self.time[0]:.6g} to {self.time[-1]:.6g} s" if count else ""
        return f"Motion({amount(count, 'sample')}{span}, joints: {joints})"

    @property
    def positions(self) -> np.ndarray:
        """Return the coordinates of all joints (K, m) [m, rad]."""
        return self.state.positions

    @property
    def rates(self) -> np.ndarray:
        """Return the independent rates (K, n) [m/s, rad/s]."""
        return self.state.rates


def _some(texts: Sequence[str], most: int = SHOWN) -> str:
    """Return texts in a row, of more than `most` the first ones and how many there are."""
    return ", ".join(texts[:most]) + f", ... ({len(texts)})" * (len(texts) > most)
