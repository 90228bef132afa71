"""States and motions: what a user passes around. Both are frozen and may be stacked along leading dimensions."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from linkwork.errors import LinkworkError


@dataclass(frozen=True, eq=False)
class State:
    """Hold a closed configuration and its independent rates; leading dimensions stack states.

    positions: coordinates of all joints (..., m) [m, rad], in the order of `joints`
    rates: rates of the actuated joints (..., n) [m/s, rad/s], in the order of `actuators`
    coordinates: the tree's coordinates (..., nq), of which all the others are functions
    """

    positions: np.ndarray
    rates: np.ndarray
    coordinates: np.ndarray
    joints: tuple[str, ...]
    actuators: tuple[str, ...]

    def __getitem__(self, joint: str) -> np.ndarray:
        """Return the coordinate (...) of one joint [m, rad]."""
        if joint not in self.joints:
            raise LinkworkError(f"there is no joint {joint!r}; the joints are {', '.join(self.joints)}")
        return self.positions[..., self.joints.index(joint)]

    @property
    def batch(self) -> tuple[int, ...]:
        """Return the leading dimensions: () for one state."""
        return self.coordinates.shape[:-1]

    def with_rates(self, rates: np.ndarray | list[float]) -> State:
        """Return the same configuration with other independent rates (..., n) [m/s, rad/s]."""
        values = np.asarray(rates, float)
        shape = (*self.batch, len(self.actuators))
        if values.shape not in (shape, shape[-1:]) or not np.isfinite(values).all():
            raise LinkworkError(
                f"rates {values.tolist()} do not fit; give {shape[-1]} finite numbers: {', '.join(self.actuators)}"
            )
        return replace(self, rates=np.broadcast_to(values, shape).copy())

    def at(self, index: int | slice | np.ndarray) -> State:
        """Return some of the stacked states."""
        if not self.batch:
            raise LinkworkError("this is one state, not a stack of states; it has no index")
        return replace(
            self, positions=self.positions[index], rates=self.rates[index], coordinates=self.coordinates[index]
        )

    def __repr__(self) -> str:
        if self.batch:
            return f"State(stack of shape {self.batch}, joints: {', '.join(self.joints)})"
        positions = ", ".join(f"{name}={value:.6g}" for name, value in zip(self.joints, self.positions, strict=True))
        rates = ", ".join(f"{name}={value:.6g}" for name, value in zip(self.actuators, self.rates, strict=True))
        return f"State({positions}; rates: {rates})"


@dataclass(frozen=True, eq=False)
class Motion:
    """Hold a motion of the whole mechanism over time (K samples).

    time: (K,) [s]; state: the K states; rates and joint_accelerations of all joints (K, m); accelerations of the
    actuated joints (K, n); tool: the tool's pose along the way (K, 3 planar or 6 spatial) [m, rad].
    """

    time: np.ndarray
    state: State
    accelerations: np.ndarray
    joint_rates: np.ndarray
    joint_accelerations: np.ndarray
    tool: np.ndarray

    @property
    def positions(self) -> np.ndarray:
        """Return the coordinates of all joints (K, m) [m, rad]."""
        return self.state.positions

    @property
    def rates(self) -> np.ndarray:
        """Return the rates of the actuated joints (K, n) [m/s, rad/s]."""
        return self.state.rates
