"""A robot's functions of JAX arrays, by name."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import cached_property
from typing import Any

import jax
import jax.numpy as jnp

from linkwork.autodiff import ArrayFunction, ArrayModel
from linkwork.jax import stepping
from linkwork.jax.calls import Calls
from linkwork.jax.operators import operator
from linkwork.jax.precision import require_doubles
from linkwork.model.state import State
from linkwork.robot import Robot

Array = Any


class JaxModel(ArrayModel):
    """Hold a robot's functions of JAX arrays, as an `ArrayModel` does; they are called by XLA, and
    differentiable in forward and reverse mode alike."""

    def __init__(self, robot: Robot, chart: State | Sequence[str] | None, singular: str):
        super().__init__(robot, chart, singular)
        self._calls = Calls(self.name, self.independent, self._raises)

    def _rolled(self, q: Array, v: Array, u: Array, rest: list[Array]) -> tuple[Array, Array]:
        """Return the states of a rollout; in reverse mode each step is done again on the way back,
        so that memory holds the states alone."""

        @jax.checkpoint
        def onward(state: tuple[Array, Array], u: Array) -> Any:
            after = self._stepping(*self._together(*state, u, *rest))
            return after, after

        _, (later_q, later_v) = jax.lax.scan(onward, (q, v), u)
        return jnp.concatenate([q[None], later_q]), jnp.concatenate([v[None], later_v])

    @staticmethod
    def _doubles(value: Any) -> Array | None:
        require_doubles()
        try:
            array = jnp.asarray(value)
        except (TypeError, ValueError):
            return None
        real = jnp.issubdtype(array.dtype, jnp.number) and not jnp.iscomplexobj(array)
        return array.astype(jnp.float64) if real else None

    @staticmethod
    def _broadcast(arrays: Sequence[Array]) -> list[Array] | None:
        try:
            lead = jnp.broadcast_shapes(*(array.shape[:-1] for array in arrays))
        except ValueError:
            return None
        return [jnp.broadcast_to(array, (*lead, array.shape[-1])) for array in arrays]

    def _operator(self, of: ArrayFunction) -> Callable[..., Array]:
        return operator(of, self._calls)

    @cached_property
    def _closing(self) -> Callable[..., Array]:
        return stepping.closing(self._offered, self._calls)

    @cached_property
    def _stepping(self) -> Callable[..., tuple[Array, Array]]:
        return stepping.stepping(self._offered, self._calls)
