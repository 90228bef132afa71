"""Functions of JAX whose values, and derivatives of first and second order, are calls of compiled
kernels by XLA.

    y = f(x),    dy = J(x) dx,    dJ = (dJ/dx . e_1 ... dJ/dx . e_k) dx

J is a call as well, and what it is multiplied with is plain JAX; so it serves forward and reverse
mode alike, and is evaluated once for all directions. Its own derivative is evaluated for all unit
directions side by side, as so many states. Inputs that nobody perturbs are left out of J.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import cache, partial
from typing import Any

import jax
import jax.numpy as jnp
from jax.custom_derivatives import SymbolicZero

from linkwork.autodiff import ArrayFunction
from linkwork.autodiff.array_function import Wrt
from linkwork.errors import LinkworkError
from linkwork.jax.calls import Calls

Array = Any


def operator(of: ArrayFunction, calls: Calls) -> Callable[..., Array]:
    """Return f as a function of JAX: arrays (..., size) with equal leading dimensions -> (..., m).

    calls: makes XLA's calls of kernels
    """

    # The function itself, whose derivative needs J for the inputs that are perturbed.
    @jax.custom_jvp
    def f(*x: Array) -> Array:
        return calls.of(of.value, of.weighed)(*x)

    @partial(f.defjvp, symbolic_zeros=True)
    def _(x: tuple[Array, ...], dx: tuple[Array, ...]) -> tuple[Array, Array]:
        wrt = perturbed(dx)
        return f(*x), times(slope(wrt)(*x), joined(dx, wrt))

    @cache
    def slope(wrt: Wrt) -> Callable[..., Array]:
        """Return J = dy/dx (..., k, m) for some inputs."""
        shape = of.width(wrt), of.size

        @jax.custom_jvp
        def J(*x: Array) -> Array:
            return shaped(calls.of(of.slope(wrt), of.weighed)(*x), shape)

        @partial(J.defjvp, symbolic_zeros=True)
        def _(x: tuple[Array, ...], dx: tuple[Array, ...]) -> tuple[Array, Array]:
            along = perturbed(dx)
            d = jnp.eye(of.width(along))
            lead = x[0].shape[:-1]
            each = [jnp.broadcast_to(a[..., None, :], (*lead, len(d), a.shape[-1])) for a in x]
            bends = bend(wrt, along)(*each, jnp.broadcast_to(d, (*lead, *d.shape)))
            change = times(bends, joined(dx, along))
            return J(*x), shaped(change, shape)

        return J

    @cache
    def bend(wrt: Wrt, along: Wrt) -> Callable[..., Array]:
        """Return the derivative of J along directions, flat (..., k m)."""

        @jax.custom_jvp
        def B(*x: Array) -> Array:
            return calls.of(of.bend(wrt, along), of.weighed)(*x)

        @B.defjvp
        def _(x: tuple[Array, ...], dx: tuple[Array, ...]) -> tuple[Array, Array]:
            raise LinkworkError(
                f"{of.name} has derivatives of first and second order; a third one was asked for"
            )

        return B

    return f


def perturbed(tangents: Sequence[Array]) -> Wrt:
    """Return the inputs that have tangents."""
    return tuple(i for i, t in enumerate(tangents) if not isinstance(t, SymbolicZero) and t.size)


def joined(tangents: Sequence[Array], wrt: Wrt) -> Array:
    """Return the tangents of some inputs, one after the other."""
    return jnp.concatenate([tangents[i] for i in wrt], axis=-1)


def times(J: Array, dx: Array) -> Array:
    """Return J dx for J (..., k, m), column by column."""
    return jnp.einsum("...km,...k->...m", J, dx)


def shaped(flat: Array, shape: tuple[int, int]) -> Array:
    return flat.reshape(*flat.shape[:-1], *shape)
