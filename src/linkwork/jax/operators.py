"""Functions of JAX whose values, and derivatives of first and second order, are calls of compiled
kernels by XLA.

    y = f(x),    dy = J(x) dx,    dJ = (dJ/dx . e_1 ... dJ/dx . e_k) dx

J is a call as well, and what it is multiplied with is plain JAX; so it serves forward and reverse
mode alike, and is evaluated once for all directions. Its own derivative is evaluated for all unit
directions side by side, as so many states. Inputs that nobody perturbs are left out of J.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import cache
from typing import Any, NoReturn

import jax.numpy as jnp
from jax.interpreters.ad import Zero

from linkwork.autodiff import ArrayFunction
from linkwork.autodiff.array_function import Wrt
from linkwork.errors import LinkworkError
from linkwork.jax.calls import Calls
from linkwork.jax.jax_function import JaxFunction

Array = Any


def operator(of: ArrayFunction, calls: Calls) -> Callable[..., Array]:
    """Return f as a function of JAX: arrays (..., size) with equal leading dimensions -> (..., m).

    calls: makes XLA's calls of kernels
    """

    # The function itself, whose derivative needs J for the inputs that are perturbed.
    def jvp(x: Sequence[Array], dx: Sequence[Array]) -> tuple[tuple[Array], tuple[Array]]:
        y, wrt = f(*x), perturbed(dx)
        return (y,), (times(slope(wrt)(*x), joined(dx, wrt)) if wrt else jnp.zeros_like(y),)

    @cache
    def slope(wrt: Wrt) -> Callable[..., Array]:
        """Return J = dy/dx (..., k, m) for some inputs."""
        shape = of.width(wrt), of.size

        def jvp(x: Sequence[Array], dx: Sequence[Array]) -> tuple[tuple[Array], tuple[Array]]:
            along = perturbed(dx)
            if not along:
                return (J(*x),), (jnp.zeros_like(J(*x)),)
            d = jnp.eye(of.width(along))
            lead = x[0].shape[:-1]
            each = [jnp.broadcast_to(a[..., None, :], (*lead, len(d), a.shape[-1])) for a in x]
            bends = bend(wrt, along)(*each, jnp.broadcast_to(d, (*lead, *d.shape)))
            return (J(*x),), (times(bends, joined(dx, along)),)

        J = made(lambda *x: calls.of(of.slope(wrt), of.weighed)(*x), jvp)
        return lambda *x: shaped(J(*x), shape)

    @cache
    def bend(wrt: Wrt, along: Wrt) -> Callable[..., Array]:
        """Return the derivative of J along directions, flat (..., k m)."""

        def jvp(x: Sequence[Array], dx: Sequence[Array]) -> NoReturn:
            raise LinkworkError(
                f"{of.name} has derivatives of first and second order; a third one was asked for"
            )

        return made(lambda *x: calls.of(of.bend(wrt, along), of.weighed)(*x), jvp)

    f = made(lambda *x: calls.of(of.value, of.weighed)(*x), jvp)
    return f


def made(value: Callable[..., Array], jvp: Callable[..., Any]) -> Callable[..., Array]:
    """Return a function with one result that has a derivative of its own."""
    own = JaxFunction(lambda *x: (value(*x),), jvp)
    return lambda *x: own(*x)[0]


def perturbed(tangents: Sequence[Array]) -> Wrt:
    """Return the inputs that have tangents."""
    return tuple(i for i, t in enumerate(tangents) if not isinstance(t, Zero) and t.shape[-1])


def joined(tangents: Sequence[Array], wrt: Wrt) -> Array:
    """Return the tangents of some inputs, one after the other."""
    return jnp.concatenate([tangents[i] for i in wrt], axis=-1)


def times(J: Array, dx: Array) -> Array:
    """Return J dx for J (..., k, m), column by column."""
    return jnp.einsum("...km,...k->...m", J, dx)


def shaped(flat: Array, shape: tuple[int, int]) -> Array:
    return flat.reshape(*flat.shape[:-1], *shape)
