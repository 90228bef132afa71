"""Functions with derivatives of their own, as one primitive of JAX.

`jax.custom_jvp` will not do: where JAX parts the body of a `scan` into what it knows and what it
does not, it leaves such rules out, so that a gradient of a `scan` could not be differentiated.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import jax
import jax.numpy as jnp
from jax.core import ShapedArray
from jax.extend.core import Primitive
from jax.interpreters import ad, batching, mlir

Array = Any
Results = tuple[Array, ...]


@dataclass(frozen=True, eq=False)
class JaxFunction:
    """Hold a function of arrays (..., size) with equal leading dimensions -> such arrays, and its
    derivative.

    value: x -> y; jvp: x, dx -> y, dy, where what does not move has `ad.Zero` for dx
    """

    value: Callable[..., Results]
    jvp: Callable[[Sequence[Array], Sequence[Array]], tuple[Results, Results]]

    def __call__(self, *x: Array) -> Results:
        return tuple(evaluation.bind(*map(jnp.asarray, x), of=self))


evaluation = Primitive("linkwork")
evaluation.multiple_results = True


@evaluation.def_impl
def _(*x: Array, of: JaxFunction) -> Results:
    return of.value(*x)


@evaluation.def_abstract_eval
def _(*x: ShapedArray, of: JaxFunction) -> list[ShapedArray]:
    given = [jax.ShapeDtypeStruct(each.shape, each.dtype) for each in x]
    return [ShapedArray(y.shape, y.dtype) for y in jax.eval_shape(of.value, *given)]


def _lowered(context: Any, *x: Any, of: JaxFunction) -> Any:
    return mlir.lower_fun(of.value, multiple_results=True)(context, *x)


def _batched(x: Sequence[Array], places: Sequence[Any], *, of: JaxFunction) -> tuple[Any, Any]:
    """Return results of many states, which lie along the first dimension."""
    pairs = list(zip(x, places, strict=True))
    count = next(a.shape[place] for a, place in pairs if place is not None)
    given = [
        jnp.broadcast_to(a, (count, *a.shape)) if place is None else jnp.moveaxis(a, place, 0)
        for a, place in pairs
    ]
    found = of(*given)
    return found, [0] * len(found)


def _moved(x: Sequence[Array], dx: Sequence[Array], *, of: JaxFunction) -> Any:
    return of.jvp(x, dx)


mlir.register_lowering(evaluation, _lowered, platform="cpu")
batching.primitive_batchers[evaluation] = _batched
ad.primitive_jvps[evaluation] = _moved
